"""One FMU in a coupled step: taken back, given the motion of its inputs, stepped, read."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from ctypes import Array, c_double
from itertools import pairwise
from typing import Literal, final

import numpy as np

from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.polynomials import HIGHEST, polynomials
from liaisons.cosim.coupling.records import AS_SET, AT_INSTANTS, MEAN, POLYNOMIAL, NodeRecord, records
from liaisons.cosim.coupling.signals import Indices, Signals, Vector
from liaisons.cosim.instances.protocol import INTERMEDIATE_INSTANTS, Instance
from liaisons.cosim.structure.components import Port, SystemComponent
from liaisons.cosim.structure.schedule import Depends, VariableReference

_TIMES = np.arange(1, INTERMEDIATE_INSTANTS + 1) / INTERMEDIATE_INSTANTS
"""Instants at which an FMU asks for inputs inside a step of length 1."""
INSIDE = np.array([_TIMES**order / math.factorial(order) for order in range(1, HIGHEST + 1)])
"""Factors of the derivatives in the values at these instants, shape (HIGHEST, INTERMEDIATE_INSTANTS)."""

Phase = Literal["initialization", "instant", "crossing", "step"]
"""Phase of an evaluation: initialization, an instant between steps, the tiny step to a break, another step."""


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

    The motion of inputs, by the interface of the FMU: ``"derivatives"`` are set before the step; ``"intermediate
    update"`` has values ready for when they are asked for; ``"mean value"`` is set and held; ``"end value"`` is set
    before the step and not after it, since the FMU interpolates by itself.

    :param cycle: those that it is solved together with, itself among them; empty if it is outside of cycles.
    :param prescribed: its inputs hold or extrapolate, as the user has said.
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
        self.name = part.name
        self.part = part
        self._instance = instance
        self._bus = bus
        self._signals = signals
        inputs, outputs, variables = bus.inputs[self.name], bus.outputs(self.name, every=False), part.fmu.variables
        self.inputs = [variables[name] for _, name in inputs]
        self.outputs = [variables[name] for _, name in outputs]
        self.curves = [signals.curve(input_, cycle) for input_ in inputs]
        self.sources: Indices = np.array([c.data[c.order] for c in self.curves], dtype=np.intp)
        self.rates: Indices = np.array([c.rate for c in self.curves], dtype=np.intp)
        first = signals.index[outputs[0]] if outputs else 0
        self.values = slice(first, first + len(outputs))
        self.slopes = slice(signals.count + first, signals.count + first + len(outputs))
        self.sloped = bool(outputs) and self.name in signals.sloped

        self._interface = None if prescribed else part.approximation.interface
        self._roots: Indices = np.array([signals.root(input_, cycle) for input_ in inputs], dtype=np.intp)
        self._set_values, buffer = _buffer(len(inputs), bus.buffer(inputs) if inputs else None)
        self._put: list[Call] = [instance.setter(self.inputs, buffer)] if inputs else []
        self._read, buffer = _buffer(len(outputs), bus.buffer(outputs) if outputs else None)
        self._get: list[Call] = [instance.getter(self.outputs, buffer)] if outputs else []
        self._slope_values = np.zeros(len(outputs))
        self.slopes_at: dict[VariableReference, int] = {}  # on the bus
        read_slopes = self._read_output_derivatives()
        self.gains: dict[
            tuple[VariableReference, VariableReference], int
        ] = {}  # output and input -> where the derivative is on the bus
        put = [] if self._interface == "end value" else self._put
        move = [*self._reconstruct_inputs(), instance.stepper(bus.start, bus.size)]
        self._step: list[Call] = [*move, *put, *self._get, *read_slopes]
        self._repeated = bool(cycle)
        self._calls: dict[Phase, list[Call]] = {
            "initialization": [*self._put, *self._get],
            "instant": [*put, *self._get, *read_slopes],
            "crossing": [*move, *self._get],
            "step": [*instance.states(), *self._step] if cycle else self._step,
        }

    def _reconstruct_inputs(self) -> list[Call]:
        """Calls before a step that hand over the motion of inputs within it, as the interface of the FMU takes it."""
        self._reconstruction, self._polynomials, self._shape = AS_SET, None, np.empty(0)
        if self._interface is None:
            return []
        if not self.inputs or self._interface == "end value":
            return self._put
        if self._interface == "mean value":
            self._reconstruction = MEAN
            self._shape, buffer = _buffer(len(self.inputs))
            return [self._instance.setter(self.inputs, buffer)]
        highest = HIGHEST if self.part.approximation.takes_every_order else 1
        self._polynomials = polynomials(self.curves, self._signals.zero + 1, highest)
        if self._interface == "intermediate update":
            self._reconstruction, self._shape = AT_INSTANTS, np.empty((INTERMEDIATE_INSTANTS, len(self.inputs)))
            return [self._instance.intermediate_update(self.inputs, self._shape)]
        self._reconstruction = POLYNOMIAL
        self._shape, set_derivatives = self._set_input_derivatives(self._polynomials.which)
        return [set_derivatives]

    def _read_output_derivatives(self) -> list[Call]:
        """Calls that set the rates of inputs and read those of outputs."""
        if not self.sloped:
            return []
        first, self._slope_values, buffer = self._bus.room(len(self.outputs))
        self.slopes_at = {(self.name, output.name): first + k for k, output in enumerate(self.outputs)}
        read = self._instance.output_derivatives(self.outputs, [1] * len(self.outputs), buffer)
        if not self.inputs:
            return [read]
        if self._interface == "intermediate update":
            return [read, self._along_inputs()]
        self._rate_values, set_rates = self._set_input_derivatives([(k, 1) for k in range(len(self.inputs))])
        return [set_rates, read]

    def _along_inputs(self) -> Call:
        """A call that adds ∂(outputs)/∂(inputs) times the rates of inputs that the FMU does not know to the slopes.

        By itself it takes the rates of an active coordinate from its port, and other inputs for constant.
        """
        self._rate_values, seed = _buffer(len(self.inputs))
        part, values = _buffer(len(self.outputs))
        curves = (Port(self.part, variable.name).curve() for variable in self.inputs)
        holds = self.part.approximation.method == 0
        unknown = np.array([holds or triple is None or order == 2 for triple, order in curves])
        derive = self._instance.directional(self.outputs, self.inputs, seed, values)

        def add() -> int | None:
            self._rate_values *= unknown
            status = derive()
            self._slope_values += part
            return status

        return Call(add).with_failure("derive", self._instance.failure)

    def _set_input_derivatives(self, which: Sequence[tuple[int, int]]) -> tuple[Vector, Call]:
        """Numbers, and a call that sets these derivatives of inputs, (input, order) each, from them."""
        values, buffer = _buffer(len(which))
        variables, orders = [self.inputs[k] for k, _ in which], [order for _, order in which]
        return values, self._instance.input_derivatives(variables, orders, buffer)

    @property
    def order(self) -> int:
        """Order in H of the error that the polynomials of its inputs cause."""
        if self._interface is None:
            return 1
        if self._interface == "end value":  # by itself: triples quintic, others linear
            return min((6 if len(curve.data) == 3 else 2 for curve in self.curves), default=6)
        if self._interface != "mean value" and self.part.approximation.takes_every_order:
            return min((2 * len(curve.data) for curve in self.curves), default=6)
        return 2 if self.inputs else 6

    def step_in_thirds(self) -> Vector:
        """Step in three parts, without inputs; returns the outputs after the first two, shape (2, outputs)."""
        bus, outputs = self._bus, []
        start, size, end = bus.start.value, bus.size.value, bus.end.value
        for first, last in pairwise([start, start + size / 3, start + 2 * size / 3, end]):
            bus.set_step(first, last)
            bus.perform(self._step)
            outputs.append(self._read.copy())
        bus.set_step(start, end)
        return np.array(outputs[:2])

    def program(self, phase: Phase) -> tuple[list[Call], NodeRecord]:
        """The calls of one evaluation, and the structure that compiled code reads."""
        calls = self._calls[phase]
        record = NodeRecord(
            repeated=self._repeated and phase == "step",
            sloped=self.sloped,
            calls=records(calls),
            count=len(calls),
            inputs=len(self.inputs),
            outputs=len(self.outputs),
            value=self.values.start,
            slope=self.slopes.start,
        )
        record.point(sources=self.sources, roots=self._roots, set_values=self._set_values)
        record.point(read=self._read, slopes=self._slope_values)
        if self.sloped and self.inputs:
            record.point(rates=self.rates, rate_values=self._rate_values)
        if phase in {"initialization", "instant"}:
            return calls, record
        record.approximation = self._reconstruction
        record.point(shape=self._shape)
        if (curves := self._polynomials) is not None:
            record.derivatives, record.terms = curves.terms.shape
            record.data = len(curves.signals)
            record.point(signals=curves.signals, scaling=curves.scaling, after=curves.after)
            zeros = [self._signals.zero] * HIGHEST
            data = [(*curve.data[curve.order :], *zeros) for curve in self.curves]
            record.point(
                term=curves.terms,
                factors=curves.factors,
                begun=np.array([data[k][order] for k, order in curves.which], dtype=np.intp),
                of=np.array([k for k, _ in curves.which], dtype=np.intp),
            )
        return calls, record

    def reset(self) -> None:
        """Forget everything."""
        self._slope_values[:] = 0.0

    def read(self) -> None:
        """Read the outputs as they are."""
        self._bus.perform(self._get)

    def collect(self, target: Vector) -> None:
        """Copy what was read last to its signals."""
        target[self.values] = self._read
        if self.sloped:
            target[self.slopes] = self._slope_values

    def derivatives(self, depends: Depends, *, record: bool) -> tuple[list[tuple[int, int]], list[Call], list[Vector]]:
        """∂(outputs)/∂(inputs) that are not 0, column by column.

        :param record: they are recorded, where :attr:`gains` says.
        :returns: (output, input), their places among those of the member, of each; the calls that calculate them at
            the present instant, and where those put them.
        """
        pairs: list[tuple[int, int]] = []
        calls: list[Call] = []
        values: list[Vector] = []
        for k, input_ in enumerate(self.inputs if self.part.fmu.provides_directional_derivatives else ()):
            rows = [i for i, o in enumerate(self.outputs) if depends((self.name, o.name), (self.name, input_.name))]
            if rows:
                first, column, buffer = self._bus.room(len(rows)) if record else (0, *_buffer(len(rows)))
                if record:
                    for j, i in enumerate(rows):
                        self.gains[(self.name, self.outputs[i].name), (self.name, input_.name)] = first + j
                calls.append(self._instance.directional([self.outputs[i] for i in rows], [input_], _ALONG, buffer))
                values.append(column)
                pairs += [(i, k) for i in rows]
        return pairs, calls, values


_ALONG = (c_double * 1)(1.0)
"""The direction of one input."""


def _buffer(size: int, buffer: Array[c_double] | None = None) -> tuple[Vector, Array[c_double]]:
    """Numbers as NumPy and as foreign functions see them."""
    buffer = (c_double * size)() if buffer is None else buffer
    return np.ctypeslib.as_array(buffer), buffer
