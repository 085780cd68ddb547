"""Comparison of two results, signal by signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arguments import shown
from liaisons.base.arrays import Floats
from liaisons.base.port_names import port_names
from liaisons.base.units import size_in_si
from liaisons.check.verdicts import table
from liaisons.errors import ValidityError
from liaisons.results import Result

Method = Literal["same points", "Hermite", "linear"]


@final
@dataclass(frozen=True, slots=True)
class Difference:
    """Difference of one signal, or one array of signals.

    :param maximum: largest absolute difference, of all elements.
    :param at: when that is [s].
    :param rms: root of the mean square of the difference, over points and elements.
    :param scale: largest absolute value of the first result.
    :param method: interpolation of the values at common times.
    """

    name: str
    unit: str
    maximum: float
    at: float
    rms: float
    scale: float
    method: Method

    @property
    def relative(self) -> float:
        """Largest difference relative to the largest value; infinite where only that is 0."""
        if self.scale > 0:
            return self.maximum / self.scale
        return 0.0 if self.maximum == 0 else float("inf")

    def row(self) -> dict[str, str]:
        """Cells of the difference by column of :func:`liaisons.check.table`."""
        return {
            "signal": self.name,
            "unit": self.unit or "-",
            "largest difference": f"{self.maximum:.3g}",
            "at t [s]": f"{self.at:.6g}",
            "rms": f"{self.rms:.3g}",
            "beside the largest value": f"{self.relative:.2g}",
            "values": self.method,
        }


@final
@dataclass(frozen=True, slots=True)
class Comparison:
    """All differences of two results; prints as a table.

    :param titles: of both results.
    :param times: where they were compared [s], shape (m,).
    :param differences: one for each signal that both have, in the order of the first.
    :param only_first: signals that only the first has.
    :param only_second: signals that only the second has.
    """

    titles: tuple[str, str]
    times: Floats
    differences: tuple[Difference, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]

    def __getitem__(self, name: str) -> Difference:
        """The difference of one signal.

        :raises ValidityError: if there is none of this name.
        """
        differences = {difference.name: difference for difference in self.differences}
        if name not in differences:
            raise ValidityError(f"{name!r} was not compared; compared: {', '.join(differences)}")
        return differences[name]

    @property
    def relative(self) -> float:
        """Largest relative difference of all signals; NaN if that of one signal is NaN."""
        return float(np.max([difference.relative for difference in self.differences]))

    def __str__(self) -> str:
        first, last = self.times[0], self.times[-1]
        lines = [
            f"{self.titles[0]} and {self.titles[1]} at {len(self.times)} points, t = {first:g} to {last:g} s",
            table(difference.row() for difference in self.differences),
        ]
        if any(difference.method == "linear" for difference in self.differences):
            lines.append("linear: interpolated by straight lines, since its rate was not recorded with it")
        for title, names in zip(self.titles, (self.only_first, self.only_second), strict=True):
            if names:
                lines.append(f"only in {title}: {', '.join(names)}")
        return "\n".join(lines)


def compare(first: Result, second: Result) -> Comparison:
    """Compare the signals that two results have in common, over the time that both cover.

    If all points of one result within that time are points of the other, the values at these points are compared.
    Otherwise each result is interpolated at the points of the other: by cubic Hermite polynomials (error of fourth
    order in the step) where the rate ``x_dot`` of a signal ``x`` was recorded with it, otherwise by straight lines
    (second order), since a signal may jump.  The difference of strings is 0 or 1.  The second result is converted to
    the units of the first.

    :raises ValidityError: if they have no signal or no time span in common, or a signal has different units or sizes.
    """
    for result in (first, second):
        if not isinstance(result, Result):
            raise ValidityError(f"compare: {shown(result)} is no Result; read a file with Result.from_csv")
        if result.kind == "sweep":
            raise ValidityError(f"compare: the result of {result.title} has cases and no time; compare its signals")
    names = [name for name in first.entries if name in second.entries]
    if not names:
        raise ValidityError(f"{first.title} and {second.title} have no signal in common")
    sizes = {name: _size_of_second(first, second, name) for name in names}
    times = _comparison_times(first, second)
    differences = []
    for name in names:
        (one, one_by), (other, other_by) = (_interpolated_values(result, name, times) for result in (first, second))
        if np.dtype(object) in {one.dtype, other.dtype}:  # strings: the same or not
            one, other = np.ones(one.shape), (one == other).astype(float)
        else:
            other = other * sizes[name]
        error = np.abs(one - other).reshape(len(times), -1)
        worst = np.max(error, axis=1)
        point = int(np.argmax(np.where(np.isnan(worst), np.inf, worst)))
        differences.append(
            Difference(
                name,
                first.units[name] or second.units[name],
                maximum=float(worst[point]),
                at=float(times[point]),
                rms=float(np.sqrt(np.mean(error**2))),
                scale=float(np.max(np.abs(one))),
                method="linear" if "linear" in {one_by, other_by} else one_by,
            )
        )
    return Comparison(
        (first.title, second.title),
        times,
        tuple(differences),
        tuple(name for name in first.entries if name not in names),
        tuple(name for name in second.entries if name not in names),
    )


def _size_of_second(first: Result, second: Result, name: str) -> float:
    """Factor from the unit of a signal in the second result to that in the first.

    :raises ValidityError: unless both have the same quantity and shape.
    """
    units = first.units[name], second.units[name]
    try:
        size = size_in_si(units[1], units[0]) if all(units) else 1.0
    except ValueError:
        words = f"{name} is in {units[0]} in {first.title}, in {units[1]} in {second.title}; convert one"
        raise ValidityError(words) from None
    shapes = first[name].shape[1:], second[name].shape[1:]
    if shapes[0] != shapes[1]:
        raise ValidityError(f"{name} has shape {shapes[0]} in {first.title}, {shapes[1]} in {second.title}")
    return size


def _comparison_times(first: Result, second: Result) -> Floats:
    """Times [s] at which to compare two results: all points of one if the other has them, else the points of both."""
    begin, end = max(first.time[0], second.time[0]), min(first.time[-1], second.time[-1])
    if begin > end:
        raise ValidityError(
            f"{first.title} (t = {first.time[0]:g} to {first.time[-1]:g} s) and {second.title} "
            f"({second.time[0]:g} to {second.time[-1]:g} s) have no time in common"
        )
    one, other = (r.time[(r.time >= begin) & (r.time <= end)] for r in (first, second))
    few, many = sorted((one, other), key=len)
    return few if _contains_points(many, few) else np.union1d(one, other)


def _contains_points(points: Floats, times: Floats) -> bool:
    """Whether all times are among the points, but for rounding: each step of a sum of steps rounds."""
    return bool(np.all(np.abs(points[_nearest_indices(points, times)] - times) <= 1e-9 * max(1.0, abs(times[-1]))))


def _nearest_indices(points: Floats, times: Floats) -> NDArray[np.intp]:
    """Indices of the sorted points nearest to the times."""
    return np.searchsorted((points[1:] + points[:-1]) / 2, times)


def _interpolated_values(result: Result, name: str, times: Floats) -> tuple[Floats, Method]:
    """Values of a signal at times, and the method of their interpolation."""
    values = result[name]
    if values.ndim == 1 or values.shape[0] != len(result.time):
        values = values.reshape(len(result.time), -1)
    if _contains_points(result.time, times):
        return values[_nearest_indices(result.time, times)], "same points"
    if values.dtype == object:
        return values[np.searchsorted(result.time, times, side="right") - 1], "same points"
    from scipy.interpolate import CubicHermiteSpline, interp1d  # takes half a second

    rate = result.ports.get(name, port_names(name)).rate
    if rate in result.entries and result[rate].shape == result[name].shape:
        rates = result[rate].reshape(values.shape)
        return CubicHermiteSpline(result.time, values, rates)(times), "Hermite"
    return interp1d(result.time, values, axis=0)(times), "linear"
