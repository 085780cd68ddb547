"""Newton's method for x = F(x): the matrix 1 - ∂F/∂x, as far as directional derivatives give it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.elimination import Elimination
from liaisons.cosim.coupling.node import Node
from liaisons.cosim.coupling.records import NewtonRecord, records
from liaisons.cosim.coupling.signals import Curve, Signals
from liaisons.cosim.structure.schedule import Depends


@final
class Newton:
    """The matrix 1 - ∂F/∂x, with ∂F/∂x as far as it is known.

    Outputs and their slopes depend on inputs directly.  Where the acceleration of a port does, an input that changes at
    the end of a step changes rate and value there, too: by the integrals of its polynomial.

    :param unknowns: indices of x among the signals.
    :param initial: the equations of initialization, where there are no slopes.
    :ivar calls: calculate the derivatives.
    :ivar order: calls :meth:`Elimination.order`.
    :ivar record: the matrix, for compiled code.
    """

    def __init__(
        self, nodes: Sequence[Node], signals: Signals, unknowns: Indices, depends: Depends, *, initial: bool
    ) -> None:
        position = {int(index): k for k, index in enumerate(unknowns)}
        entries: list[tuple[int, int, int, float, int]] = []  # row, column, which derivative, factor, power of H
        self.calls: list[Call] = []
        columns: list[Vector] = []
        number = 0
        for node in nodes:
            pairs, calls, derivatives = node.derivatives(depends, record=not initial)
            self.calls += calls
            columns += derivatives
            for i, k in pairs:
                curve, value = node.curves[k], node.values.start + i
                effects = [(value, node.sources[k], 1.0, 0), (node.slopes.start + i, curve.rate, 1.0, 0)]
                if not initial:
                    effects += _through_motion(signals.triple(value), curve)
                entries += [
                    (position[row], position[column], number, factor, power)
                    for row, column, factor, power in effects
                    if row in position and column in position
                ]
                number += 1
        n = len(unknowns)
        slots = {(k, k): k for k in range(n)}
        slot_of_entry = np.array([slots.setdefault(e[:2], len(slots)) for e in entries], dtype=np.intp)
        numbers, powers = (np.array([e[k] for e in entries], dtype=np.intp) for k in (2, 4))
        elimination = Elimination(n, list(slots))
        addresses = [column.ctypes.data + i * column.itemsize for column in columns for i in range(len(column))]
        self.order = Call(elimination.order)
        self._kept = columns, elimination
        self.record = record = NewtonRecord(count=len(self.calls), entries=len(entries), numbers=len(slots))
        record.point(calls=records(self.calls), elimination=elimination.record)
        record.point(derivatives=np.array(addresses, dtype=np.uintp)[numbers], slots=slot_of_entry, powers=powers)
        record.point(factors=np.array([entry[3] for entry in entries]), values=elimination.values)
        record.order = self.order.compiled().function


def _through_motion(triple: Sequence[int], curve: Curve) -> list[tuple[int, int, float, int]]:
    """Entries of the matrix by which an input at t + H moves a port: (row, column, factor, power of H)."""
    if len(triple) < 3 or len(curve.data) > len(_INTEGRALS) or curve.order > 0:
        return []
    integrals = _INTEGRALS[len(curve.data)]
    return [
        (triple[row], datum, factor, power + 2 - row)
        for power, (datum, factors) in enumerate(zip(curve.data, integrals, strict=True))
        for row, factor in enumerate(factors)
    ]


_INTEGRALS = {1: [(1 / 6, 1 / 2)], 2: [(3 / 20, 1 / 2), (-1 / 30, -1 / 12)]}
"""∫ (1 - θ) h and ∫ h over the step, for the Hermite polynomials h of value (and rate) at its end."""
