"""Newton's method for x = F(x): what is known of ∂F/∂x, and the equations with it."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import pointer
from typing import final

import numpy as np

from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.elimination import Elimination
from liaisons.cosim.coupling.node import Node
from liaisons.cosim.coupling.polynomials import powers
from liaisons.cosim.coupling.records import NewtonRecord, records
from liaisons.cosim.coupling.signals import Curve, Indices, Signals, Vector
from liaisons.cosim.structure.schedule import Depends


@final
class Newton:
    """Applies (1 - ∂F/∂x)⁻¹, with ∂F/∂x as far as it is known.

    Outputs depend on inputs directly, and so do their slopes; and where the acceleration of a port does, an input that
    changes at the end of a step changes rate and value there too: by the integrals of its polynomial.

    :param unknowns: indices of x among the signals.
    :ivar calls: what calculates derivatives.
    :ivar record: the same, for compiled code.
    """

    def __init__(
        self,
        members: Sequence[Node],
        signals: Signals,
        unknowns: Indices,
        depends: Depends,
        bus: Bus,
        *,
        initial: bool,
    ) -> None:
        place = {int(index): k for k, index in enumerate(unknowns)}
        entries: list[tuple[int, int, int, float, int]] = []  # row, column, which derivative, factor, power of H
        self.calls: list[Call] = []
        self._bus = bus
        self._derivatives: list[Vector] = []
        number = 0
        for member in members:
            pairs, calls, derivatives = member.derivatives(depends, record=not initial)
            self.calls += calls
            self._derivatives += derivatives
            for i, k in pairs:
                curve, value = member.curves[k], member.values.start + i
                effects = [(value, member.sources[k], 1.0, 0), (member.slopes.start + i, curve.rate, 1.0, 0)]
                if not initial:
                    effects += _through_motion(signals.triple(value), curve)
                entries += [
                    (place[row], place[column], number, factor, power)
                    for row, column, factor, power in effects
                    if row in place and column in place
                ]
                number += 1
        n = len(unknowns)
        slots = {(k, k): k for k in range(n)}
        self._slots = np.array([slots.setdefault(e[:2], len(slots)) for e in entries], dtype=np.intp)
        self._numbers, self._powers = (np.array([e[k] for e in entries], dtype=np.intp) for k in (2, 4))
        self._factors = np.array([entry[3] for entry in entries])
        self._elimination = Elimination(n, list(slots))
        self.record = NewtonRecord()

    def prepare(self, size: float) -> None:
        """Calculate the derivatives at the present instant, for a step of a size [s].

        :raises RuntimeError: if the equations are singular.
        """
        self._bus.perform(self.calls)
        found = np.concatenate([np.empty(0), *self._derivatives])
        values, n = self._elimination.values, self._elimination.record.n
        values[:n], values[n:] = 1.0, 0.0
        np.subtract.at(values, self._slots, found[self._numbers] * self._factors * powers(size)[self._powers])
        self._elimination.factorize()
        self.ready = True

    @property
    def ready(self) -> bool:
        """Whether :meth:`solve` has something to solve with."""
        return bool(self.record.ready)

    @ready.setter
    def ready(self, value: bool) -> None:
        self.record.ready = value

    def order(self) -> None:
        """As :meth:`prepare` for the derivatives that were calculated last, but by other pivots."""
        self._elimination.order()

    def told(self, order: Call) -> NewtonRecord:
        """The record, filled.

        :param order: calls :meth:`order`.
        """
        record, elimination = self.record, self._elimination
        addresses = [
            values.ctypes.data + i * values.itemsize for values in self._derivatives for i in range(len(values))
        ]
        record.calls, record.count = records(self.calls), len(self.calls)
        record.entries, record.numbers = len(self._slots), len(elimination.values)
        record.point(derivatives=np.array(addresses, dtype=np.uintp)[self._numbers])
        record.point(slots=self._slots, powers=self._powers, factors=self._factors, values=elimination.values)
        record.elimination, record.order = pointer(elimination.record), order.compiled().function
        return record

    def solve(self, right: Vector) -> Vector:
        """Apply it, as it was last prepared."""
        return self._elimination.solve(right)


def _through_motion(triple: Sequence[int], curve: Curve) -> list[tuple[int, int, float, int]]:
    """How the data of an input at t + H move a port: (of the port, of the input, factor, power of H)."""
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
