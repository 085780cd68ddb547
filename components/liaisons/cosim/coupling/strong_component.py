"""A strong component of the connection graph: FMUs that feed each other in a cycle, or one FMU outside of cycles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn, final

import numpy as np

from liaisons.base.arrays import as_indices
from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.compiled.calls import RAISED, Call, call_records
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.elimination import Elimination
from liaisons.cosim.coupling.node import Node, Phase
from liaisons.cosim.coupling.records import DIVERGED, NewtonRecord, NodeRecord, StrongComponentRecord
from liaisons.cosim.coupling.signals import Curve, Signals
from liaisons.cosim.structure.schedule import Depends
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structures import Record
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
        entries: list[
            tuple[int, int, int, float, int]
        ] = []  # row, column, address of the derivative, factor, power of H
        self.calls: list[Call] = []
        self._values: list[Vector] = []  # at the addresses
        gains = [(node, gain) for node in nodes for gain in node.prepare_gains(depends, record=within_steps)]
        for node, (k, outputs, call, derivatives) in gains:
            self.calls.append(call)
            self._values.append(derivatives)
            curve = node.curves[k]
            for n, i in enumerate(outputs):
                value = node.values.start + i
                effects = [(value, node.sources[k], 1.0, 0), (node.slopes.start + i, curve.rate, 1.0, 0)]
                if within_steps and not signals.held[curve.data[0]]:
                    effects += _motion_entries(signals.port_of_acceleration(value), curve)
                entries += [
                    (position[row], position[column], derivatives[n:].ctypes.data, factor, power)
                    for row, column, factor, power in effects
                    if row in position and column in position
                ]
        n = len(unknowns)
        slots = {(k, k): k for k in range(n)}
        slot_of_entry = as_indices([slots.setdefault(e[:2], len(slots)) for e in entries])
        self.elimination = elimination = Elimination(n, list(slots))
        self.choose_pivots = Call(elimination.choose_pivots)
        self.record = record = NewtonRecord(count=len(self.calls), entries=len(entries), numbers=len(slots))
        record.point(calls=call_records(self.calls), elimination=elimination.record)
        record.point(slots=slot_of_entry, derivatives=np.array([e[2] for e in entries], dtype=np.uintp))
        record.point(factors=np.array([e[3] for e in entries]), powers=as_indices([e[4] for e in entries]))
        record.point(values=elimination.values)
        record.order = self.choose_pivots.compiled_record().function


def _motion_entries(port: Sequence[int], curve: Curve) -> list[tuple[int, int, float, int]]:
    """Entries (row, column, factor, power of H) by which an input at t + H moves rate and value of a port."""
    if not port or len(curve.data) > len(_INTEGRALS) or curve.order > 0:
        return []
    integrals = _INTEGRALS[len(curve.data)]
    return [
        (port[row], datum, factor, power + 2 - row)
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

    record: Record
    calls: Sequence[Sequence[Call]]
    newton: Newton | None
    buffers: object


@final
class StrongComponent:
    """Nodes that are solved together: by Newton's method in implicit coupling, else by Gauss-Seidel iteration.

    :param cyclic: the nodes feed each other, or one feeds itself.
    :ivar newtons: matrices of Newton's method, whose factors serve for several steps.
    """

    def __init__(
        self, nodes: Sequence[Node], signals: Signals, bus: Bus, simulation: Simulation, *, cyclic: bool
    ) -> None:
        self.nodes = nodes
        self._names = ", ".join(node.name for node in nodes)
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
        self.newtons: list[Newton] = []
        depends, initially = simulation.depends, partial(simulation.depends, initially=True)
        self._equations: dict[Phase, _Equations] = {
            "step": self._prepare_equations("step", depends),
            "instant": self._prepare_equations("instant", depends),
            "initialization": self._prepare_equations("initialization", initially),
            "crossing": self._prepare_equations("crossing", depends),
        }

    def _prepare_equations(self, phase: Phase, depends: Depends) -> _Equations:
        cyclic, newton = self._cyclic and phase != "crossing", None
        if cyclic and self._implicit:
            newton = Newton(self.nodes, self._signals, self._unknowns, depends, within_steps=phase == "step")
            self.newtons.append(newton)
        calls, nodes = zip(*(node.program(phase) for node in self.nodes), strict=True)
        record = StrongComponentRecord(cyclic=cyclic, tolerance=self._tolerance, count=len(nodes))
        record.n, record.valued = len(self._unknowns), np.searchsorted(self._unknowns, self._signals.count)
        record.point(
            nodes=(NodeRecord * len(nodes))(*nodes), unknowns=self._unknowns, kinds=self._kinds, errors=self._errors
        )
        if newton is not None:
            record.point(newton=newton.record)
        return _Equations(record, calls, newton, nodes)

    def equations(self, phase: Phase) -> Record:
        """The equations of a phase, for compiled code."""
        return self._equations[phase].record

    def read_start_values(self) -> None:
        """Read the outputs of a cycle at the start values of its inputs, the first guess of the iteration."""
        for node in self.nodes if self._cyclic else ():
            node.read_outputs(self._signals.now)

    @property
    def source_node(self) -> Node | None:
        """The node of an FMU outside of cycles, without inputs, that takes steps of any size; else None."""
        first = self.nodes[0]
        return None if self._cyclic or first.inputs or not first.part.fmu.variable_step else first

    def raise_failure(self, phase: Phase, failure: Any, status: int) -> None:
        """Raise the error of equations that compiled code has not solved.

        :raises SimulationError: naming the FMU and its status, or those that do not converge.
        """
        equations = self._equations[phase]
        if status == DIVERGED:
            self._raise_divergence()
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
            raise SimulationError(
                f"{self._names}: what they exchange at t = {self._bus.end.value:.10g} s has no unique "
                "solution, as with a body that carries itself or two that prescribe each other: change the connections"
            ) from None

    def _raise_divergence(self) -> NoReturn:
        worst = int(self._unknowns[int(np.argmax(self._errors))]) % self._signals.count
        signal = ".".join(self._signals.references[worst])
        sticking = [f"{n.name}.{name}" for n in self.nodes for name in n.part.fmu.variables if name.endswith("_sticks")]
        if self._implicit and self._bus.size.value == 0:  # contacts that choose by each other may have no agreement
            cure = "give other start values, or make one FMU of the system by flatten()"
        elif self._implicit:
            cure = "choose a smaller step_size"
        elif sticking:
            mass = f"where {', '.join(sticking)} it pushes back with its mass, and must be lighter than what moves it"
            cure = f"{mass}: choose coupling='implicit'"
        else:
            cure = "choose a smaller step_size, or coupling='implicit'"
        raise RefusedError(
            f"{self._names}: what they exchange does not converge at t = {self._bus.end.value:.10g} s, {signal} "
            f"least of all, after {_MOST_ITERATIONS} iterations: {cure}"
        )
