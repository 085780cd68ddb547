"""A strong component of the connection graph: FMUs that feed each other in a cycle, or one FMU outside of cycles.

A node is one FMU in a coupled step: taken back, given the motion of its inputs, stepped, read.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise, repeat
from typing import Any, Literal, NoReturn, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import as_indices
from liaisons.cosim.compiled.calls import RAISED, Call, Indices, Record, Vector, call_records
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.elimination import Elimination
from liaisons.cosim.coupling.records import (
    AS_SET,
    AT_INSTANTS,
    DIVERGED,
    MEAN,
    POLYNOMIAL,
    NewtonRecord,
    NodeRecord,
    StrongComponentRecord,
)
from liaisons.cosim.coupling.signals import HIGHEST, Curve, Signals, polynomial_arrays
from liaisons.cosim.instances.protocol import INTERMEDIATE_INSTANTS, Instance
from liaisons.cosim.structure.components import InputInterface, Port, SystemComponent
from liaisons.cosim.structure.schedule import Depends
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import RefusedError, SimulationError

_TIMES = np.arange(1, INTERMEDIATE_INSTANTS + 1) / INTERMEDIATE_INSTANTS
"""Instants at which an FMU asks for inputs inside a step of length 1."""
INSIDE = np.array([_TIMES**order / math.factorial(order) for order in range(1, HIGHEST + 1)])
"""Factors of the derivatives in the values at these instants, shape (HIGHEST, INTERMEDIATE_INSTANTS)."""
_MOST_ITERATIONS = 100  # as in coupling.c

Phase = Literal["initialization", "instant", "crossing", "step"]
"""Phase of an evaluation: initialization, an instant between steps, the tiny step to a break, another step."""


@final
@dataclass(frozen=True)
class InputMotionCalls:
    """The calls by which an FMU receives the motion of its inputs within a step.

    :param kind: numbers that compiled code writes before the step.
    :param before: calls before the step.
    :param after: calls after it.
    :param arrays: those of compiled code; it writes to ``shape``, and see :func:`polynomial_arrays`.
    """

    kind: int
    before: Sequence[Call]
    after: Sequence[Call]
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)


Polynomial = Literal["as set", "mean", "line", "points", "slopes", "port"]
"""Polynomial that an input follows within a step: the FMU's own, from values at communication points; the mean of both
ends; the line between them; the cubic through four points; that through values and slopes at both ends; the quintic
through values, rates and accelerations of a port."""

_ERROR_ORDERS: Mapping[Polynomial, int] = {"as set": 1, "mean": 2, "line": 2, "points": 4, "slopes": 4, "port": 6}
"""Order in H of the error of each."""


def interpolation_to_end(input_: Port, *, is_fed_by_port: bool) -> Polynomial:
    """Polynomial of an input that an FMU interpolates by itself, from values at both ends of a step."""
    return "port" if is_fed_by_port and input_.motion_and_order()[0] else "line"


@final
class Node:
    """One FMU in a coupled step.

    The calls of an evaluation, in their order:

    ==================  ====================================================================================
    initialization      set inputs, get outputs
    instant             set inputs, get outputs, get slopes
    step to a break     hand over the motion of inputs, step, get outputs
    step                in a cycle restore the state; motion, step, set inputs at the end, get outputs, slopes
    ==================  ====================================================================================

    The motion of inputs, by the interface of the FMU:

    =====================  =====================================  ========================
    interface              before the step                        after the step
    =====================  =====================================  ========================
    derivatives            set derivatives at t                   set inputs at t + H
    intermediate update    prepare values for when they are read  set inputs at t + H
    mean value             set means                              set inputs at t + H
    end value              set inputs at t + H                    (the FMU interpolates)
    none, as prescribed                                           set inputs at t + H
    =====================  =====================================  ========================

    :param cycle: components that are solved together with it, itself among them; empty outside of cycles.
    :param prescribed: its inputs hold or extrapolate, as the user has said.
    :ivar polynomials: those that its inputs follow, whoever asks.
    :ivar error_order: order in H of the error of the coarsest of them.
    """

    def __init__(
        self,
        part: SystemComponent,
        instance: Instance,
        bus: Bus,
        signals: Signals,
        cycle: Collection[str],
        *,
        prescribed: bool = False,
    ) -> None:
        self.name, self.part = part.name, part
        self._instance, self._bus, self._signals = instance, bus, signals
        inputs, outputs = bus.inputs[self.name], bus.connected_outputs[self.name]
        self.inputs, self.outputs = part.scalars(inputs), part.scalars(outputs)
        self.curves = [*map(signals.curve, inputs, repeat(cycle))]
        self.sources, self.rates = np.empty((2, len(inputs)), dtype=np.intp)
        for k, curve in enumerate(self.curves):
            self.sources[k], self.rates[k] = curve.data[curve.order], curve.rate
        first = signals.index[outputs[0]] if outputs else 0
        self.values = slice(first, first + len(outputs))
        self.slopes = slice(signals.count + first, signals.count + first + len(outputs))
        self.sloped = bool(outputs) and self.name in signals.sloped

        self._repeated = bool(cycle)
        self._roots = as_indices([*map(signals.port_value_index, inputs, repeat(cycle))])
        self._set_values, self._read = bus.view(inputs), bus.view(outputs)
        self._put = [instance.setter(self.inputs, self._set_values)] if inputs else []
        self._get = [instance.getter(self.outputs, self._read)] if outputs else []
        self._slope_values, self._rate_values = np.zeros(len(outputs)), np.zeros(len(inputs))
        read_slopes = self._prepare_output_derivatives()
        moves_as_set = prescribed or part.fmu.has_sampled_outputs  # which reads inputs at communication points
        interface = None if moves_as_set else part.approximation.interface
        self.polynomials: list[Polynomial] = [*map(partial(self._polynomial, interface=interface), range(len(inputs)))]
        self._motion = motion = self._input_motion_calls(interface)
        orders = map(_ERROR_ORDERS.__getitem__, self.polynomials)
        self.error_order = 1 if interface is None else min(orders, default=6)
        move = [*motion.before, instance.stepper(bus.start, bus.size)]
        self._step: list[Call] = [*move, *motion.after, *self._get, *read_slopes]
        self._calls: dict[Phase, list[Call]] = {
            "initialization": [*self._put, *self._get],
            "instant": [*motion.after, *self._get, *read_slopes],
            "crossing": [*move, *self._get],
            "step": [*instance.save_and_restore_calls(), *self._step] if cycle else self._step,
        }

    def _polynomial(self, k: int, interface: InputInterface | None) -> Polynomial:
        """The polynomial of the k-th input, by the interface and what is known of its source."""
        data, signals = self.curves[k].data, self._signals
        if interface is None:
            return "as set"
        if interface == "mean value":
            return "mean"
        is_port = len(data) == 3
        if interface == "end value":
            return interpolation_to_end(Port(self.part, self.inputs[k].name), is_fed_by_port=is_port)
        if not self.part.approximation.takes_every_order or len(data) == 1:
            return "line"
        return "port" if is_port else "slopes" if signals.references[data[0]][0] in signals.sloped else "points"

    def _input_motion_calls(self, interface: InputInterface | None) -> InputMotionCalls:
        """Prepare the calls that hand over the motion of inputs; None: they move as the user has prescribed."""
        instance, inputs, put = self._instance, self.inputs, self._put
        if interface is None:
            return InputMotionCalls(AS_SET, [], put)
        if interface == "end value":
            return InputMotionCalls(AS_SET, put, [])
        if not inputs:
            return InputMotionCalls(AS_SET, [], [])
        if interface == "mean value":
            means = np.empty(len(inputs))
            return InputMotionCalls(MEAN, [instance.setter(inputs, means)], put, {"shape": means})
        highest = HIGHEST if self.part.approximation.takes_every_order else 1
        terms, arrays = polynomial_arrays(self.curves, self._signals.zero, highest)
        if interface == "intermediate update":
            values = np.empty((INTERMEDIATE_INSTANTS, len(inputs)))
            update = instance.prepare_intermediate_inputs(inputs, values)
            return InputMotionCalls(AT_INSTANTS, [update], put, {"shape": values, **arrays})
        derivatives = np.empty(len(terms))
        set_derivatives = self._input_derivatives_call(terms, derivatives)
        return InputMotionCalls(POLYNOMIAL, [set_derivatives], put, {"shape": derivatives, **arrays})

    def _prepare_output_derivatives(self) -> list[Call]:
        """Prepare the calls that set the rates of inputs and read those of outputs."""
        if not self.sloped:
            return []
        self._slope_values = self._bus.add_slopes(self._bus.connected_outputs[self.name])
        read = self._instance.output_derivatives(self.outputs, [1] * len(self.outputs), self._slope_values)
        if not self.inputs:
            return [read]
        if self.part.approximation.interface == "intermediate update":
            return [read, self._feedthrough_slopes_call()]
        return [self._input_derivatives_call([(k, 1) for k in range(len(self.inputs))], self._rate_values), read]

    def _feedthrough_slopes_call(self) -> Call:
        """A call that adds ∂(outputs)/∂(inputs) times rates of inputs to the slopes.

        It omits the rates that the FMU adds itself, those of active coordinates; other inputs it takes for constant.
        """
        product = np.empty(len(self.outputs))
        curves = (Port(self.part, variable.name).motion_and_order() for variable in self.inputs)
        holds = self.part.approximation.method == 0
        unknown = np.array([holds or triple is None or order == 2 for triple, order in curves])
        derive = self._instance.directional_derivatives(self.outputs, self.inputs, self._rate_values, product)

        def add_feedthrough() -> int | None:
            self._rate_values *= unknown
            status = derive()
            self._slope_values += product
            return status

        return self._instance.prepare_call("derive", add_feedthrough)

    def _input_derivatives_call(self, inputs_and_orders: Sequence[tuple[int, int]], values: Vector) -> Call:
        """A call that sets derivatives of inputs, of some order each, to values."""
        numbers, orders = zip(*inputs_and_orders, strict=True)
        return self._instance.input_derivatives([*map(self.inputs.__getitem__, numbers)], orders, values)

    def step_in_thirds(self) -> Vector:
        """Make the step in thirds, without inputs; returns the outputs inside it, shape (2, outputs)."""
        bus, outputs = self._bus, []
        start, size, end = bus.start.value, bus.size.value, bus.end.value
        for first, last in pairwise([start, start + size / 3, start + 2 * size / 3, end]):
            bus.set_step(first, last)
            bus.perform(self._step)
            outputs.append(self._read.copy())
        bus.set_step(start, end)
        return np.array(outputs[:2])

    def program(self, phase: Phase) -> tuple[list[Call], Record]:
        """The calls of one evaluation in a phase, and their record for compiled code."""
        calls = self._calls[phase]
        record = NodeRecord(
            repeated=self._repeated and phase == "step",
            sloped=self.sloped,
            count=len(calls),
            inputs=len(self.inputs),
            outputs=len(self.outputs),
            value=self.values.start,
            slope=self.slopes.start,
        )
        record.point(calls=call_records(calls), sources=self.sources, roots=self._roots, set_values=self._set_values)
        record.point(read=self._read, slopes=self._slope_values, rates=self.rates, rate_values=self._rate_values)
        if phase in {"initialization", "instant"}:
            return calls, record
        record.approximation, arrays = self._motion.kind, self._motion.arrays
        record.point(**arrays)
        if "term" in arrays:
            record.derivatives, record.terms = arrays["term"].shape
            record.data = len(arrays["signals"])
        return calls, record

    def read_outputs(self, signals: Vector) -> None:
        """Read the present outputs from the FMU, and copy them to the signals."""
        self._bus.perform(self._get)
        self.copy_outputs(signals)

    def copy_outputs(self, signals: Vector) -> None:
        """Copy the outputs that were read last to the signals."""
        signals[self.values] = self._read

    def prepare_gains(self, depends: Depends, *, record: bool) -> Iterator[tuple[int, list[int], Call, Vector]]:
        """Prepare the calls that calculate ∂(outputs)/∂(inputs), where these are not 0 everywhere.

        :param record: the derivatives are on the bus.
        :returns: number of the input, numbers of the outputs, the call, and the derivatives, which it writes.
        """
        for k, input_ in enumerate(self.inputs if self.part.fmu.provides_directional_derivatives else ()):
            rows = [i for i, o in enumerate(self.outputs) if depends((self.name, o.name), (self.name, input_.name))]
            if rows:
                outputs, column = [self.outputs[i] for i in rows], np.empty(len(rows))
                if record:
                    column = self._bus.add_gains([(self.name, o.name) for o in outputs], (self.name, input_.name))
                yield k, rows, self._instance.directional_derivatives(outputs, [input_], np.ones(1), column), column


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
        self._signals = signals
        self._bus = bus
        self._cyclic = cyclic
        self._tolerance = simulation.interface_tolerance
        fed, own = set[int](), set[int]()
        for node in nodes:
            for curve in node.curves:
                fed.update(curve.data, [curve.rate])
            for part in (node.values, *[node.slopes] * node.sloped):
                own.update(range(part.start, part.stop))
        self._unknowns = as_indices(sorted((fed & own) - {signals.zero}))
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
        calls, nodes = zip(*map(partial(Node.program, phase=phase), self.nodes), strict=True)
        record = StrongComponentRecord(cyclic=cyclic, tolerance=self._tolerance, count=len(nodes))
        record.n, record.valued = len(self._unknowns), np.searchsorted(self._unknowns, self._signals.count)
        record.point(
            nodes=(NodeRecord * len(nodes))(*nodes), unknowns=self._unknowns, kinds=self._kinds, errors=self._errors
        )
        if newton is not None:
            record.point(newton=newton.record)
        return _Equations(record, calls, newton, nodes)

    @property
    def _names(self) -> str:
        return ", ".join(node.name for node in self.nodes)

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
