"""Sampled Python functions in systems, as instances of FMUs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from ctypes import c_double
from typing import Any, ClassVar, NamedTuple, final

import numpy as np

from liaisons.base.arrays import Floats
from liaisons.cosim import (
    ERROR,
    Action,
    Call,
    Instance,
    Numbers,
    Scalars,
)
from liaisons.errors import SimulationError
from liaisons.fmu_files import TIME, Fmu, SampledFunction, Starts, variable_name


@final
class _State(NamedTuple):
    """State of the instance at an instant.  Each step makes several, of which a tuple is quicker than a dataclass.

    :ivar before: outputs and state of the function before the last sample.
    :ivar after: after it.
    :ivar last: instant of the last sample [s].
    :ivar last_inputs: its inputs.
    :ivar is_pending: whether inputs were set after it.
    """

    inputs: Floats
    before: tuple[Floats, Any]
    after: tuple[Floats, Any]
    time: float = 0.0
    last: float = 0.0
    is_pending: bool = True
    last_inputs: Floats | None = None


@final
class SampledInstance(Instance):
    """Calls a function at each sample, and again if its inputs change at the same instant."""

    functions: ClassVar[Mapping[Action, str]] = {}

    def __init__(self, name: str, fmu: Fmu) -> None:
        assert isinstance(fmu.function, SampledFunction)
        self.name, self._function = name, fmu.function
        self._inputs, self._outputs = list(fmu.function.inputs), list(fmu.function.outputs)
        self._reads = [[*self._inputs, TIME].index(variable_name(name)) for name in fmu.function.reads]
        self._error = ""
        start = np.zeros(len(self._outputs)), fmu.function.state
        self._state = self._start = _State(np.zeros(len(self._inputs)), start, start)

    def initialize(self, starts: Starts, tolerance: float | None, start_time: float, stop_time: float) -> None:  # noqa: ARG002 - it has no solver
        function = self._function
        last = function.last_sample(start_time) - function.period * function.is_sample(start_time)
        self._state = self._start._replace(inputs=self._start.inputs.copy(), time=start_time, last=last)
        for name, value in starts.items():
            self.assign(name, value)

    def assign(self, name: str, value: Any) -> None:
        self._state.inputs[self._inputs.index(name)] = value

    def exit_initialization(self) -> None:
        if self._take_sample():
            raise self.failure("get", ERROR, "")

    def getter(self, variables: Scalars, values: Numbers) -> Call:
        places = {name: i for i, name in enumerate((*self._outputs, *self._inputs))}
        indices = [places.get(variable.name, len(places)) for variable in variables]
        return self.prepare_call("get", self._read, indices, np.asarray(values))

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        indices = [self._inputs.index(variable.name) for variable in variables]
        return self.prepare_call("set", self._write, indices, np.asarray(values))

    def stepper(self, time: c_double, size: c_double) -> Call:
        return self.prepare_call("step", self._step, time, size)

    def save_and_restore_calls(self) -> tuple[Call, Call]:
        saved = [self._state]
        return (
            self.prepare_call("save", lambda: saved.__setitem__(0, self._state)),
            self.prepare_call("restore", lambda: setattr(self, "_state", saved[0])),
        )

    def failure(self, action: Action, status: int, when: str) -> SimulationError:  # noqa: ARG002 - its error has both
        return SimulationError(f"{self.name}: {self._error}")

    def close(self) -> None:
        """Do nothing: a function holds no resources."""

    def _take_sample(self) -> int:
        """Take the sample that is due, or that of this instant again if inputs have changed; returns the status."""
        state, function = self._state._replace(is_pending=False), self._function
        self._state, instant = state, function.last_sample(state.time)
        if not function.is_sample(state.time) or instant < state.last - function.period / 2:
            return 0
        is_new = instant > state.last + function.period / 2
        if not is_new and state.last_inputs is not None and np.array_equal(state.last_inputs, state.inputs):
            return 0
        before = state.after if is_new else state.before
        readings = [*state.inputs.tolist(), instant]
        arguments = [readings[i] for i in self._reads]
        try:
            if function.state is None:
                result, memory = function.function(*arguments), None
            else:
                result, memory = function.function(before[1], *arguments)
            outputs = np.array(result, dtype=float).reshape(-1)
        except Exception as error:  # noqa: BLE001 - it is the user's
            self._error = f"{function.name} fails at t = {instant:.10g} s: {error!r}"
            return ERROR
        if outputs.size != len(self._outputs) or not np.isfinite(outputs).all():
            count = f"{len(self._outputs)} finite number{'s' * (len(self._outputs) > 1)}"
            self._error = f"{function.name} returns {outputs.tolist()} at t = {instant:.10g} s, expected {count}"
            return ERROR
        self._state = state._replace(before=before, after=(outputs, memory), last=instant, last_inputs=state.inputs)
        return 0

    def _read(self, indices: Sequence[int], values: Floats) -> int:
        """Get variables by their indices among outputs, inputs and the next event."""
        if self._state.is_pending and (status := self._take_sample()):
            return status
        state, function = self._state, self._function
        is_ready = function.is_due(state.time, state.last + function.delay)
        outputs = (state.after if is_ready else state.before)[0]
        numbers = [*outputs.tolist(), *state.inputs.tolist()]
        if len(numbers) in indices:
            numbers.append(function.next_event(state.time))
        values[:] = [numbers[i] for i in indices]
        return 0

    def _write(self, indices: Sequence[int], values: Floats) -> int:
        inputs = self._state.inputs.copy()
        inputs[indices] = values
        self._state = self._state._replace(inputs=inputs, is_pending=True)
        return 0

    def _step(self, time: c_double, size: c_double) -> int:
        function, self._state = self._function, self._state._replace(time=time.value)
        is_taken = abs(self._state.last - function.last_sample(time.value)) < function.period / 2
        if (self._state.is_pending or not is_taken) and (status := self._take_sample()):
            return status
        end = time.value + size.value
        if not function.is_due(self._state.last + function.period, end):
            self._error = f"a sample lies inside the step from t = {time.value:.10g} s of {size.value:.10g} s"
            return ERROR
        self._state = self._state._replace(time=end, is_pending=not self._inputs)
        return 0
