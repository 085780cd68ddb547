"""One FMU in a coupled step: taken back, given the motion of its inputs, stepped, read."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from ctypes import Array, c_double
from itertools import pairwise
from typing import final

import numpy as np

from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.polynomials import HIGHEST, Polynomials, polynomials, powers
from liaisons.cosim.coupling.records import ASKED as AT_INSTANTS
from liaisons.cosim.coupling.records import MEAN, POLYNOMIAL, NodeRecord, records
from liaisons.cosim.coupling.signals import Indices, Signals, Vector
from liaisons.cosim.instances.protocol import ASKED, Instance
from liaisons.cosim.structure.components import Port, SystemComponent, Way
from liaisons.cosim.structure.schedule import Depends, VariableReference

_TIMES = np.arange(1, ASKED + 1) / ASKED
"""Where it asks for inputs inside a step of length 1."""
INSIDE = np.array([_TIMES**order / math.factorial(order) for order in range(1, HIGHEST + 1)])
"""What a derivative adds to the value at each of these, shape (HIGHEST, ASKED)."""


@final
class Node:
    """One FMU in a coupled step.

    :param cycle: those that it is solved together with, itself among them; empty if it is outside of cycles.
    :param alone: it is not told how its inputs move.
    """

    def __init__(
        self,
        part: SystemComponent,
        instance: Instance,
        bus: Bus,
        signals: Signals,
        cycle: Collection[str],
        *,
        alone: bool = False,
    ) -> None:
        self.name = part.name
        self.part = part
        self._instance = instance
        self._bus = bus
        self._signals = signals
        inputs, outputs, variables = bus.inputs[self.name], bus.outputs(self.name, every=False), part.fmu.variables
        self.inputs = [variables[name] for _, name in inputs]
        self.outputs = [variables[name] for _, name in outputs]
        self.curves = [signals.curve(place, cycle) for place in inputs]
        self.sources: Indices = np.array([c.data[c.order] for c in self.curves], dtype=np.intp)
        self.rates: Indices = np.array([c.rate for c in self.curves], dtype=np.intp)
        first = signals.index[outputs[0]] if outputs else 0
        self.values = slice(first, first + len(outputs))
        self.slopes = slice(signals.count + first, signals.count + first + len(outputs))
        self.sloped = bool(outputs) and self.name in signals.sloped

        self._way: Way | None = None if alone else part.way
        self._roots: Indices = np.array([signals.root(place, cycle) for place in inputs], dtype=np.intp)
        self._set_values, self._set = _buffer(len(inputs), bus.buffer(inputs) if inputs else None)
        self._read, buffer = _buffer(len(outputs), bus.buffer(outputs) if outputs else None)
        self._get: list[Call] = [instance.getter(self.outputs, buffer)] if outputs else []
        self._put: list[Call] = [instance.setter(self.inputs, self._set)] if inputs else []
        self._match: list[Call] = [*self._put, *self._get]
        self._slope_values = np.zeros(len(outputs))
        self.slopes_at: dict[VariableReference, int] = {}  # on the bus
        self._incline = self._inclination()
        self.gains: dict[
            tuple[VariableReference, VariableReference], int
        ] = {}  # output and input -> where the derivative is on the bus
        before, stepper = self._before(), instance.stepper(bus.start, bus.size)
        self._go_on: list[Call] = [*before, stepper, *self._get]
        first_calls = [*before, stepper, *self._after()]
        self._first: list[Call] = first_calls
        self._again: list[Call] = []
        if cycle:
            save, restore = instance.states()
            self._first = [save, *first_calls]
            self._again = [restore, *first_calls]

    def _before(self) -> list[Call]:
        self._polynomials: Polynomials | None = None
        self._middle: Vector | None = None
        if self._way is None:
            return []
        if not self.inputs or self._way == "interpolate":
            return self._put
        if self._way == "mean":
            self._middle, buffer = _buffer(len(self.inputs))
            return [self._instance.setter(self.inputs, buffer)]
        highest = HIGHEST if self.part.takes_curves else 1
        self._polynomials = polynomials(self.curves, self._signals.zero + 1, highest)
        which = self._polynomials.which
        known = [(*self.curves[k].data[self.curves[k].order :], *[self._signals.zero] * HIGHEST) for k, _ in which]
        self._begun: Indices = np.array([d[order] for d, (_, order) in zip(known, which, strict=True)], dtype=np.intp)
        self._of: Indices = np.array([k for k, _ in which], dtype=np.intp)
        if self._way == "asked":
            self._inside = np.empty((ASKED, len(self.inputs)))
            return [self._instance.intermediate_update(self.inputs, self._inside)]
        self._derivatives, tell = self.set_input_derivatives(which)
        return [tell]

    def _after(self) -> list[Call]:
        put = [] if self._way == "interpolate" else self._put
        return [*put, *self._get, *self._incline]

    def _inclination(self) -> list[Call]:
        """Tell how fast the inputs change, and read how fast the outputs do."""
        if not self.sloped:
            return []
        first, self._slope_values, buffer = self._bus.room(len(self.outputs))
        self.slopes_at = {(self.name, output.name): first + k for k, output in enumerate(self.outputs)}
        read = self._instance.output_derivatives(self.outputs, [1] * len(self.outputs), buffer)
        if not self.inputs:
            return [read]
        if self._way == "asked":
            return [read, self._along_inputs()]
        self._rate_values, tell = self.set_input_derivatives([(k, 1) for k in range(len(self.inputs))])
        return [tell, read]

    def _along_inputs(self) -> Call:
        """A call that adds to the slopes of outputs what comes from rates of inputs that the FMU does not know.

        By itself it takes the rates of an active coordinate from its port, and other inputs for constant.
        """
        self._rate_values, seed = _buffer(len(self.inputs))
        part, values = _buffer(len(self.outputs))
        curves = (Port(self.part, variable.name).curve() for variable in self.inputs)
        holds = self.part.reconstruction == 0
        unknown = np.array([holds or triple is None or order == 2 for triple, order in curves])
        derive = self._instance.directional(self.outputs, self.inputs, seed, values)

        def add() -> int | None:
            self._rate_values *= unknown
            status = derive()
            self._slope_values += part
            return status

        return Call(add).of("derive", self._instance.failure)

    def set_input_derivatives(self, which: Sequence[tuple[int, int]]) -> tuple[Vector, Call]:
        """A call that sets derivatives of inputs, (input, order) each, and the numbers that it takes."""
        values, buffer = _buffer(len(which))
        variables, orders = [self.inputs[k] for k, _ in which], [order for _, order in which]
        return values, self._instance.input_derivatives(variables, orders, buffer)

    @property
    def order(self) -> int:
        """Order of the error in H that the motion of its inputs within a step leads to."""
        if self._way is None:
            return 1
        if self._way == "interpolate":  # by itself: triples quintic, others linear
            return min((6 if len(curve.data) == 3 else 2 for curve in self.curves), default=6)
        if self._way in {"polynomial", "asked"} and self.part.takes_curves:
            return min((2 * len(curve.data) for curve in self.curves), default=6)
        return 2 if self.inputs else 6

    def step(self, *, again: bool) -> None:
        """From t to t + H, with what the inputs are at both ends; ``again``: from t once more."""
        ends, size = self._signals.ends, self._bus.size.value
        if self.inputs:
            self._hand_over()
            held = self._signals.held[self._roots]
            if self._polynomials is not None:
                derivatives = self._polynomials(ends.reshape(-1), size)
                if held.any():
                    derivatives = np.where(held[self._of], ends[0, self._begun], derivatives)
                self._tell(derivatives, size)
            elif self._middle is not None:
                begin, end = ends[:, self.sources]
                self._middle[:] = np.where(held, begin, (begin + end) / 2)
        self._bus.perform(self._again if again else self._first)

    def go_on(self) -> None:
        """Step, and read, while inputs go on as they were known at t; what interpolates ends with what they are now."""
        if self.inputs:
            self._hand_over()
        if self._polynomials is not None:
            self._tell(self._signals.before[self._begun], self._bus.size.value)
        elif self._middle is not None:
            self._middle[:] = self._signals.before[self.sources]
        self._bus.perform(self._go_on)

    def _tell(self, derivatives: Vector, size: float) -> None:
        """Put where the FMU takes it how inputs move from t on."""
        if self._way == "polynomial":
            self._derivatives[:] = derivatives
            return
        self._inside[:] = self._signals.before[self.sources]
        rows = derivatives.reshape(-1, HIGHEST) * powers(size)[1 : HIGHEST + 1]
        for row, factors in zip(rows.T, INSIDE, strict=True):
            self._inside += np.outer(factors, row)

    def step_in_thirds(self) -> Vector:
        """The same where nothing feeds it; returns what its outputs were on the way, shape (2, outputs)."""
        bus, found = self._bus, []
        start, size, end = bus.start.value, bus.size.value, bus.end.value
        points = [start, start + size / 3, start + 2 * size / 3, end]
        for here, there in pairwise(points):
            bus.turn(here, there)
            bus.perform(self._first)
            found.append(self._read.copy())
        bus.turn(start, end)
        return np.array(found[:2])

    def record(self) -> NodeRecord:
        """The same, for compiled code."""
        self.calls = calls = [*self._first[: bool(self._again)], *(self._again or self._first)]
        record = NodeRecord(
            repeated=bool(self._again),
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
        if self._middle is not None:
            record.way = MEAN
            record.point(shape=self._middle)
        if (curves := self._polynomials) is not None:
            record.derivatives, record.terms = curves.terms.shape
            record.known = len(curves.known)
            record.point(signals=curves.known, scaling=curves.scaling, after=curves.after)
            record.point(term=curves.terms, factors=curves.factors, begun=self._begun, of=self._of)
            record.way = POLYNOMIAL if self._way == "polynomial" else AT_INSTANTS
            record.point(shape=self._derivatives if self._way == "polynomial" else self._inside)
        return record

    def reset(self) -> None:
        """Forget everything."""
        self._slope_values[:] = 0.0

    def read(self) -> None:
        """Read the outputs as they are."""
        self._bus.perform(self._get)

    def match(self, *, initial: bool) -> None:
        """Read the outputs at the present instant; in initialization, of the present inputs."""
        if self.inputs:
            self._hand_over()
        self._bus.perform(self._match if initial or self._way != "interpolate" else self._get)

    def read_output_derivatives(self) -> None:
        """Read the slopes of the outputs at the present instant."""
        if self.inputs:
            self._hand_over()
        self._bus.perform(self._incline)

    def collect(self, target: Vector) -> None:
        """Put what was read last where the signals stand."""
        target[self.values] = self._read
        if self.sloped:
            target[self.slopes] = self._slope_values

    def _hand_over(self) -> None:
        now = self._signals.now
        self._set_values[:] = now[self.sources]
        if self.sloped:
            self._rate_values[:] = now[self.rates]

    def derivatives(self, depends: Depends, *, record: bool) -> tuple[list[tuple[int, int]], list[Call], list[Vector]]:
        """∂(outputs)/∂(inputs) that are not 0, column by column.

        :param record: they are recorded, where :attr:`gains` says.
        :returns: (output, input), their places among those of the member, of each; the calls that calculate them at
            the present instant, and where those put them.
        """
        pairs: list[tuple[int, int]] = []
        calls: list[Call] = []
        values: list[Vector] = []
        for k, known in enumerate(self.inputs if self.part.fmu.provides_directional_derivatives else ()):
            rows = [i for i, o in enumerate(self.outputs) if depends((self.name, o.name), (self.name, known.name))]
            if rows:
                first, column, buffer = self._bus.room(len(rows)) if record else (0, *_buffer(len(rows)))
                if record:
                    of = (self.name, known.name)
                    self.gains |= {((self.name, self.outputs[i].name), of): first + j for j, i in enumerate(rows)}
                calls.append(self._instance.directional([self.outputs[i] for i in rows], [known], _ALONG, buffer))
                values.append(column)
                pairs += [(i, k) for i in rows]
        return pairs, list(self._instance.together(calls)), values


_ALONG = (c_double * 1)(1.0)
"""The direction of one input."""


def _buffer(size: int, buffer: Array[c_double] | None = None) -> tuple[Vector, Array[c_double]]:
    """Numbers as NumPy and as foreign functions see them."""
    buffer = (c_double * size)() if buffer is None else buffer
    return np.ctypeslib.as_array(buffer), buffer
