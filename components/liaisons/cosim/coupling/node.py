"""One FMU in a coupled step: taken back, given the motion of its inputs, stepped, read."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import as_indices
from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import Call, call_records
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.records import AS_SET, AT_INSTANTS, MEAN, POLYNOMIAL, NodeRecord
from liaisons.cosim.coupling.signals import HIGHEST, Signals, polynomial_arrays
from liaisons.cosim.instances.protocol import INTERMEDIATE_INSTANTS, Instance
from liaisons.cosim.structure.components import InputInterface, Port, SystemComponent
from liaisons.cosim.structure.schedule import Depends
from liaisons.cosim.structures import Record

_TIMES = np.arange(1, INTERMEDIATE_INSTANTS + 1) / INTERMEDIATE_INSTANTS
"""Instants at which an FMU asks for inputs inside a step of length 1."""
INSIDE = np.array([_TIMES**order / math.factorial(order) for order in range(1, HIGHEST + 1)])
"""Factors of the derivatives in the values at these instants, shape (HIGHEST, INTERMEDIATE_INSTANTS)."""

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
        inputs, outputs, variables = bus.inputs[self.name], bus.connected_outputs[self.name], part.fmu.variables
        self.inputs = [variables[name] for _, name in inputs]
        self.outputs = [variables[name] for _, name in outputs]
        self.curves = [signals.curve(input_, cycle) for input_ in inputs]
        self.sources = as_indices([c.data[c.order] for c in self.curves])
        self.rates = as_indices([c.rate for c in self.curves])
        first = signals.index[outputs[0]] if outputs else 0
        self.values = slice(first, first + len(outputs))
        self.slopes = slice(signals.count + first, signals.count + first + len(outputs))
        self.sloped = bool(outputs) and self.name in signals.sloped

        self._repeated = bool(cycle)
        self._roots = as_indices([signals.port_value_index(input_, cycle) for input_ in inputs])
        self._set_values, self._read = bus.view(inputs), bus.view(outputs)
        self._put = [instance.setter(self.inputs, self._set_values)] if inputs else []
        self._get = [instance.getter(self.outputs, self._read)] if outputs else []
        self._slope_values, self._rate_values = np.zeros(len(outputs)), np.zeros(len(inputs))
        read_slopes = self._prepare_output_derivatives()
        moves_as_set = prescribed or part.fmu.has_sampled_outputs  # which reads inputs at communication points
        interface = None if moves_as_set else part.approximation.interface
        self.polynomials: list[Polynomial] = [self._polynomial(k, interface) for k in range(len(inputs))]
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
        if interface == "end value":  # the FMU interpolates itself
            return "port" if is_port and Port(self.part, self.inputs[k].name).motion_and_order()[0] else "line"
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
        variables = [self.inputs[k] for k, _ in inputs_and_orders]
        orders = [order for _, order in inputs_and_orders]
        return self._instance.input_derivatives(variables, orders, values)

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
