"""What a group hands on: known at both ends of a step when its targets make theirs, smooth or with a jump."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.calls import Call
from liaisons.cosim.coupling.records import HandedRecord
from liaisons.cosim.coupling.signals import Curve, Indices, Signals, Vector

CONTRADICTION = 1 / 4
"""A value that is off the mean of its slopes by more than this part of the change in a step has jumped.

Of a sine, so is what has less than four steps a period.
"""
MISS = 1 / 2
"""So has one that its past missed by more than this part; of a sine, what has less than nine."""
_POINTS = 3
"""Points before the end of a step that lie, with it, on one cubic."""

Flags = NDArray[np.bool_]
Past = tuple[Vector, Vector, Indices, Flags]


@final
class Handed:
    """Signals that lead out of a group.

    Where nobody gives their slopes, these are made: from the points before, else from two inside the step or after it.
    A jump at the end of a step leaves the signal as it was known at its begin, and its past is forgotten.

    :param curves: what the inputs outside follow.
    :ivar made: the values whose slopes are made.
    :ivar others: what these are at two more :attr:`instants`, from the begin of the step [s], where they have no past;
        shape (2, n).
    """

    def __init__(self, signals: Signals, curves: Iterable[Curve]) -> None:
        self._signals = signals
        ports = {curve.data[0]: curve.data for curve in curves}.values()
        made = [data[0] for data in ports if len(data) == 2 and signals.makes(data[0])]
        pairs = [(*pair, data[0]) for data in ports if data[0] not in made for pair in pairwise(data)]
        self.made: Indices = np.array(made, dtype=np.intp)
        self._stairs: Flags = np.array([not signals.continuous(index) for index in made], dtype=bool)
        self._slopes: Indices = self.made + signals.count
        self._given: list[Indices] = [np.array([pair[k] for pair in pairs], dtype=np.intp) for k in range(3)]
        n = len(made)
        self._state: Past = np.zeros((2, n)), np.ones(2), np.ones(n, dtype=np.intp), self._stairs.copy()
        self.instants, self.others = np.zeros(2), np.zeros((2, n))

    def record(self, ask: Call | None) -> HandedRecord:
        """The same, for compiled code.

        :param ask: looks for :attr:`others`; returns 1 if it has found them.
        """
        record = HandedRecord(given=len(self._given[0]), made=len(self.made))
        record.point(**dict(zip(("given_values", "given_slopes", "given_roots"), self._given, strict=True)))
        record.point(**dict(zip(("past", "spans", "depth", "jumped"), self._state, strict=True)))
        record.point(made_values=self.made, stairs=self._stairs, instants=self.instants, others=self.others)
        record.ask = ask and ask.compiled().function
        return record

    def begin_anew(self) -> None:
        """Forget everything."""
        n = self.made.size
        self.rewind((np.zeros((2, n)), np.ones(2), np.ones(n, dtype=np.intp), self._stairs))

    @property
    def fresh(self) -> bool:
        """Whether other points are wanted, since a signal has too short a past."""
        return bool(np.any(self._state[2] < _POINTS))

    def shape(self, size: float, *, others: bool) -> None:
        """Make slopes, and find what jumps, once both ends of a step are known.

        :param others: whether there is something in :attr:`others`.
        """
        signals = self._signals
        values, slopes, roots = self._given
        if values.size:
            change = signals.now[values] - signals.before[values]
            rises = size * signals.ends[:, slopes]
            largest = np.maximum(np.abs(change), np.abs(rises).max(axis=0))
            signals.held[roots] = False
            signals.held[roots[np.abs(change - rises.sum(axis=0) / 2) > CONTRADICTION * largest]] = True
        if self.made.size:
            past, (last, first), depth, jumped = self._state
            ends, jumps = self._cubic(size, (-last, -last - first), past, depth)
            jumps = np.where(depth == 1, jumped, jumps)
            if others:
                ends_too, jumps_too = self._cubic(
                    size, self.instants.tolist(), self.others, np.full_like(depth, _POINTS)
                )
                better = (depth < _POINTS) & ~jumps_too
                ends, jumps = np.where(better, ends_too, ends), jumps & ~better
            jumps |= self._stairs
            signals.held[self.made] = jumps
            signals.ends[:, self._slopes] = np.where(jumps, 0.0, ends)

    def _cubic(self, size: float, instants: Sequence[float], others: Vector, depth: Indices) -> tuple[Vector, Flags]:
        """Slopes at both ends of the cubic through these and two more points, and whether one is off that of the rest.

        :param depth: 2 for a parabola through the first of the two, 1 for a straight line.
        """
        (a, b), (at_a, at_b) = instants, others
        before, now = self._signals.ends[:, self.made]
        gap = (max(a, b, size) - min(a, b, 0.0)) / 3
        rates = np.array([(now - before) / size, (now - at_a) / (size - a), (at_a - at_b) / (a - b)])
        rates[1] = np.where(depth > 1, rates[1], rates[0])
        bend = (rates[1] - rates[0]) / a
        rates[2] = np.where(depth > 2, rates[2], rates[1] + bend * (b - size))
        twist = ((rates[2] - rates[1]) / (b - size) - bend) / b
        off = np.where(depth > 2, 6 * (gap * gap) * np.abs(twist), 2 * gap * np.abs(bend))
        ends = rates[0] + size * np.array([a * twist - bend, (size - a) * twist + bend])
        return ends, off > MISS * np.abs(rates).max(axis=0)

    def accept(self, size: float) -> None:
        """Go on from the end of the step; to be called while the signals still show it."""
        if not self.made.size:
            return
        past, spans, depth, jumped = self._state
        past[1], past[0] = past[0], self._signals.before[self.made]
        spans[1], spans[0] = spans[0], size
        jumped[:] = self._signals.held[self.made] & (depth > 1)
        depth[:] = np.where(jumped, 1, np.minimum(depth + 1, _POINTS))

    def snapshot(self) -> Past:
        """What :meth:`rewind` needs."""
        past, spans, depth, jumped = self._state
        return past.copy(), spans.copy(), depth.copy(), jumped.copy()

    def rewind(self, state: Past) -> None:
        """Forget what was since the snapshot."""
        for own, other in zip(self._state, state, strict=True):
            own[:] = other
