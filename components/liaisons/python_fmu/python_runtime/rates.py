"""Rates of prescribed coordinates that nobody gives, by the rules of ``missing.c``.

Of each coordinate a state has a row of numbers: two counts of steps, the last rate and acceleration that were given,
how many points are kept; then times, values and rates of these, newest first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Row: TypeAlias = "memoryview[float]"  # numbers of a coordinate

GIVEN = 2  # and the next one
_STILL, _TURNS, _POINTS, _SERIES = 0, 1, 4, 5
_EARLIER, _LATER = slice(_SERIES, -1), slice(_SERIES + 1, None)
_SEVERAL, _STRAIGHT, _FAR, _NEAR = 3, 0.1, 5.0, 0.05


def derived_numbers(
    row: Row, level: float, t: float, numbers: Sequence[float] | NDArray
) -> tuple[Sequence[float] | NDArray, bool]:
    """Value, rate and acceleration at t, with what is missing; whether the value, or the rate, has jumped.

    :param level: 0 nothing, 1 acceleration, 2 rate and acceleration.
    """
    if not level:
        return numbers, False
    times, *series = np.asarray(row)[_SERIES:].reshape(3, -1)[:, : int(row[_POINTS])]
    if not times.size:
        return np.array([*numbers[: 3 - int(level)], *[0.0] * int(level)]), False
    x, y, near = [0.0], [numbers[int(level == 1)]], _NEAR * (t - times[-1]) / times.size
    for place, value in zip(times - t, series[int(level == 1)], strict=True):
        if x[-1] - place > near:
            x, y = [*x, place], [*y, value]
    scale = x[-1] or 1.0
    powers = np.vander(np.array(x) / scale, increasing=True)
    if len(x) > 2:
        led = np.linalg.solve(powers[1:, :-1], y[1:])[0]
        if abs(y[0] - led) > _FAR * np.ptp([*y[1:], led]):
            return np.array([*numbers[: 3 - int(level)], *[0.0] * int(level)]), True
    _, slope, curvature, *_ = *np.linalg.solve(powers, y), 0.0, 0.0
    rates = [slope / scale, 2 * curvature / scale**2]
    return np.array([*numbers[: 3 - int(level)], *rates[: int(level)]]), False


def remember(row: Row, level: float, t: float, numbers: Sequence[float] | NDArray) -> None:
    """Remember a point, as the last one before the next."""
    if level and derived_numbers(row, level, t, numbers)[1]:
        row[_POINTS] = 0
    most, kept = (len(row) - _SERIES) // 3, row[_POINTS]
    row[_LATER] = row[_EARLIER]  # what leaves a series is overwritten in the next one
    row[_SERIES], row[_SERIES + most], row[_SERIES + 2 * most] = t, numbers[0], numbers[1]
    if kept < most:
        row[_POINTS] = kept + 1


def missing_level(row: Row, level: float, H: float, value: float, end: Sequence[float]) -> float:
    """What is missing after a step of size H from a value to numbers: 0 nothing, 1 acceleration, 2 rate, too."""
    rate, acceleration, still = row[GIVEN], row[GIVEN + 1], row[_STILL]
    if rate == acceleration == end[1] == end[2] == 0:
        row[_TURNS] = 0
        row[_STILL] = still = still + 1 if end[0] != value else still * (level > 1)
        return 2.0 if still >= _SEVERAL else level * (level == 1)
    change = end[1] - rate
    straight = change != 0 and abs(end[0] - value - H * (rate + end[1]) / 2) <= _STRAIGHT * abs(H * change)
    row[_STILL], row[_TURNS] = 0, (row[_TURNS] + 1) * straight
    return float(acceleration == end[2] == 0 and (level == 1 or row[_TURNS] >= _SEVERAL))


def may_miss_rates(row: Row) -> bool:
    """Whether the value has changed without rates in the last step, and they are not yet known to be missing."""
    return bool(row and row[_STILL])
