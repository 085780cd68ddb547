"""Errors and orders of convergence against sequences whose order is known."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from liaisons.check import crossings, frequencies, hamiltonian_flow, max_error, slope
from liaisons.errors import ValidityError

STEPS = np.array([0.2, 0.1, 0.05, 0.025])


@pytest.mark.parametrize("order", [1, 2, 6])
def test_slope_of_a_power_is_its_exponent(order: int) -> None:
    # Logarithms and one division: a few roundings of numbers of size 10.
    assert slope(STEPS, 3.0 * STEPS**order) == pytest.approx(order, abs=1e-13)


@pytest.mark.parametrize(
    ("h", "errors", "words"),
    [
        ([0.1, 0.2], [1e-2, 1e-1], "2 points; a slope needs at least 3"),
        ([0.1, 0.2, 0.4], [0.0, 1e-2, 1e-1], "errors .* must be finite and > 0"),
        ([0.1, 0.2, 0.4], [math.nan, 1e-2, 1e-1], "errors .* must be finite and > 0"),
        ([-0.1, 0.2, 0.4], [1e-3, 1e-2, 1e-1], "step sizes .* must be finite and > 0"),
        ([0.1, 0.1, 0.1], [1e-3, 1e-2, 1e-1], "give different ones"),
        ([0.1, 0.2, 0.4], [1e-3, 1e-2], "one error per step size"),
    ],
)
def test_slope_refuses_what_has_no_order(h: list[float], errors: list[float], words: str) -> None:
    with pytest.raises(ValidityError, match=words):
        slope(h, errors)


def test_max_error_finds_the_largest_difference_whatever_its_sign() -> None:
    assert max_error([1.0, 2.0, -3.0], [1.5, 2.0, -1.0]) == 2.0
    assert max_error([[1.0, 2.0], [3.0, 4.0]], 1.0) == 3.0
    assert math.isnan(max_error([1.0, math.nan], [1.0, 2.0]))


@pytest.mark.parametrize(("values", "reference"), [([], []), ([1.0, 2.0], [1.0]), ([[1.0, 2.0]], [1.0, 2.0])])
def test_max_error_refuses_arrays_that_do_not_correspond(values: list, reference: list) -> None:
    with pytest.raises(ValidityError, match="same instants"):
        max_error(values, reference)


def test_a_cubic_passes_zero_where_it_does() -> None:
    t = np.linspace(-2.0, 2.0, 8)
    found = crossings(t, t * (t - 1) * (t + 1.3), 3 * t**2 + 0.6 * t - 1.3)
    assert found == pytest.approx([-1.3, 0.0, 1.0], abs=1e-14)  # the spline is the cubic
    assert crossings(t, t * (t - 1) * (t + 1.3), 3 * t**2 + 0.6 * t - 1.3, rising=True) == pytest.approx(found[[0, 2]])


def test_frequencies_of_cosines_of_any_phase() -> None:
    t, omega = 0.1 * np.arange(50), np.array([[0.5], [3.0], [12.0]])
    assert frequencies(2 * np.cos(omega * t + omega), 0.1) == pytest.approx(omega[:, 0], rel=1e-12)
    assert frequencies(np.cos(3 * t), 0.1) == pytest.approx(3.0, rel=1e-12)


def _circles(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    return (p**2 + q**2) / 2


def test_hamilton_s_equations_follow_from_the_hamiltonian() -> None:
    t = np.linspace(0.0, 5.0, 20).reshape(4, 5)
    q, p = hamiltonian_flow(_circles, [1.0, 0.5], t)
    # 1e-13 a step, of which there are some twenty
    assert q == pytest.approx(np.cos(t) + 0.5 * np.sin(t), abs=1e-12)
    assert p == pytest.approx(0.5 * np.cos(t) - np.sin(t), abs=1e-12)
    assert hamiltonian_flow(_circles, [1.0, 0.5], 5.0) == pytest.approx([q[-1, -1], p[-1, -1]], abs=0)
    assert hamiltonian_flow(_circles, [1.0, 0.0], 0.5) == pytest.approx([np.cos(0.5), -np.sin(0.5)], abs=1e-12)


def test_a_kepler_ellipse_closes() -> None:
    start = [1.0, 0.0, 0.0, 1.2]  # semi-axis a = 1/(2 - 1.44): once round in 2π √a³
    found = hamiltonian_flow(
        lambda x, y, p, r: (p**2 + r**2) / 2 - (x**2 + y**2) ** -0.5, start, 2 * np.pi * 0.56**-1.5
    )
    assert found == pytest.approx(start, abs=1e-11)  # amplified by the period's dependence on the energy


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: crossings([0.0, 1.0], [1.0, 2.0, 3.0], [1.0, 2.0]), r"shapes \(2,\), \(3,\), \(2,\)"),
        (lambda: crossings([0.0, 0.0], [1.0, 2.0], [1.0, 2.0]), "increasing instants"),
        (lambda: frequencies([1.0, 2.0], 0.1), "three values"),
        (lambda: frequencies([1.0, 2.0, 3.0], np.nan), "step = nan"),
        (lambda: hamiltonian_flow(_circles, [1.0, 0.0, 0.0], 1.0), r"shape \(3,\); give as many p as q"),
        (lambda: hamiltonian_flow(_circles, [1.0, 0.0], [1.0, 0.5]), "ascend"),
        (lambda: hamiltonian_flow(lambda q, p: p**2 - q**4, [1.0, 1.0], 9.0), "stopped at t = "),
    ],
)
def test_what_is_no_motion(call: Callable[[], object], words: str) -> None:
    with pytest.raises(ValidityError, match=words):
        call()
