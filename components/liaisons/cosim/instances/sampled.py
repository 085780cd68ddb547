"""An instance of a function of Python that is sampled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from ctypes import c_double
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import numpy as np

from liaisons.cosim.arrays import Numbers, Vector
from liaisons.cosim.compiled.calls import Action, Call
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.sampled_function import TIME, SampledFunction
from liaisons.cosim.description.start_values import Starts
from liaisons.cosim.instances.protocol import Instance, Scalars
from liaisons.cosim.messages import ERROR
from liaisons.errors import SimulationError


@final
@dataclass(frozen=True, eq=False)
class _Memory:
    """What a function has done until an instant.

    :ivar before: outputs before the last sample, and its state; ``after``: those after it.
    :ivar last: instant of the last sample [s]; ``seen``: its inputs.
    :ivar waits: whether inputs were set since.
    """

    inputs: Vector
    before: tuple[Vector, Any]
    after: tuple[Vector, Any]
    time: float = 0.0
    last: float = 0.0
    waits: bool = True
    seen: Vector | None = None


@final
class SampledInstance(Instance):
    """Calls a function at samples, with the inputs of their instants; where these change there, once more."""

    functions: ClassVar[Mapping[Action, str]] = {}

    def __init__(self, name: str, fmu: Fmu) -> None:
        assert isinstance(fmu.function, SampledFunction)
        self.name, self._function = name, fmu.function
        self._inputs, self._outputs = list(fmu.function.inputs), list(fmu.function.outputs)
        self._error = ""
        self.reset()

    def reset(self) -> None:
        start = np.zeros(len(self._outputs)), self._function.state
        self._memory = _Memory(np.zeros(len(self._inputs)), start, start)

    def initialize(self, starts: Starts, tolerance: float | None, start_time: float, stop_time: float) -> None:  # noqa: ARG002 - it has no solver
        self.reset()
        function = self._function
        last = function.last_sample(start_time) - function.period * function.is_sample(start_time)
        self._memory = replace(self._memory, time=start_time, last=last)
        for name, value in starts.items():
            self.assign(name, value)

    def assign(self, name: str, value: Any) -> None:
        self._memory.inputs[self._inputs.index(name)] = value

    def exit_initialization(self) -> None:
        if self._take():
            raise self.failure("get", ERROR, "")

    def getter(self, variables: Scalars, values: Numbers) -> Call:
        return self.prepared("get", self._read, [variable.name for variable in variables], np.asarray(values))

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        places = [self._inputs.index(variable.name) for variable in variables]
        return self.prepared("set", self._write, places, np.asarray(values))

    def stepper(self, time: c_double, size: c_double) -> Call:
        return self.prepared("step", self._step, time, size)

    def save_and_restore_calls(self) -> tuple[Call, Call]:
        saved: list[_Memory] = []
        return self.prepared("save", self._save, saved), self.prepared("restore", self._restore, saved)

    def failure(self, action: Action, status: int, when: str) -> SimulationError:  # noqa: ARG002 - its error has both
        return SimulationError(f"{self.name}: {self._error}")

    def close(self) -> None:
        pass

    def _take(self) -> int:
        """Take the sample that is due now, or again that of this instant; returns the status."""
        memory, function = replace(self._memory, waits=False), self._function
        self._memory, instant = memory, function.last_sample(memory.time)
        if not function.is_sample(memory.time) or instant < memory.last - function.period / 2:
            return 0
        is_new = instant > memory.last + function.period / 2
        if not is_new and memory.seen is not None and np.array_equal(memory.seen, memory.inputs):
            return 0
        before = memory.after if is_new else memory.before
        readings = dict(zip(self._inputs, memory.inputs.tolist(), strict=True)) | {TIME: instant}
        arguments = [readings[name.rpartition(".")[2]] for name in function.reads]
        try:
            if function.state is None:
                result, state = function.function(*arguments), None
            else:
                result, state = function.function(before[1], *arguments)
            outputs = np.array(result, dtype=float).reshape(-1)
        except Exception as error:  # noqa: BLE001 - it is the user's
            self._error = f"{function.name} fails at t = {instant:.10g} s: {error!r}"
            return ERROR
        if outputs.size != len(self._outputs) or not np.isfinite(outputs).all():
            count = f"{len(self._outputs)} finite number{'s' * (len(self._outputs) > 1)}"
            self._error = f"{function.name} returns {outputs.tolist()} at t = {instant:.10g} s, expected {count}"
            return ERROR
        self._memory = replace(memory, before=before, after=(outputs, state), last=instant, seen=memory.inputs)
        return 0

    def _read(self, names: Sequence[str], values: Vector) -> int:
        if self._memory.waits and (status := self._take()):
            return status
        memory, function = self._memory, self._function
        is_ready = function.is_due(memory.time, memory.last + function.delay)
        outputs = (memory.after if is_ready else memory.before)[0]
        numbers: Mapping[str, float] = dict(zip(self._outputs, outputs.tolist(), strict=True))
        numbers |= dict(zip(self._inputs, memory.inputs.tolist(), strict=True))
        for i, name in enumerate(names):
            values[i] = numbers[name] if name in numbers else function.next_event(memory.time)
        return 0

    def _write(self, places: Sequence[int], values: Vector) -> int:
        inputs = self._memory.inputs.copy()
        inputs[places] = values
        self._memory = replace(self._memory, inputs=inputs, waits=True)
        return 0

    def _step(self, time: c_double, size: c_double) -> int:
        function, self._memory = self._function, replace(self._memory, time=time.value)
        is_taken = abs(self._memory.last - function.last_sample(time.value)) < function.period / 2
        if (self._memory.waits or not is_taken) and (status := self._take()):
            return status
        end = time.value + size.value
        if not function.is_due(self._memory.last + function.period, end):
            self._error = f"a sample lies inside the step from t = {time.value:.10g} s of {size.value:.10g} s"
            return ERROR
        self._memory = replace(self._memory, time=end, waits=not self._inputs)
        return 0

    def _save(self, saved: list[_Memory]) -> int:
        saved[:] = [self._memory]
        return 0

    def _restore(self, saved: list[_Memory]) -> int:
        (self._memory,) = saved
        return 0
