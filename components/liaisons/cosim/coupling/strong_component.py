"""A strong component of the connection graph: FMUs that feed each other in a cycle, or one FMU outside of cycles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from liaisons.base.structures import Record
from liaisons.cosim.arrays import Indices, Vector, as_indices
from liaisons.cosim.compiled.calls import RAISED, Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.elimination import Elimination
from liaisons.cosim.coupling.node import Node, Phase
from liaisons.cosim.coupling.records import (
    DIVERGED,
    FailureRecord,
    NewtonRecord,
    NodeRecord,
    StrongComponentRecord,
    records,
)
from liaisons.cosim.coupling.signals import Curve, Signals
from liaisons.cosim.structure.schedule import Depends
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import RefusedError, SimulationError

_MOST_ITERATIONS = 100  # as in coupling.c


@final
class Newton:
    """The matrix 1 - ∂F/∂x, with ∂F/∂x as far as it is known.

    Outputs and their slopes depend on inputs directly.  Where the acceleration of a port does, an input that changes at
    the end of a step changes rate and value there, too: by the integrals of its polynomial.

    :param unknowns: indices of x among the signals.
    :param within_steps: the equations of a step; else those at one instant.
    :ivar calls: calculate the derivatives.
    :ivar choose_pivots: calls :meth:`Elimination.choose_pivots`.
    :ivar record: the matrix, for compiled code.
    """

    def __init__(
        self, nodes: Sequence[Node], signals: Signals, unknowns: Indices, depends: Depends, *, within_steps: bool
    ) -> None:
        position = {int(index): k for k, index in enumerate(unknowns)}
        entries: list[tuple[int, int, int, float, int]] = []  # row, column, which derivative, factor, power of H
        self.calls: list[Call] = []
        columns: list[Vector] = []
        number = 0
        for node in nodes:
            pairs, calls, derivatives = node.derivatives(depends, record=within_steps)
            self.calls += calls
            columns += derivatives
            for i, k in pairs:
                curve, value = node.curves[k], node.values.start + i
                effects = [(value, node.sources[k], 1.0, 0), (node.slopes.start + i, curve.rate, 1.0, 0)]
                if within_steps and not signals.held[curve.data[0]]:
                    effects += _through_motion(signals.triple(value), curve)
                entries += [
                    (position[row], position[column], number, factor, power)
                    for row, column, factor, power in effects
                    if row in position and column in position
                ]
                number += 1
        n = len(unknowns)
        slots = {(k, k): k for k in range(n)}
        slot_of_entry = as_indices([slots.setdefault(e[:2], len(slots)) for e in entries])
        numbers, powers = (as_indices([e[k] for e in entries]) for k in (2, 4))
        elimination = Elimination(n, list(slots))
        addresses = [column.ctypes.data + i * column.itemsize for column in columns for i in range(len(column))]
        self.choose_pivots = Call(elimination.choose_pivots)
        self.elimination, self._referenced = elimination, columns
        self.record = record = NewtonRecord(count=len(self.calls), entries=len(entries), numbers=len(slots))
        record.point(calls=records(self.calls), elimination=elimination.record)
        record.point(derivatives=np.array(addresses, dtype=np.uintp)[numbers], slots=slot_of_entry, powers=powers)
        record.point(factors=np.array([entry[3] for entry in entries]), values=elimination.values)
        record.order = self.choose_pivots.compiled().function


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


@final
@dataclass(frozen=True)
class _Equations:
    """The equations x = F(x) of one phase, for compiled code.

    :param calls: those of each node.
    :param buffers: what the record points to.
    """

    record: StrongComponentRecord
    calls: Sequence[Sequence[Call]]
    newton: Newton | None
    buffers: object


@final
class StrongComponent:
    """Nodes that are solved together: by Newton's method in implicit coupling, else by Gauss-Seidel iteration.

    :param cyclic: the nodes feed each other, or one feeds itself.
    """

    def __init__(
        self, nodes: Sequence[Node], signals: Signals, bus: Bus, simulation: Simulation, *, cyclic: bool
    ) -> None:
        self.nodes = nodes
        self._signals = signals
        self._bus = bus
        self._cyclic = cyclic
        self._tolerance = simulation.interface_tolerance
        fed = {i for node in nodes for curve in node.curves for i in (*curve.data, curve.rate)} - {signals.zero}
        own = {i for n in nodes for part in (n.values, *[n.slopes] * n.sloped) for i in range(part.start, part.stop)}
        self._unknowns = as_indices(sorted(fed & own))
        self._kinds = signals.kinds[self._unknowns % signals.count]
        self._errors = np.empty(len(self._unknowns))
        self._implicit = simulation.coupling == "implicit"
        running = self._make_newton(simulation.depends, within_steps=True)
        settling = self._make_newton(simulation.depends, within_steps=False)
        starting = self._make_newton(partial(simulation.depends, initially=True), within_steps=False)
        self._equations: dict[Phase, _Equations] = {
            "step": self._equations_of("step", running, cyclic=cyclic),
            "instant": self._equations_of("instant", settling, cyclic=cyclic),
            "initialization": self._equations_of("initialization", starting, cyclic=cyclic),
            "crossing": self._equations_of("crossing", None, cyclic=False),
        }

    def _make_newton(self, depends: Depends, *, within_steps: bool) -> Newton | None:
        if not (self._cyclic and self._implicit):
            return None
        return Newton(self.nodes, self._signals, self._unknowns, depends, within_steps=within_steps)

    def _equations_of(self, phase: Phase, newton: Newton | None, *, cyclic: bool) -> _Equations:
        calls, nodes = zip(*(node.program(phase) for node in self.nodes), strict=True)
        record = StrongComponentRecord(cyclic=cyclic, tolerance=self._tolerance, count=len(nodes))
        record.n, record.valued = len(self._unknowns), np.searchsorted(self._unknowns, self._signals.count)
        record.point(
            nodes=(NodeRecord * len(nodes))(*nodes), unknowns=self._unknowns, kinds=self._kinds, errors=self._errors
        )
        if newton is not None:
            record.point(newton=newton.record)
        return _Equations(record, calls, newton, nodes)

    def record(self, phase: Phase) -> StrongComponentRecord:
        """The equations of a phase, for compiled code."""
        return self._equations[phase].record

    def forget_derivatives(self) -> None:
        """Mark the derivatives as out of date, so that the next step calculates them."""
        for equations in self._equations.values():
            if equations.newton is not None:
                equations.newton.record.ready = False

    @property
    def matrices(self) -> list[Record]:
        """The structures of Newton's method, whose factors serve for several steps."""
        newtons = [equations.newton for equations in self._equations.values() if equations.newton is not None]
        return [record for newton in newtons for record in (newton.record, newton.elimination.record)]

    def read_start_values(self) -> None:
        """Read the outputs at the start values of a cycle: the first guess."""
        for node in self.nodes if self._cyclic else ():
            node.read(self._signals.now)

    @property
    def source(self) -> Node | None:
        """The node, if it has no inputs and takes steps of any size; else None."""
        first = self.nodes[0]
        return None if self._cyclic or first.inputs or not first.part.fmu.variable_step else first

    def raise_failure(self, phase: Phase, failure: FailureRecord, status: int) -> None:
        """Raise the error of equations that compiled code has not solved.

        :raises SimulationError: always.
        """
        equations = self._equations[phase]
        if status == DIVERGED:
            self._raise_divergence(self._bus.end.value, self._errors)
        if (newton := equations.newton) is not None and status == RAISED and newton.choose_pivots.raised is not None:
            self._raise_singular(newton.choose_pivots)
        calls = newton.calls if failure.deriving and newton is not None else equations.calls[failure.node]
        try:
            self._bus.check_status(calls[failure.call], status)
        except RefusedError as refusal:
            if failure.iteration == 0:
                raise
            hint = f"with inputs of iteration {failure.iteration}, which leads away: choose a smaller step_size"
            raise RefusedError(f"{refusal}; {hint}") from refusal

    def _raise_singular(self, choose_pivots: Call) -> None:
        try:
            self._bus.check_status(choose_pivots, RAISED)
        except RuntimeError:
            names = ", ".join(node.name for node in self.nodes)
            raise SimulationError(
                f"{names}: what they hand each other at t = {self._bus.end.value:.10g} s depends on itself without a "
                "single solution, as with a body that carries itself or two that prescribe each other: change the "
                "connections"
            ) from None

    def _raise_divergence(self, time: float, errors: Vector) -> None:
        worst = int(self._unknowns[int(np.argmax(errors))]) % self._signals.count
        signal = ".".join(self._signals.references[worst])
        names = ", ".join(node.name for node in self.nodes)
        cure = "choose a smaller step_size" + ("" if self._implicit else ", or coupling='implicit'")
        raise RefusedError(
            f"{names}: what they hand each other does not converge at t = {time:.10g} s, {signal} least of all, "
            f"after {_MOST_ITERATIONS} iterations: {cure}"
        )
