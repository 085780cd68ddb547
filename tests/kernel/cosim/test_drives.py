"""Functions of time that drive inputs, without any FMU."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.interpolate import BPoly, PchipInterpolator

from liaisons import Signal
from liaisons.base.knots import knots, piecewise_polynomial
from liaisons.cosim.running.breaks import Deviations
from liaisons.cosim.structure.sources import Drive
from liaisons.errors import SimulationError


@pytest.mark.parametrize("instant", [0.505, 1 / 3, 0.3, 1e-6, 1e3, 0.0, -0.7])
def test_a_drive_has_its_limits_from_the_right(instant: float) -> None:
    for compared in (lambda t: t - instant, lambda t: 3 * t - 3 * instant, lambda t: t * math.pi - instant * math.pi):
        drive = Drive(
            lambda t, side=compared: (abs(t - instant), float(np.sign(side(t))), 0.0),
            tuple(("part", name) for name in ("s", "s_dot", "s_ddot")),
            breaks=np.array([instant, 0.9]),
        )
        # 8 units in the last place of the time, at a rate of 1, and a rounding.
        roundings = 9 * np.spacing(max(abs(instant), 0.9))
        drive.begin_piece(instant)
        np.testing.assert_allclose(drive(instant), [0, 1, 0], rtol=0, atol=roundings)


@pytest.mark.parametrize("breaks", [[0.5], []])
def test_a_piece_begins_with_the_limit_from_the_right(breaks: list[float]) -> None:
    """Whatever the function returns at the break itself, which may have been found by bisection."""
    drive = Drive(lambda t: float(t > 0.5), (("part", "force"),), breaks=np.array(breaks))
    assert Drive(math.sin, (("part", "force"),)).breaks.size == 0
    assert drive(0.5) == 0
    drive.begin_piece(0.5)
    assert drive(0.5) == 1
    drive.begin_piece(0.7)
    assert drive(0.5) == 0


def test_several_values_at_once_are_those_one_by_one() -> None:
    ports = tuple(("part", name) for name in ("s", "s_dot", "s_ddot"))
    drive, times = Drive(lambda t: (t**2, 2 * t, 2.0), ports), np.linspace(0, 1, 6).reshape(2, 3)
    assert np.array_equal(drive.sample(times), [[drive(t) for t in row] for row in times.tolist()])
    failing = Drive(lambda t: 1 / (t - 0.4) if t != 0.4 else math.nan, (("part", "force"),))
    with pytest.raises(SimulationError, match=r"input 'force': its function returns nan at t = 0\.4 s"):
        failing.sample(np.array([0.2, 0.4]))


@pytest.mark.parametrize("breaks", [[math.nan], [math.inf], ["soon"], "0.5", 0.5, None, [[0.5]], {0.5}, [1j]])
def test_breaks_that_are_no_instants_are_refused_in_one_line(breaks) -> None:
    with pytest.raises(SimulationError, match=r"^Signal: breaks = .*: give a list of finite numbers") as refusal:
        Signal(math.sin, breaks=breaks)
    assert "\n" not in str(refusal.value)


def test_breaks_ascend() -> None:
    assert Signal(math.sin, breaks=np.array([0.5, 0.1, 0.5])).breaks == (0.1, 0.5)
    with pytest.raises(SimulationError, match=r"Signal: 1\.0 is not a function of time"):
        Signal(1.0)  # pyright: ignore[reportArgumentType]


def test_knots_that_agree_to_rounding_are_one() -> None:
    """A number that is written with 13 digits and read again is off by up to 5e-14 of itself."""
    times, values = [0, 1, 2, 2, 3], [1.0, 1.3, 1.7, 1.7 * (1 + 5e-14), 1.9]
    rates, accelerations = [0.1, 0.3, 0.2, 0.2, 0.2], [0.0, 0.0, 1e-17, -1e-17, 0.0]
    assert knots(times, values, rates, accelerations).shape == (4, 4)
    jump = knots(times, values, [0.1, 0.3, 0.2, 0.5, 0.2], accelerations)
    assert jump.shape == (4, 5)
    assert jump[1, 2] == jump[1, 3]  # the rate jumps, the value does not
    for column, number in ((values, 1e-12), (rates, 1e-12), (accelerations, 1e-11)):
        column[3] += number
        assert knots(times, values, rates, accelerations).shape == (4, 5)
        column[3] -= number


STEP = [0.0, 1.0, 2.0, 3.0, 4.5, 5.0], [3.0, 3.0, 3.0, 2.0, 2.0, 2.5]


def test_a_table_is_joined_as_it_says() -> None:
    t = np.linspace(0, 5, 997)
    quintic, pchip, linear = (piecewise_polynomial(knots(*STEP, join=join)) for join in ("quintic", "pchip", "linear"))
    np.testing.assert_allclose(
        pchip(t), PchipInterpolator(*STEP)(t), rtol=0, atol=1e-14
    )  # rounding of numbers of size 3
    np.testing.assert_allclose(pchip(t, 1), PchipInterpolator(*STEP)(t, 1), rtol=0, atol=1e-13)
    np.testing.assert_allclose(linear(t), np.interp(t, *STEP), rtol=0, atol=1e-14)
    assert quintic(t).max() > 3.02
    assert pchip(t).max() <= 3 + 1e-14
    np.testing.assert_allclose(pchip(np.linspace(0, 1, 50)), 3.0, rtol=0, atol=1e-14)  # it rests
    straight = knots([0, 1, 2], [0.0, 1.0, 2.0], join="linear")
    assert straight.shape == (4, 3)  # no kink, no communication point
    assert knots([0, 1, 1, 2], [0.0, 1.0, 5.0, 5.0], join="pchip").shape == (4, 4)  # a jump is one
    with pytest.raises(SimulationError, match="a jump at 1 s, after which nothing follows"):
        knots([0, 1, 1], [0.0, 1.0, 5.0], join="linear")


def test_what_cannot_be_joined_is_refused() -> None:
    with pytest.raises(SimulationError, match=r"join = 'pchp'; did you mean 'pchip'\?"):
        knots(*STEP, join="pchp")  # pyright: ignore[reportArgumentType]
    with pytest.raises(SimulationError, match="join = 'linear' is for a table without rates"):
        knots(*STEP, rates=[0.0] * 6, join="linear")


def _integrals(function: Callable[[float], Sequence[float]], count: int) -> NDArray[np.float64]:
    """∫ |e| and ∫ (1 - t) |e| over a step from 0 to 1 s, of what a function leaves of its polynomial."""
    drive = Drive(function, tuple(("part", name) for name in ("s", "s_dot", "s_ddot")[:count]))
    bus = cast(Any, SimpleNamespace(add_columns=lambda _: (0, np.zeros(2))))
    return abs(Deviations([drive], bus, 1e-8).integrals(np.array([0.0, 1.0]))[0])


def test_a_deviation_late_in_a_step_moves_less() -> None:
    """That of t¹² from the quintic through its ends."""
    power = np.polynomial.Polynomial([0.0] * 12 + [1.0])
    orders = [power.deriv(k) for k in range(3)]
    quintic = BPoly.from_derivatives([0, 1], [[order(t) for order in orders] for t in (0.0, 1.0)])
    once = quad(lambda t: abs(power(t) - quintic(t)), 0, 1)[0]
    twice = quad(lambda t: (1 - t) * abs(power(t) - quintic(t)), 0, 1)[0]
    # Four nodes are wrong by 0.003; ∫ t |e| is 0.14 larger.
    np.testing.assert_allclose(_integrals(lambda t: [float(order(t)) for order in orders], 3), [once, twice], rtol=0.02)


def test_deviations_to_both_sides_do_not_cancel() -> None:
    """(t - 1/2)⁵, odd as the cubic through its thirds is, a (t - 1/2)³ + b (t - 1/2)."""
    at = np.array([1 / 6, 1 / 2])
    b, a = np.linalg.solve(np.column_stack([at, at**3]), at**5)
    exact = quad(lambda t: abs((t - 0.5) ** 5 - a * (t - 0.5) ** 3 - b * (t - 0.5)), 0, 1, points=[1 / 3, 0.5, 2 / 3])[
        0
    ]
    assert _integrals(lambda t: [(t - 0.5) ** 5], 1)[0] == pytest.approx(exact, rel=0.5)  # four nodes for six arcs


@pytest.mark.parametrize(("times", "values"), [(None, [1.0, 2.0]), ([0.0, 1.0], None)])
def test_a_table_without_times_or_values_is_refused(times: Any, values: Any) -> None:
    with pytest.raises(SimulationError, match=r"^(times|values)"):
        knots(times, values)


@pytest.mark.parametrize(
    ("span", "change", "count"), [(1e-6, 1e-4, 3), (1e6, 1e-20, 4), (1.0, 1e-14, 3), (1.0, 1e-12, 4)]
)
def test_knots_agree_by_what_their_difference_moves_in_the_span(span: float, change: float, count: int) -> None:
    """A jump of the acceleration by Δ is rounding if Δ T², beside the values, is below 1e-13."""
    times, beside = np.array([0.0, 0.5, 0.5, 1.0]) * span, np.zeros(4)
    table = knots(times, np.full(4, 1.0), beside, np.array([0.0, 0.0, change, 0.0]))
    assert table.shape == (4, count)
    assert table[3].max() == (change if count == 4 else 0.0)
