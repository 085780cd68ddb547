"""Estimates of coupling errors: the error that each step adds, from the recorded points.

Within a step an input follows a polynomial.  The next divided difference, which includes the point before the step,
estimates how far the source deviates from that polynomial: the remainder of Hermite interpolation (Hairer, Norsett,
Wanner, Solving ODEs I, II.6).  The effect of this deviation on the motion follows from ∂(acceleration)/∂(input), M eq.
50, by integrating over the step, once and twice.  Only these derivatives are needed; Newton's method has them anyway,
otherwise they are calculated once, at the start.  Without them, the relative error of an input is taken as the relative
error of all outputs of its FMU.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, count, pairwise, product, starmap
from math import gamma
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import Floats, as_indices
from liaisons.base.hermite import coefficient_matrix
from liaisons.base.logs import logger
from liaisons.cosim import Call, VariableReference
from liaisons.coupling_estimate.contacts import (
    ContactMechanism,
    UnresolvedContact,
    accumulated_errors,
    divisions_between,
    rounded_down,
)

Flags = NDArray[np.bool_]
Integrals = tuple[Floats, Floats]

ALLOWED = 1e-4
"""Error of a step, relative to the size of the signal, above which there is a warning."""
_NUMBERS = 60_000
"""Number of values in a block of steps that is evaluated at once."""
_POINTS_BEFORE = 4
"""Number of points before a step that its estimate uses."""
_LEAST_STEP_RATIO = 1 / 50
"""Smallest ratio of a step to its neighbour at which it serves the estimate; below, rounding prevails."""
_LEAST_NEIGHBOUR_RATIO = 1e-6
"""Ratio below which a neighbour tells nothing."""
_SAFETY = 0.8
"""Factor of a step size that would just do."""

Shape = Literal["hermite", "points", "quintic", "cubic", "taylor", "mean", "newest"]
"""Through data at both ends; a cubic through the end and points before; a polynomial of either degree, whose integrals
are the data; a Taylor polynomial from the start; the mean of both ends; the value at the end.
"""


@final
@dataclass(frozen=True)
class InputReconstruction:
    """The polynomial that an input follows over a step.

    :param name: of the connection.
    :param column: of the input.
    :param data: columns of value, first and second derivative, as far as used.
    :param order: which derivative of the data the input is.
    :param effects: column of ∂(acceleration)/∂(input), and those of the rate and the value of that acceleration.
    :param answers: columns of the outputs of its FMU, where there are no effects.
    """

    name: str
    column: int
    data: tuple[int, ...]
    order: int
    shape: Shape
    effects: tuple[tuple[int, int, int], ...]
    answers: tuple[int, ...]

    @property
    def step_size_power(self) -> int:
        """Power of H in the error of a step."""
        count = len(self.data)
        powers = {"hermite": 2 * count + 1, "points": 5, "quintic": 7, "cubic": 5, "taylor": count - self.order + 1}
        return {"mean": 3, "newest": 2, **powers}[self.shape]


@final
@dataclass(frozen=True)
class Worst:
    """The largest error of a step: its time [s], signal, connection, step size [s], and the power of that size."""

    error: float
    time: float
    signal: str
    connection: str
    size: float
    power: int

    def warn(self, total: float) -> None:
        """Warn if this error exceeds :data:`ALLOWED`, or the total of all steps does."""
        if not max(self.error, total) > ALLOWED:
            return
        one = f"coupling error {self.error:.2g} of {self.signal} at t = {self.time:.6g} s"
        words = one if self.error > ALLOWED else f"coupling errors add up to {total:.2g}, the largest is: {one}"
        logger.warning(
            "%s: %s is handed over too rarely, in steps of %.3g s; a step_size of %.1g s would do",
            words,
            self.connection,
            self.size,
            self._sufficient_step_size(total),
        )

    def _sufficient_step_size(self, total: float) -> float:
        """Step size [s] that keeps the total below :data:`ALLOWED`, rounded down to one digit."""
        size = _SAFETY * self.size * (ALLOWED / max(self.error, total)) ** (1 / (self.power - 1))
        return rounded_down(size)


@final
@dataclass(frozen=True)
class _Watched:
    """A mechanism with contacts; numbers of its input reconstructions, and of the signals that their errors reach."""

    mechanism: ContactMechanism
    items: list[int]
    targets: list[int]


@final
class Estimate:
    """Errors of communication steps, by the values of the bus at their ends.

    :param followed: polynomials of inputs.
    :param columns: variable -> its column on the bus.
    :param units: unit of each column.
    :param mechanisms: those with contacts.
    :param initial_calls: those that calculate derivatives at the start.
    :ivar can_estimate: whether any error can be estimated; if none can, it must not be asked for any.
    :ivar worst: the largest error of a step; None if all are 0.  Angles are relative to 1 rad at least, as what they
        move is off by that part of its distance.
    """

    def __init__(
        self,
        followed: Iterable[InputReconstruction],
        columns: Mapping[VariableReference, int],
        units: Sequence[str],
        mechanisms: Sequence[ContactMechanism],
        initial_calls: Sequence[Call],
    ) -> None:
        self.initial_calls = initial_calls
        alike: dict[tuple[Shape, int, int], list[InputReconstruction]] = {}
        data: dict[tuple[Shape, int, int], list[tuple[int, ...]]] = {}
        for item in followed:
            key = item.shape, len(item.data), item.order
            alike.setdefault(key, []).append(item)
            data.setdefault(key, []).append((item.column, *item.data))
        self._alike = [*zip(data, map(np.array, data.values()), strict=True)]
        self._followed = [*chain.from_iterable(alike.values())]
        self._names = dict(zip(columns.values(), map(".".join, columns), strict=True))
        effects = sorted(chain.from_iterable(map(_error_targets, count(), self._followed)))
        targets, self._of, gains, once = as_indices(effects).reshape(-1, 4).T
        self._once, self._blind, self._gains = once == 1, np.flatnonzero(gains < 0), gains
        self._targets, self._starts = np.unique(targets, return_index=True)
        self.can_estimate = len(self._targets) > 0
        kinds = np.unique(units, return_inverse=True)[1]
        own = kinds[self._targets]
        self._of_kind = [*map(np.flatnonzero, own == np.unique(own)[:, None])]
        self._are_angles = np.array(units)[self._targets] == "rad"
        self._answers: list[NDArray[np.intp]] = []
        for j in self._blind:
            self._answers.append(as_indices(self._followed[self._of[j]].answers))
        self._kinds, self._units = kinds, units
        self._mechanisms: list[_Watched] = []
        for mechanism in mechanisms:
            own = {column for (owner, _), column in columns.items() if owner == mechanism.name}
            items = [k for k, item in enumerate(self._followed) if item.column in mechanism.inputs]
            reached = [k for k, column in enumerate(self._targets.tolist()) if column in own]
            self._mechanisms.append(_Watched(mechanism, items, reached))
        self.reset()

    def reset(self) -> None:
        """Forget all steps."""
        self._sizes = np.zeros(len(self._of_kind))
        self.worst: Worst | None = None
        self._total = 0.0  # error of all steps, relative to sizes as the worst
        # steps in which contacts are least sure to be seen, with what their warnings name
        self._doubtful: list[tuple[UnresolvedContact, tuple[str, str, str, int]]] = []
        self._divisions: list[Floats] = []  # instants [s] that divide all steps in which one may not be seen

    def estimate(self, rows: Floats, times: Floats, crossing: Flags) -> Floats:
        """The error that each step adds, relative to the largest value of the signal's unit in the run.

        :param rows: values of the bus, shape (points, width).
        :param crossing: which points are ends of tiny steps to breaks.
        :returns: shape (points,); 0 for the first of each piece, not a number for one whose only step has no neighbour.
        """
        errors = np.zeros(len(times))
        peaks = np.abs(rows).max(axis=0, initial=0.0, where=np.isfinite(rows))[: len(self._kinds)]
        kinds = self._kinds[self._targets]
        for k, targets in enumerate(self._of_kind):
            self._sizes[k] = peaks[self._kinds == kinds[targets[0]]].max()
        serious, contacts = np.zeros(len(times)), np.zeros((2, len(self._mechanisms), len(times)))
        block = max(_POINTS_BEFORE, _NUMBERS // rows.shape[1])
        for first in range(1, len(times), block):
            begin, end = max(first - _POINTS_BEFORE, 0), min(first + block, len(times))
            signals = np.ascontiguousarray(rows[begin:end].T)
            ends = crossing[begin + 1 : end]
            errors[first:end] = self._estimate_block(signals, times[begin:end], first - begin, ends)
            serious[first:end] = self._serious[first - begin - 1 :]
            contacts[:, :, first:end] = self._contacts[:, :, first - begin - 1 :]
        for watched, *both in zip(self._mechanisms, *contacts, strict=True):
            if np.any(both):
                increase = self._magnify_by_impacts(watched, rows, times, *both, crossing=crossing)
                errors, serious = np.fmax(errors, increase), np.fmax(serious, increase)
        self._total = float(np.nansum(serious))
        return errors

    def _magnify_by_impacts(
        self, watched: _Watched, rows: Floats, times: Floats, off: Floats, added: Floats, *, crossing: Flags
    ) -> Floats:
        """Errors that each step adds to a mechanism with contacts, magnified by its impacts; updates the worst."""
        steps = np.append(1.0, np.diff(times))
        shorter = np.fmin(1.0, steps[1:] / steps[:-1]), np.fmin(1.0, steps[:-1] / steps[1:])
        # One alone may be 0 by chance.
        off = np.fmax(np.fmax(off, np.append(off[1:] * shorter[1], 0.0)), np.append(0.0, off[:-1] * shorter[0]))
        off[crossing] = 0.0  # an impact there is solved by itself
        sums, doubtful = accumulated_errors(watched.mechanism, rows, times, off, added, crossing=crossing)
        increase = np.diff(sums, prepend=0.0)
        latest = int(np.argmax(increase))
        if watched.items:
            item = max((self._followed[k] for k in watched.items), key=lambda one: np.ptp(rows[:, one.column]))
            distance, size = watched.mechanism.contacts[0, 0], steps[latest]
            self._update_worst(increase[latest], times[latest], distance, item, size)
            power = item.step_size_power - 1
            for contact in doubtful[:1]:
                column = int(watched.mechanism.contacts[contact.contact, 0])
                self._doubtful.append((contact, (self._names[column], self._units[column], item.name, power)))
            self._divisions += [contact.divisions(power) for contact in doubtful]
        return increase

    def estimate_last(self, rows: Floats, times: Floats, count: int) -> Floats:
        """Errors that the last steps add, before the steps after them are made.

        :param count: number of these steps.
        """
        signals = np.ascontiguousarray(rows.T)
        errors = self._estimate_block(signals, times, len(times) - count, np.zeros(len(times) - 1, bool), ahead=True)
        for watched, off in zip(self._mechanisms, self._contacts[0], strict=True):
            sizes = np.abs(signals[sorted(watched.mechanism.inputs)]).max(initial=0.0)
            errors = np.fmax(errors, off[-count:] / (sizes or 1.0))
        return errors

    def divisions_between(self, times: Sequence[float]) -> Floats:
        """Instants between communication points [s] that divide steps in which a contact may not be seen, sorted."""
        return divisions_between(self._divisions, np.array(times)) if self._divisions else np.empty(0)

    def warn(self, known: Sequence[float], *, is_complete: bool) -> None:
        """Warn of large errors, and of contacts that may have been missed.

        :param known: errors between communication points, if steps were chosen by them.
        :param is_complete: whether there are no other errors, which nothing estimates.
        """
        if self.worst is not None and is_complete:
            self.worst.warn(float(np.nansum(known)) if known else self._total)
        for contact, about in self._doubtful:
            contact.warn(*about)

    def save(self) -> tuple[Floats, Worst | None]:
        """The state for :meth:`restore`."""
        return self._sizes.copy(), self.worst

    def restore(self, snapshot: tuple[Floats, Worst | None]) -> None:
        """Restore a saved state; signals that were 0 until then keep their sizes."""
        sizes, self.worst = snapshot
        np.copyto(self._sizes, sizes, where=sizes > 0)

    def _estimate_block(
        self, signals: Floats, times: Floats, first: int, crossing: Flags, *, ahead: bool = False
    ) -> Floats:
        """Errors of steps from the one that ends at the point ``first`` on; updates sizes of signals and the worst.

        :param signals: shape (width, points).
        :param crossing: which of the steps are the tiny ones to a break.
        :param ahead: outputs of an FMU without derivatives may follow later, by as much as its input changes.
        """
        steps = np.diff(times)
        scales = np.abs(signals[self._targets])
        for k, targets in enumerate(self._of_kind):
            largest = np.maximum(np.maximum.accumulate(scales[targets].max(axis=0)), self._sizes[k])
            self._sizes[k] = largest[-1]
            scales[targets] = np.where(largest > 0, largest, 1.0)
        integrate = partial(_error_integrals, signals=signals, steps=steps, crossing=crossing)
        once, twice = map(np.concatenate, zip(*starmap(integrate, self._alike), strict=True))
        added = np.where(self._once[:, None], once[self._of], twice[self._of])
        has_gain = self._gains >= 0
        added[has_gain] *= signals[self._gains[has_gain], 1:]
        for j, outputs in zip(self._blind, self._answers, strict=True):
            answers = np.append(outputs, self._followed[self._of[j]].column) if ahead else outputs
            largest = np.abs(signals[answers]).max(axis=1, keepdims=True)
            changes = np.abs(np.diff(signals[answers], axis=1)) / np.where(largest > 0, largest, 1.0)
            changes[:, :1] = changes[:, 1:2] if len(steps) > 1 else changes  # it may begin with mere start values
            added[j] *= changes.max(axis=0, initial=0.0) / steps
        totals = np.abs(np.add.reduceat(added, self._starts, axis=0)) / scales[:, 1:]
        totals[:, crossing] = 0.0
        errors = totals.max(axis=0)
        means = np.abs(once / steps)
        means[:, crossing] = 0.0
        self._contacts = np.zeros((2, len(self._mechanisms), len(steps)))
        for k, watched in enumerate(self._mechanisms):
            self._contacts[0, k] = sum(
                means[item] * self._distance_per_input(watched, item, signals) for item in watched.items
            )
            self._contacts[1, k] = totals[watched.targets].max(axis=0, initial=0.0)
        totals[self._are_angles] *= np.fmin(scales[self._are_angles, 1:], 1.0)
        self._serious = serious = totals.max(axis=0)
        latest = first - 1 + int(np.argmax(np.nan_to_num(serious[first - 1 :])))
        target = int(np.argmax(totals[:, latest]))
        start, end = (*self._starts, len(added))[target : target + 2]
        item = self._followed[self._of[start + int(np.argmax(np.abs(added[start:end, latest])))]]
        self._update_worst(serious[latest], times[latest + 1], self._targets[target], item, steps[latest])
        return errors[first - 1 :]

    def _distance_per_input(self, watched: _Watched, k: int, signals: Floats) -> float:
        """Change of a contact's distance by that of an input: 1; between different units, the ratio of their sizes."""
        pair = [self._followed[k].column, int(watched.mechanism.contacts[0, 0])]
        if self._kinds[pair[0]] == self._kinds[pair[1]]:
            return 1.0
        sizes = np.abs(signals[pair]).max(axis=1)
        return float(sizes[1] / sizes[0]) if sizes[0] > 0 else 0.0

    def _update_worst(self, error: float, time: float, column: int, item: InputReconstruction, size: float) -> None:
        """Replace the worst error by a larger one, of the signal in a column of the bus."""
        if error > (self.worst.error if self.worst else 0.0):
            signal = self._names[int(column)]
            self.worst = Worst(float(error), float(time), signal, item.name, float(size), item.step_size_power)


def _error_targets(k: int, item: InputReconstruction) -> Iterator[tuple[int, int, int, int]]:
    """Yield of each signal that an input's error reaches the column, the input, the derivative's column, and ``once``.

    The column of the derivative is -1 if it is unknown; ``once`` says whether the error is integrated once, else twice.
    """
    if not item.effects:
        yield item.column, k, -1, 1
    smooth = item.shape in {"hermite", "quintic"}
    for gain, rate, value in item.effects:
        if rate >= 0 and (item.order == 0 or (item.order == 1 and not smooth)):
            yield rate, k, gain, 1
        if value >= 0 and (item.order < 2 or not smooth):
            yield value, k, gain, 0


def _error_integrals(
    key: tuple[Shape, int, int], columns: NDArray[np.intp], signals: Floats, steps: Floats, crossing: Flags
) -> Integrals:
    """∫ e and ∫ (t + H - τ) e over each step of the errors e of inputs, shape (inputs, steps) each."""
    shape, count, order = key
    data = signals[columns[:, 1:].T]  # (count, inputs, points)
    change = np.diff(data[0])
    if shape in {"hermite", "quintic", "cubic"}:
        once, twice = _hermite_integrals(data, steps, crossing) if shape == "hermite" else data[:2, :, 1:]
        return (once, twice) if order == 0 else (once, once)
    if shape == "points":
        once = _cubic_integrals(data[0], steps, crossing)
        return once, once * steps / 2
    if shape == "taylor":
        power = count - order
        parabola = sum(data[order + j, :, :-1] * (steps**j / gamma(j + 1)) for j in range(power))
        late, off = data[order, :, :-1] - signals[columns[:, 0], :-1], data[order, :, 1:] - parabola
        return steps * (late + off / (power + 1)), steps**2 * (late / 2 + off / ((power + 1) * (power + 2)))
    if shape == "mean":
        once, _ = _hermite_integrals(data, steps, crossing)
        return once, once * steps / 2 - steps**2 * change / 12
    return -steps * change / 2, -(steps**2) * change / 3


def _hermite_integrals(data: Floats, steps: Floats, crossing: Flags) -> Integrals:
    """∫ e and ∫ (t + H - τ) e for Hermite polynomials, by the remainder at a point before or after the step."""
    m, many = len(data), len(steps)
    sizes = np.concatenate([[0.0], np.where(crossing, 0.0, steps), [0.0]])  # 0: on the other side of a break
    before, after = sizes[:-2] / steps, sizes[2:] / steps
    earlier = (before >= _LEAST_STEP_RATIO) | (before >= after)
    unknown = (before < _LEAST_NEIGHBOUR_RATIO) & (after < _LEAST_NEIGHBOUR_RATIO)
    point = np.where(unknown, np.arange(many), np.arange(many) + np.where(earlier, -1, 2))
    x = np.where(unknown, -1.0, np.where(earlier, -before, 1 + after))  # its time, in steps from the start
    scales = steps ** np.arange(m)[:, None]
    powers = x ** np.arange(2 * m)[:, None]
    slopes = np.arange(1, 2 * m)[:, None] * powers[:-1]
    weights, weight = coefficient_matrix(m), (x * (x - 1)) ** m
    value = slope = np.zeros(1)
    for row, (end, k) in zip(weights.T, product((0, 1), range(m)), strict=True):
        values = data[k, :, end : end + many] * scales[k]
        value, slope = value + values * (row @ powers), slope + values * (row[1:] @ slopes)
    first = (data[0, :, point].T - value) / weight
    second = np.zeros_like(first)
    if m > 1:
        tilt = m * (x * (x - 1)) ** (m - 1) * (2 * x - 1)
        second = (data[1, :, point].T * scales[1] - slope - tilt * first) / weight
    bulge = (-1) ** m * gamma(m + 1) ** 2 / gamma(2 * m + 2)
    once = steps * bulge * (first + second * (1 / 2 - x))
    twice = steps**2 * bulge * ((first - second * x) / 2 + second * (m + 1) / (4 * m + 6))
    once[:, unknown] = twice[:, unknown] = np.nan
    return once, twice


def _cubic_integrals(values: Floats, steps: Floats, crossing: Flags) -> Floats:
    """∫ e for cubics through points, which cross no break."""
    once = np.zeros((len(values), len(steps)))
    for first, end in pairwise((-1, *np.flatnonzero(crossing), len(steps))):
        if end > first + 1:
            once[:, first + 1 : end] = _cubic_integrals_of_piece(values[:, first + 1 : end + 1], steps[first + 1 : end])
    return once


def _cubic_integrals_of_piece(values: Floats, steps: Floats) -> Floats:
    """∫ e for cubics through points of a smooth piece, by the remainder at one more point before the step."""
    differences = [values]
    for order in range(1, min(_POINTS_BEFORE, len(steps)) + 1):
        spans = sum(steps[k : len(steps) - order + 1 + k] for k in range(order))
        differences.append(np.diff(differences[-1]) / spans)
    highest = len(differences) - 1
    if highest < _POINTS_BEFORE:  # a polynomial that does without: of it, all is off
        return np.abs(differences[-1]).max(axis=1, keepdims=True) * steps ** (highest + 1)
    h, a, b = steps[3:], steps[2:-1], steps[2:-1] + steps[1:-2]
    whole = h**5 / 5 + (a + b - h) * h**4 / 4 + (a * b - h * (a + b)) * h**3 / 3 - h**3 * a * b / 2
    once = differences[_POINTS_BEFORE] * whole
    return np.concatenate([once[:, :1] * (steps[:3] / steps[3]) ** 5, once], axis=1)
