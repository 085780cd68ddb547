"""What coupling costs: the error that each step adds, estimated from the points that were recorded.

Within a step an input follows a polynomial, and the next divided difference, with the point before the step, says how
far what feeds it leaves that: the remainder of Hermite interpolation (Hairer, Norsett, Wanner, Solving ODEs I, II.6).
What this does to the motion follows from ∂(acceleration)/∂(input), M eq. 50, by integrating over the step, once and
twice.  No FMU is asked for anything but these derivatives, which Newton's method has anyway, or which are taken once,
at the begin.  Where there are none, an input that is off by some part is taken to spoil that part of what its FMU does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import floor, gamma, log10
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.coupling.handed import CONTRADICTION, MISS
from liaisons.cosim.coupling.polynomials import coefficients
from liaisons.cosim.messages import logger
from liaisons.cosim.schedule import Place

Vector = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Integrals = tuple[Vector, Vector]

ALLOWED = 1e-4
"""A step that adds a larger error, relative to the size of the signal, is warned of."""
_NUMBERS = 60_000
"""So many are looked at together."""
_BACK = 4
"""Points before a step that are looked at."""
_SUDDEN = 1 / 50
"""After a step shorter by this factor nothing is known: it leads through a jump, or rounding is all there is."""
_SAFETY = 0.8

Shape = Literal["hermite", "points", "taylor", "mean", "newest"]
"""Through data at both ends; a cubic through the end and points before; from the begin; the mean; the end."""


@final
@dataclass(frozen=True)
class Followed:
    """What an input follows over a step.

    :param name: of the connection.
    :param given: column of the input; ``data`` those of value, first and second derivative, as far as used.
    :param order: which derivative of the data the input is.
    :param jumps: whether it is held where it jumps.
    :param effects: column of ∂(acceleration)/∂(input), and those of the rate and the value of that acceleration.
    :param answers: columns of what its FMU gives, where there are no effects.
    """

    name: str
    given: int
    data: tuple[int, ...]
    order: int
    shape: Shape
    jumps: bool
    effects: tuple[tuple[int, int, int], ...]
    answers: tuple[int, ...]

    @property
    def power(self) -> int:
        """Of H, in the error of a step."""
        whole = {"hermite": 2 * len(self.data) + 1, "points": 5, "taylor": len(self.data) - self.order + 1}
        return whole.get(self.shape, 3 if self.shape == "mean" else 2)


@final
@dataclass(frozen=True)
class Worst:
    """The largest error, when [s], whose signal, what made it; and a step [s] that would not."""

    error: float
    time: float
    signal: str
    connection: str
    size: float
    enough: float

    def warn(self) -> None:
        """Say so, if it is too large."""
        if self.error > ALLOWED:
            logger.warning(
                "coupling error %.2g of %s at t = %.6g s: %s is handed over too rarely by steps of %.3g s; "
                "a step_size of %.1g s would do",
                self.error,
                self.signal,
                self.time,
                self.connection,
                self.size,
                self.enough,
            )


@final
class Estimate:
    """Errors of communication steps by what was on the bus at their ends.

    :param followed: what inputs follow.
    :param columns: what is on the bus, and where.
    :param kinds: what of it is compared with what, shape (width,).
    """

    def __init__(self, followed: Iterable[Followed], columns: Mapping[Place, int], kinds: Indices) -> None:
        alike: dict[tuple[Shape, int, int, bool], list[Followed]] = {}
        for item in followed:
            alike.setdefault((item.shape, len(item.data), item.order, item.jumps), []).append(item)
        self._alike = [(key, np.array([(item.given, *item.data) for item in items])) for key, items in alike.items()]
        self._followed = [item for items in alike.values() for item in items]
        self._names = {column: ".".join(place) for place, column in columns.items()}
        effects = sorted(effect for k, item in enumerate(self._followed) for effect in _effects(k, item))
        targets, self._of, gains, once = np.array(effects, dtype=np.intp).reshape(-1, 4).T
        self._once, self._blind, self._gains = once == 1, np.flatnonzero(gains < 0), gains
        self._targets, self._starts = np.unique(targets, return_index=True)
        self._of_kind = [np.flatnonzero(kinds[self._targets] == kind) for kind in np.unique(kinds[self._targets])]
        self._answers = [np.array(self._followed[self._of[j]].answers, dtype=np.intp) for j in self._blind]
        self.begin_anew(np.empty(0))

    def begin_anew(self, constants: Vector) -> None:
        """Forget everything.

        :param constants: derivatives that stay, which stand behind the bus.
        """
        self._constants = constants
        self._sizes = np.zeros(len(self._of_kind))
        self.worst: Worst | None = None

    def __call__(self, rows: Vector, times: Vector) -> Vector:
        """The error that each step has added, relative to the largest value of the signal's unit so far.

        :param rows: what was on the bus, shape (points, width).
        :returns: shape (points,); 0 for the first.
        """
        errors = np.zeros(len(times))
        if not len(self._targets) or len(times) < 2:
            return errors
        block = max(_BACK, _NUMBERS // rows.shape[1])
        for first in range(1, len(times), block):
            begin, end = max(first - _BACK, 0), min(first + block, len(times))
            signals = np.ascontiguousarray(rows[begin:end].T)
            errors[first:end] = self._of_block(signals, times[begin:end], first - begin)
        if len(times) > 2:
            errors[1] = errors[2]  # there is nothing before the first step
        return errors

    def latest(self, rows: Vector, times: Vector, count: int) -> float:
        """The largest error of the last steps.

        :param count: how many; what comes before is known already, or the begin.
        """
        first = max(len(times) - count, 2)
        if not len(self._targets) or first >= len(times):
            return 0.0
        return float(np.max(self._of_block(np.ascontiguousarray(rows.T), times, first)))

    def snapshot(self) -> tuple[Vector, Worst | None]:
        """What :meth:`rewind` needs."""
        return self._sizes.copy(), self.worst

    def rewind(self, snapshot: tuple[Vector, Worst | None]) -> None:
        """Forget what was since the snapshot."""
        self._sizes[:], self.worst = snapshot

    def _of_block(self, signals: Vector, times: Vector, first: int) -> Vector:
        """The same of a few steps, from the one that ends at the point ``first`` on; shape (width, points)."""
        steps = np.diff(times)
        scales = np.abs(signals[self._targets])
        for k, targets in enumerate(self._of_kind):
            largest = np.maximum(np.maximum.accumulate(scales[targets].max(axis=0)), self._sizes[k])
            self._sizes[k] = largest[-1]
            scales[targets] = np.where(largest > 0, largest, 1.0)
        integrals = [_integrals(key, of, signals, steps) for key, of in self._alike]
        once, twice = (np.concatenate([both[k] for both in integrals]) for k in range(2))
        added = np.where(self._once[:, None], once[self._of], twice[self._of])
        recorded, behind = self._gains < len(signals), self._gains >= len(signals)
        recorded[self._blind] = False
        added[recorded] *= signals[self._gains[recorded], 1:]
        added[behind] *= self._constants[self._gains[behind] - len(signals), None]
        for j, answers in zip(self._blind, self._answers, strict=True):
            largest = np.abs(signals[answers]).max(axis=1, keepdims=True)
            changes = np.abs(np.diff(signals[answers], axis=1)) / np.where(largest > 0, largest, 1.0)
            added[j] *= changes.max(axis=0, initial=0.0) / steps
        totals = np.abs(np.add.reduceat(added, self._starts, axis=0)) / scales[:, 1:]
        errors = totals.max(axis=0)
        latest = first - 1 + int(np.argmax(errors[first - 1 :]))
        if self.worst is None or errors[latest] > self.worst.error:
            self._note(added[:, latest], totals[:, latest], float(times[latest + 1]), float(steps[latest]))
        return errors[first - 1 :]

    def _note(self, added: Vector, totals: Vector, time: float, size: float) -> None:
        target = int(np.argmax(totals))
        start, end = (*self._starts, len(added))[target : target + 2]
        item = self._followed[self._of[start + int(np.argmax(np.abs(added[start:end])))]]
        error = float(totals[target])
        enough = _SAFETY * size * (ALLOWED / max(error, ALLOWED)) ** (1 / (item.power - 1))
        digit = 10.0 ** floor(log10(enough))
        signal = self._names[int(self._targets[target])]
        self.worst = Worst(error, time, signal, item.name, size, floor(enough / digit) * digit)


def _effects(k: int, item: Followed) -> Iterator[tuple[int, int, int, int]]:
    """Column of what an input spoils, input, column of the derivative (-1: unknown), whether integrated once."""
    if not item.effects:
        yield item.given, k, -1, 1
    smooth = item.shape == "hermite"
    for gain, rate, value in item.effects:
        if rate >= 0 and (item.order == 0 or (item.order == 1 and not smooth)):
            yield rate, k, gain, 1
        if value >= 0 and (item.order < 2 or not smooth):
            yield value, k, gain, 0


def _integrals(key: tuple[Shape, int, int, bool], columns: Indices, signals: Vector, steps: Vector) -> Integrals:
    """∫ e and ∫ (t + H - τ) e over each step, e by what inputs are off, shape (inputs, steps) each."""
    shape, count, order, jumps = key
    data = signals[columns[:, 1:].T]  # (count, inputs, points)
    change = np.diff(data[0])
    if shape == "hermite":
        once, twice = _hermite(data, steps)
        once, twice = (once, twice) if order == 0 else (once, once)
        if jumps and count > 1:
            once, twice = _unless(_contradicted(data, steps), 2, once, twice)
    elif shape == "points":
        once, missed = _points(data[0], steps)
        once, twice = _unless(missed, _BACK, once, once * steps / 2)
    elif shape == "taylor":
        power = count - order
        parabola = sum(data[order + j, :, :-1] * (steps**j / gamma(j + 1)) for j in range(power))
        late, off = data[order, :, :-1] - signals[columns[:, 0], :-1], data[order, :, 1:] - parabola
        once = steps * (late + off / (power + 1))
        twice = steps**2 * (late / 2 + off / ((power + 1) * (power + 2)))
    elif shape == "mean":
        once, _ = _hermite(data, steps)
        twice = once * steps / 2 - steps**2 * change / 12
    else:
        once, twice = -steps * change / 2, -(steps**2) * change / 3
    return once, twice


def _hermite(data: Vector, steps: Vector) -> Integrals:
    """By the polynomial through value, and slope, at the point before the step, too."""
    m = len(data)
    before = np.concatenate([steps[:1], steps[:-1]]) / steps
    unknown = before < _SUDDEN
    unknown[0] = True
    before[unknown] = 1.0
    scales = steps ** np.arange(m)[:, None]
    ends = [data[k, :, end : end + len(steps)] * scales[k] for end in (0, 1) for k in range(m)]
    earlier = [np.concatenate([data[k, :, :1], data[k, :, :-2]], axis=1) * scales[k] for k in range(min(m, 2))]
    there = (-before) ** np.arange(2 * m)[:, None]
    slopes = np.arange(1, 2 * m)[:, None] * there[:-1]
    at = coefficients(m)
    weight = (before * (before + 1)) ** m
    first = (earlier[0] - sum(values * (row @ there) for row, values in zip(at.T, ends, strict=True))) / weight
    second = np.zeros_like(first)
    if m > 1:
        slope = sum(values * (row[1:] @ slopes) for row, values in zip(at.T, ends, strict=True))
        tilt = -m * (before * (before + 1)) ** (m - 1) * (2 * before + 1)
        second = (earlier[1] - slope - tilt * first) / weight
    bulge = (-1) ** m * gamma(m + 1) ** 2 / gamma(2 * m + 2)
    once = steps * bulge * (first + second * (before + 1 / 2))
    twice = steps**2 * bulge * ((first + second * before) / 2 + second * (m + 1) / (4 * m + 6))
    once[:, unknown] = twice[:, unknown] = 0.0
    return once, twice


def _points(values: Vector, steps: Vector) -> tuple[Vector, Flags]:
    """By the polynomial through one more point before the step; and whether the points before missed the end."""
    differences = [values]
    for order in range(1, _BACK + 1):
        spans = sum(steps[k : len(steps) - order + 1 + k] for k in range(order))
        differences.append(np.diff(differences[-1]) / spans)
    _, rates, _, thirds, fourths = differences
    once, missed = np.zeros_like(rates), np.zeros(rates.shape, dtype=bool)
    if thirds.size:
        steepest = np.max([np.abs(rates[:, k : rates.shape[1] - 2 + k]) for k in range(3)], axis=0)
        gaps = (steps[2:] + steps[1:-1] + steps[:-2]) / 3
        missed[:, 2:] = 6 * gaps**2 * np.abs(thirds) > MISS * steepest
        h, a, b = steps[3:], steps[2:-1], steps[2:-1] + steps[1:-2]
        whole = h**5 / 5 + (a + b - h) * h**4 / 4 + (a * b - h * (a + b)) * h**3 / 3 - h**3 * a * b / 2
        once[:, 3:] = fourths * whole
    return once, missed


def _contradicted(data: Vector, steps: Vector) -> Flags:
    """Whether it has jumped at the end of a step; as :class:`liaisons.cosim.coupling.handed.Handed` has it."""
    change, rises = np.diff(data[:-1]), steps * data[1:, :, 1:]
    before = steps * data[1:, :, :-1]
    largest = np.maximum(np.abs(change), np.maximum(np.abs(rises), np.abs(before)))
    return np.any(np.abs(change - (rises + before) / 2) > CONTRADICTION * largest, axis=0)


def _unless(jumped: Flags, reach: int, *integrals: Vector) -> Integrals:
    """Nothing is known in the step before a jump, which holds, and where the jump is among the points before."""
    near = jumped.copy()
    for k in range(1, reach):
        near[:, k:] |= jumped[:, :-k]
    once, twice = (np.where(near, 0.0, values) for values in integrals)
    return once, twice
