"""Errors and orders of convergence against sequences whose order is known."""

import math

import numpy as np
import pytest

from liaisons.check import max_error, slope
from liaisons.errors import ValidityError

STEPS = np.array([0.2, 0.1, 0.05, 0.025])


@pytest.mark.parametrize("order", [1, 2, 6])
def test_slope_of_a_power_is_its_exponent(order: int) -> None:
    # Logarithms and one division: a few roundings of numbers of size 10.
    assert slope(STEPS, 3.0 * STEPS**order) == pytest.approx(order, abs=1e-13)


def test_slope_leaves_out_the_rounding_floor_only_when_told() -> None:
    errors = np.maximum(STEPS**6, 1e-8)
    assert slope(STEPS, errors) < 5.9
    assert slope(STEPS, errors, floor=1e-8) == pytest.approx(6, abs=1e-13)  # rounding of the logarithms


@pytest.mark.parametrize(
    ("h", "errors", "floor", "words"),
    [
        ([0.1, 0.2], [1e-2, 1e-1], 0.0, "needs at least 3"),
        ([0.1, 0.2, 0.4], [1e-9, 1e-2, 1e-1], 1e-8, "2 points above the floor"),
        ([0.1, 0.2, 0.4], [0.0, 1e-2, 1e-1], 0.0, "errors .* must be finite and > 0"),
        ([0.1, 0.2, 0.4], [math.nan, 1e-2, 1e-1], 1e-8, "errors .* must be finite and > 0"),
        ([-0.1, 0.2, 0.4], [1e-3, 1e-2, 1e-1], 0.0, "step sizes .* must be finite and > 0"),
        ([0.1, 0.1, 0.1], [1e-3, 1e-2, 1e-1], 0.0, "give different ones"),
        ([0.1, 0.2, 0.4], [1e-3, 1e-2], 0.0, "one error a step size"),
    ],
)
def test_slope_refuses_what_has_no_order(h: list[float], errors: list[float], floor: float, words: str) -> None:
    with pytest.raises(ValidityError, match=words):
        slope(h, errors, floor=floor)


def test_max_error_finds_the_largest_difference_whatever_its_sign() -> None:
    assert max_error([1.0, 2.0, -3.0], [1.5, 2.0, -1.0]) == 2.0
    assert max_error([[1.0, 2.0], [3.0, 4.0]], 1.0) == 3.0
    assert math.isnan(max_error([1.0, math.nan], [1.0, 2.0]))


@pytest.mark.parametrize(("values", "reference"), [([], []), ([1.0, 2.0], [1.0]), ([[1.0, 2.0]], [1.0, 2.0])])
def test_max_error_refuses_arrays_that_do_not_correspond(values: list, reference: list) -> None:
    with pytest.raises(ValidityError, match="same instants"):
        max_error(values, reference)
