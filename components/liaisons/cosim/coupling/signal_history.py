"""What a group hands on: known at both ends of a step when its targets make theirs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import final

import numpy as np

from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.records import HandedRecord
from liaisons.cosim.coupling.signals import Curve, Indices, Signals, Vector

_POINTS = 3
"""Points before the end of a step that lie, with it, on one cubic."""

Past = tuple[Vector, Vector, Indices]


@final
class SignalHistory:
    """Signals that lead out of a group.

    Where nobody gives their slopes, these are made: from the points before, else from two inside the step.  A discrete
    one stays as it was at the begin of a step until its end.

    :param curves: what the inputs outside follow.
    :ivar made: the values whose slopes are made.
    :ivar others: what these are at two more :attr:`instants`, from the begin of the step [s], where they have no past;
        shape (2, n).
    """

    def __init__(self, signals: Signals, curves: Iterable[Curve]) -> None:
        self._signals = signals
        ports = {curve.data[0]: curve.data for curve in curves}.values()
        made = [data[0] for data in ports if len(data) == 2 and signals.makes(data[0])]
        self.made: Indices = np.array(made, dtype=np.intp)
        signals.held[[index for index in made if not signals.continuous(index)]] = True
        self._slopes: Indices = self.made + signals.count
        n = len(made)
        self._state: Past = np.zeros((2, n)), np.ones(2), np.ones(n, dtype=np.intp)
        self.instants, self.others = np.zeros(2), np.zeros((2, n))

    def record(self, ask: Call | None) -> HandedRecord:
        """The same, for compiled code.

        :param ask: looks for :attr:`others`; returns 1 if it has found them.
        """
        record = HandedRecord(made=len(self.made))
        record.point(**dict(zip(("past", "spans", "depth"), self._state, strict=True)))
        record.point(values=self.made, instants=self.instants, others=self.others)
        record.ask = ask and ask.compiled().function
        return record

    def reset(self) -> None:
        """Forget the past."""
        if (n := self.made.size) == 0:
            return
        self.rewind((np.zeros((2, n)), np.ones(2), np.ones(n, dtype=np.intp)))

    @property
    def fresh(self) -> bool:
        """Whether other points are wanted, since a signal has too short a past."""
        return bool(np.any(self._state[2] < _POINTS))

    def shape(self, size: float, *, others: bool) -> None:
        """Make slopes, once both ends of a step are known.

        :param others: whether there is something in :attr:`others`.
        """
        if not self.made.size:
            return
        past, (last, first), depth = self._state
        ends = self._cubic(size, (-last, -last - first), past, depth)
        if others:
            ends_too = self._cubic(size, self.instants.tolist(), self.others, np.full_like(depth, _POINTS))
            ends = np.where(depth < _POINTS, ends_too, ends)
        self._signals.ends[:, self._slopes] = np.where(self._signals.held[self.made], 0.0, ends)

    def _cubic(self, size: float, instants: Sequence[float], others: Vector, depth: Indices) -> Vector:
        """Slopes at both ends of the cubic through these and two more points.

        :param depth: 2 for a parabola through the first of the two, 1 for a straight line.
        """
        (a, b), (at_a, at_b) = instants, others
        before, now = self._signals.ends[:, self.made]
        rates = np.array([(now - before) / size, (now - at_a) / (size - a), (at_a - at_b) / (a - b)])
        rates[1] = np.where(depth > 1, rates[1], rates[0])
        bend = (rates[1] - rates[0]) / a
        rates[2] = np.where(depth > 2, rates[2], rates[1] + bend * (b - size))
        twist = ((rates[2] - rates[1]) / (b - size) - bend) / b
        return rates[0] + size * np.array([a * twist - bend, (size - a) * twist + bend])

    def accept(self, size: float) -> None:
        """Go on from the end of the step; to be called while the signals still show its begin."""
        if not self.made.size:
            return
        past, spans, depth = self._state
        past[1], past[0] = past[0], self._signals.before[self.made]
        spans[1], spans[0] = spans[0], size
        depth[:] = np.minimum(depth + 1, _POINTS)

    def snapshot(self) -> Past:
        """What :meth:`rewind` needs."""
        past, spans, depth = self._state
        return past.copy(), spans.copy(), depth.copy()

    def rewind(self, state: Past) -> None:
        """Forget what was since the snapshot."""
        for own, other in zip(self._state, state, strict=True):
            own[:] = other
