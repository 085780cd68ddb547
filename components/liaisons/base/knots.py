"""Motions as tables of knots (t, σ, σ̇, σ̈), with a quintic Hermite polynomial between two of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arguments import check_positive, float_array, shown
from liaisons.base.hermite import upper_coefficients
from liaisons.errors import SimulationError, suggestion

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

ROUNDING = 1e-13
"""Relative tolerance within which two knots at one instant are one; a number with 13 digits errs by as much."""
Join = Literal["quintic", "pchip", "linear"]
_COLUMNS = ("times", "values", "rates", "accelerations")


def knots(
    times: ArrayLike,
    values: ArrayLike,
    rates: ArrayLike | None = None,
    accelerations: ArrayLike | None = None,
    join: Join = "quintic",
    *,
    smoothing: float | None = None,
) -> NDArray[np.float64]:
    """Table of knots of a motion: rows t, σ, σ̇, σ̈, a column for each knot; shape (4, n).

    Rates and accelerations that are not given are those of a curve between jumps; see :func:`liaisons.tabulated`.

    :param times: [s], ascending, shape (n,), n >= 2; an instant that is there twice is a jump, unless both knots
        agree to :data:`ROUNDING`.
    :raises SimulationError: if these are not numbers, of unequal count, or not ascending, or too few to be smoothed.
    """
    columns = {
        name: _checked_column(name, column)
        for name, column in zip(_COLUMNS, (times, values, rates, accelerations), strict=True)
        if column is not None or name in _COLUMNS[:2]
    }
    t = columns["times"]
    for name, column in columns.items():
        if column.size != t.size or t.size < 2:
            raise SimulationError(f"{name}: {column.size} numbers for {t.size} times; give as many, two at least")
    steps = np.diff(t)
    wrong = np.flatnonzero((steps < 0) | (steps == 0) & (np.append(1.0, steps[:-1]) == 0))
    if wrong.size:
        later, before = t[wrong[0] + 1], t[wrong[0]]
        raise SimulationError(f"times: {later:g} after {before:g} s: they must ascend; twice the same is a jump")
    if steps[-1] == 0 and columns["values"][-1] != columns["values"][-2]:
        raise SimulationError(
            f"times: a jump at {t[-1]:g} s, after which nothing follows; leave it out, or add a later time"
        )
    _check_curve(join, smoothing, rates=len(columns) > 2)
    parts = []
    for part in np.split(np.arange(t.size), np.flatnonzero(steps == 0) + 1):
        beside = (columns[name][part] if name in columns else None for name in _COLUMNS[2:])
        smooth = join == "quintic" or part.size == 1
        own = t[part], columns["values"][part]
        if smoothing and part.size > 1:
            parts.append(_smoothed_knots(*own, smoothing))
        else:
            parts.append(_spline_knots(*own, *beside) if smooth else _piecewise_knots(*own, join))
    table = np.concatenate(parts, axis=1)
    jumps = np.flatnonzero(np.diff(table[0]) == 0) + 1
    agree = _agree_with_previous(table, jumps)
    table[1:, jumps] = np.where(agree, table[1:, jumps - 1], table[1:, jumps])
    return np.delete(table, jumps[agree.all(axis=0)], axis=1)


def complete_rows(*columns: NDArray[Any] | None) -> list[Any]:
    """Columns without the rows in which a value of one is missing; None for a column that is None."""
    complete = np.logical_and.reduce([np.isfinite(column) for column in columns if column is not None])
    return [column if column is None else column[complete] for column in columns]


def _check_curve(join: str, smoothing: float | None, *, rates: bool) -> None:
    """Raise a SimulationError for a curve that there is not, or that contradicts a table with rates."""
    if join not in get_args(Join):
        raise SimulationError(f"join = {join!r}{suggestion(join, get_args(Join))}")
    if smoothing is not None:
        check_positive("smoothing", smoothing, SimulationError)
        if join != "quintic":
            raise SimulationError(f"smoothing fits quintic splines; leave join = {join!r} out, or smoothing")
    if rates and (smoothing or join != "quintic"):
        setting = f"smoothing = {smoothing:g} s" if smoothing else f"join = {join!r}"
        raise SimulationError(f"{setting} is for a table without rates, which follow from it; leave them out")


def _agree_with_previous(table: NDArray[np.float64], later: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether σ, σ̇, σ̈ in the columns ``later`` agree with the columns before them to rounding; shape (3, n)."""
    span = table[0, -1] - table[0, 0]
    powers = span ** np.arange(3)[:, None] if span > 0 else np.ones((3, 1))  # so that all rows have the unit of a value
    rows = table[1:] * powers
    scale = np.max(np.abs(rows), axis=1, keepdims=True) + np.max(np.abs(rows[0]))
    return np.abs(rows[:, later] - rows[:, later - 1]) <= ROUNDING * scale


def _checked_column(name: str, column: ArrayLike | None) -> NDArray[np.float64]:
    """Column as an array of floats; raises a SimulationError unless they are finite, in one dimension."""
    numbers = float_array(name, column, SimulationError)
    if numbers.ndim != 1 or not np.isfinite(numbers).all():
        raise SimulationError(f"{name} = {shown(column)}: give finite numbers, one per time")
    return numbers


def _spline_knots(
    times: NDArray, values: NDArray, rates: NDArray | None, accelerations: NDArray | None
) -> NDArray[np.float64]:
    """Knots at these times, shape (4, times); a spline gives the rates and accelerations that are None."""
    from scipy.interpolate import make_interp_spline  # slow to load

    def derivative(column: NDArray, order: int) -> NDArray[np.float64]:
        degree = min(5, times.size - 1)
        return make_interp_spline(times, column, k=degree)(times, order) if order <= degree else 0 * times

    if accelerations is None:
        accelerations = derivative(values, 2) if rates is None else derivative(rates, 1)
    return np.array([times, values, derivative(values, 1) if rates is None else rates, accelerations])


def _smoothed_knots(times: NDArray, values: NDArray, distance: float) -> NDArray[np.float64]:
    """Knots of the quintic spline with equidistant knots that fits values best, shape (4, knots).

    :param distance: of two knots [s].
    :raises SimulationError: if a piece of the spline has too few values.
    """
    from scipy.interpolate import make_lsq_spline  # slow to load

    edges = np.linspace(times[0], times[-1], 1 + max(1, round((times[-1] - times[0]) / distance)))
    required = 6 if edges.size == 2 else 2  # a single quintic has six coefficients
    too_few = np.histogram(times, edges)[0] < required
    if too_few.any():
        begin = edges[too_few.argmax()]
        words = f"smoothing = {distance:g} s leaves less than {required} values after t = {begin:g} s; widen it"
        raise SimulationError(words)
    spline = make_lsq_spline(times, values, np.pad(edges, 5, mode="edge"), 5)
    return np.array([edges, *(spline(edges, order) for order in range(3))])


def _piecewise_knots(times: NDArray, values: NDArray, join: Join) -> NDArray[np.float64]:
    """Table of knots at both ends of each interval of lines or cubics (PCHIP), whose derivatives jump between them."""
    from scipy.interpolate import PchipInterpolator, PPoly  # slow to load

    steps = np.diff(times)
    lines = PPoly(np.array([np.diff(values) / steps, values[:-1]]), times)
    through = PchipInterpolator(times, values) if join == "pchip" else lines
    rows = [np.repeat(times, 2)[1:-1]]
    for order in range(3):
        c = through.derivative(order).c if order else through.c
        rows.append(np.ravel([c[-1], np.sum(c * steps ** np.arange(len(c))[::-1, None], axis=0)], order="F"))
    return np.array(rows)


def piecewise_polynomial(table: NDArray[np.float64]) -> PPoly:
    """The quintic piecewise polynomial through a table of knots; at a jump it has the limit from the right."""
    from scipy.interpolate import PPoly  # slow to load

    t, y, v, a = table
    lasting = np.diff(t) > 0
    h = np.diff(t)[lasting]
    begin, end = ([column[part][lasting] for column in (y, v, a)] for part in (slice(None, -1), slice(1, None)))
    upper = [c / h**power for power, c in enumerate(upper_coefficients(begin, end, h), 3)]
    return PPoly(np.array([*upper[::-1], begin[2] / 2, begin[1], begin[0]]), np.append(t[:-1][lasting], t[-1]))
