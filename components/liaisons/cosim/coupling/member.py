"""One FMU in a coupled step: taken back, given the motion of its inputs, stepped, read."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from ctypes import Array, c_double
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.bus import Bus, Clock
from liaisons.cosim.calls import Call
from liaisons.cosim.coupling.polynomials import HIGHEST, Polynomials
from liaisons.cosim.coupling.signals import Indices, Signals, Vector
from liaisons.cosim.instances import AnyInstance
from liaisons.cosim.instances.fmi2 import Instance2
from liaisons.cosim.instances.fmi3 import ASKED, Instance3
from liaisons.cosim.messages import WARNING, Action
from liaisons.cosim.parts import Part, Port
from liaisons.cosim.schedule import Depends

Prepared = tuple[Action, Call]
Judge = Callable[[str, Action, int], None]
Way = Literal["polynomial", "asked", "interpolate", "mean"]
"""How inputs move within a step: as told before it or when asked, from what they were to what is set, or not at all."""

_TIMES = np.arange(1, ASKED + 1) / ASKED
"""Where it asks for inputs inside a step of length 1."""
_ORDERS = np.arange(1, HIGHEST + 1)
_POWERS = np.array([_TIMES**order / math.factorial(order) for order in range(1, HIGHEST + 1)])


def way(part: Part) -> Way:
    """How the inputs of a component can be made to move within a step."""
    if part.interpolates:
        return "interpolate"
    if part.asks:
        return "asked"
    return "polynomial" if part.fmu.input_derivatives else "mean"


@final
class Member:
    """One FMU in a coupled step.

    :param judge: is told what returned a status that is not 0.
    """

    def __init__(
        self,
        part: Part,
        instance: AnyInstance,
        bus: Bus,
        signals: Signals,
        *,
        judge: Judge,
        clock: Clock,
        repeated: bool,
    ) -> None:
        self.name = part.name
        self.part = part
        self._instance = instance
        self._judge = judge
        self._signals = signals
        self._size = clock.size
        inputs, outputs, variables = bus.inputs[self.name], bus.outputs(self.name, every=False), part.fmu.variables
        self.inputs = [variables[name] for _, name in inputs]
        self.outputs = [variables[name] for _, name in outputs]
        self.curves = [signals.curve(place) for place in inputs]
        self.sources: Indices = np.array([c.data[c.order] for c in self.curves], dtype=np.intp)
        self.rates: Indices = np.array([c.rate for c in self.curves], dtype=np.intp)
        first = signals.index[outputs[0]] if outputs else 0
        self.values = slice(first, first + len(outputs))
        self.slopes = slice(signals.count + first, signals.count + first + len(outputs))
        self.sloped = bool(outputs) and self.name in signals.sloped

        self._way: Way = way(part)
        self._set_values, self._set = _buffer(len(inputs), bus.buffer(inputs) if inputs else None)
        self._read, buffer = _buffer(len(outputs), bus.buffer(outputs) if outputs else None)
        self._get: list[Prepared] = [("get", instance.getter(self.outputs, buffer))] if outputs else []
        self._put: list[Prepared] = [("set", instance.setter(self.inputs, self._set))] if inputs else []
        self._match: list[Prepared] = [*self._put, *self._get]
        self._slope_values = np.empty(len(outputs))
        self._incline = self._inclination()
        first_calls = [*self._before(), ("step", instance.stepper(clock.start, clock.size)), *self._after()]
        self._first: list[Prepared] = first_calls
        self._again: list[Prepared] = []
        if repeated:
            save, restore = instance.states()
            self._first = [("save", save), *first_calls]
            self._again = [("restore", restore), *first_calls]

    def _before(self) -> list[Prepared]:
        self._polynomials: Polynomials | None = None
        self._middle: Vector | None = None
        if not self.inputs or self._way == "interpolate":
            return self._put
        if self._way == "mean":
            self._middle, buffer = _buffer(len(self.inputs))
            return [("set", self._instance.setter(self.inputs, buffer))]
        highest = 1 if self.part.reconstruction is None else HIGHEST
        self._polynomials = Polynomials(self.curves, self._signals.zero + 1, highest)
        if self._way == "asked":
            assert isinstance(self._instance, Instance3)
            self._inside = np.empty((ASKED, len(self.inputs)))
            return [("set", self._instance.guide(self.inputs, self._inside))]
        self._derivatives, tell = self._telling(self._polynomials.which)
        return [tell]

    def _after(self) -> list[Prepared]:
        put = [] if self._way == "interpolate" else self._put
        return [*put, *self._get, *self._incline]

    def _inclination(self) -> list[Prepared]:
        """Tell how fast the inputs change, and read how fast the outputs do."""
        if not self.sloped:
            return []
        self._slope_values, buffer = _buffer(len(self.outputs))
        read = self._instance.output_derivatives(self.outputs, [1] * len(self.outputs), buffer)
        if not self.inputs:
            return [("slope", read)]
        if self._way == "asked":
            return [("slope", read), ("derive", self._along_inputs())]
        self._rate_values, tell = self._telling([(k, 1) for k in range(len(self.inputs))])
        return [tell, ("slope", read)]

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

        return add

    def _telling(self, which: Sequence[tuple[int, int]]) -> tuple[Vector, Prepared]:
        """A call that sets derivatives of inputs, (input, order) each, and the numbers that it takes."""
        assert isinstance(self._instance, Instance2)  # FMI 3.0 has no such function
        values, buffer = _buffer(len(which))
        variables, orders = [self.inputs[k] for k, _ in which], [order for _, order in which]
        return values, ("shape", self._instance.input_derivatives(variables, orders, buffer))

    @property
    def order(self) -> int:
        """Order of the error in H that the motion of its inputs within a step leads to."""
        ours = self.part.reconstruction is not None
        if self._way == "interpolate":  # by itself: triples quintic, others linear
            return min((6 if len(curve.data) == 3 else 2 for curve in self.curves), default=6)
        if self._way in {"polynomial", "asked"} and ours:
            return min((2 * len(curve.data) for curve in self.curves), default=6)
        return 2 if self.inputs else 6

    def step(self, *, again: bool) -> None:
        """From t to t + H, with what the inputs are at both ends; ``again``: from t once more."""
        ends, size = self._signals.ends, self._size.value
        if self.inputs:
            self._hand_over()
            if self._polynomials is not None:
                derivatives = self._polynomials(ends.reshape(-1), size)
                if self._way == "polynomial":
                    self._derivatives[:] = derivatives
                else:
                    rows = derivatives.reshape(-1, HIGHEST) * size**_ORDERS
                    self._inside[:] = ends[0, self.sources] + (rows @ _POWERS).T
            elif self._middle is not None:
                self._middle[:] = (ends[0, self.sources] + ends[1, self.sources]) / 2
        self.perform(self._again if again else self._first)

    def read(self) -> None:
        """Read the outputs as they are."""
        self.perform(self._get)

    def match(self, *, initial: bool) -> None:
        """Read the outputs at the present instant; in initialization, of the present inputs."""
        if self.inputs:
            self._hand_over()
        self.perform(self._match if initial or self._way != "interpolate" else self._get)

    def incline(self) -> None:
        """Read the slopes of the outputs at the present instant."""
        if self.inputs:
            self._hand_over()
        self.perform(self._incline)

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

    def perform(self, calls: Sequence[Prepared]) -> None:
        """Make prepared calls; the judge hears of what goes wrong."""
        for action, call in calls:
            status = call()
            if status and status != WARNING:
                self._judge(self.name, action, status)

    def derivatives(self, depends: Depends) -> Derivatives:
        """Prepared derivatives of the outputs with respect to the inputs, those that are not 0."""
        return Derivatives(self, self._instance, depends)


@final
class Derivatives:
    """∂(outputs)/∂(inputs) of one FMU at the present instant, column by column.

    :ivar pairs: (output, input), their places among those of the member, of each value.
    """

    def __init__(self, member: Member, instance: AnyInstance, depends: Depends) -> None:
        self.pairs: list[tuple[int, int]] = []
        self._member = member
        self._calls: list[Prepared] = []
        self._parts: list[NDArray[np.float64]] = []
        if not member.part.fmu.differentiates:
            return
        seed = (c_double * 1)(1.0)
        name = member.name
        for k, known in enumerate(member.inputs):
            rows = [i for i, o in enumerate(member.outputs) if depends((name, o.name), (name, known.name))]
            if rows:
                part, buffer = _buffer(len(rows))
                unknowns = [member.outputs[i] for i in rows]
                self._calls.append(("derive", instance.directional(unknowns, [known], seed, buffer)))
                self._parts.append(part)
                self.pairs += [(i, k) for i in rows]

    def __call__(self) -> Vector:
        """The values of :attr:`pairs`."""
        self._member.perform(self._calls)
        return np.concatenate(self._parts) if self._parts else np.empty(0)


def _buffer(size: int, buffer: Array[c_double] | None = None) -> tuple[Vector, Array[c_double]]:
    """Numbers as NumPy and as foreign functions see them."""
    buffer = (c_double * size)() if buffer is None else buffer
    return np.ctypeslib.as_array(buffer), buffer
