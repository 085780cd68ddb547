"""Past values of outputs without derivatives, from which compiled code makes their slopes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import final

import numpy as np

from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.records import SignalHistoryRecord
from liaisons.cosim.coupling.signals import Curve, Signals

Past = tuple[Vector, Vector, Indices]


@final
class SignalHistory:
    """Outputs of a strong component that feed others.

    Slopes that no FMU gives are made from the points before a step, else from two inside.  Discrete outputs keep their
    value from the start of a step until its end.

    :param curves: curves of the inputs that are fed.
    :ivar made: indices of the outputs whose slopes are made.
    :ivar others: their values at two :attr:`instants` after the start of the step [s], if they have no past; shape
        (2, n).
    """

    def __init__(self, signals: Signals, curves: Iterable[Curve]) -> None:
        ports = {curve.data[0]: curve.data for curve in curves}.values()
        made = [data[0] for data in ports if len(data) == 2 and signals.makes(data[0])]
        self.made: Indices = np.array(made, dtype=np.intp)
        signals.held[[index for index in made if not signals.continuous(index)]] = True
        n = len(made)
        self._state: Past = np.zeros((2, n)), np.ones(2), np.ones(n, dtype=np.intp)
        self.instants, self.others = np.zeros(2), np.zeros((2, n))

    def record(self, step_in_thirds: Call | None) -> SignalHistoryRecord:
        """The structure that compiled code reads.

        :param step_in_thirds: makes a step, and sets :attr:`others` to the outputs inside it.
        """
        record = SignalHistoryRecord(made=len(self.made))
        record.point(**dict(zip(("past", "spans", "depth"), self._state, strict=True)))
        record.point(values=self.made, instants=self.instants, others=self.others)
        record.step_in_thirds = step_in_thirds and step_in_thirds.compiled().function
        return record

    def reset(self) -> None:
        """Forget the past."""
        for numbers, first in zip(self._state, (0, 1, 1), strict=True):
            numbers[:] = first

    def snapshot(self) -> Past:
        """The state for :meth:`rewind`."""
        past, spans, depth = self._state
        return past.copy(), spans.copy(), depth.copy()

    def rewind(self, state: Past) -> None:
        """Return to a snapshot."""
        for own, other in zip(self._state, state, strict=True):
            own[:] = other
