"""Instances of FMUs of FMI 3.0.

FMI 3.0 reads and sets whole arrays, while a run handles scalars.  If the scalars of a call are whole arrays in their
order, as a rule, FMI gets the buffer itself.  Otherwise elements are copied out of an array, or into the array that was
read from the FMU before.
"""

from __future__ import annotations

import ctypes as c
from abc import ABC
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np

from liaisons.cosim.compiled.calls import (
    DISCARD,
    HEADER,
    STEP_3,
    TRANSFER_3,
    Action,
    Call,
    Numbers,
    Vector,
    record_type,
)
from liaisons.cosim.instances.buffer_layouts import (
    Transfer,
    counted_buffer,
    counted_references,
    layout,
    layouts_by_type,
)
from liaisons.cosim.instances.loading import FMU3CoSimulation, Loaded
from liaisons.cosim.instances.protocol import Scalars
from liaisons.errors import SimulationError
from liaisons.fmu_files import Fmu

_StepEnd = record_type(HEADER, "Ended")
"""Results of a step: whether it ended the simulation or returned early, and the last time reached."""


class Instance3(Loaded, ABC):
    """An FMI 3.0 instance."""

    prefix = "fmi3"
    functions: ClassVar = {
        "set": "fmi3SetFloat64",
        "step": "fmi3DoStep",
        "get": "fmi3GetFloat64",
        "save": "fmi3GetFMUState",
        "restore": "fmi3SetFMUState",
        "derive": "fmi3GetDirectionalDerivative",
        "shape": "fmi3SetFloat64",  # along a motion, in Model Exchange
        "slope": "fmi3GetOutputDerivatives",
    }
    types: ClassVar = {
        "Float32": c.c_float,
        "Float64": c.c_double,
        **{f"Int{bits}": getattr(c, f"c_int{bits}") for bits in (8, 16, 32, 64)},
        **{f"UInt{bits}": getattr(c, f"c_uint{bits}") for bits in (8, 16, 32, 64)},
        "Boolean": c.c_bool,
        "String": c.c_char_p,
    }
    flag = c.c_bool
    takes_size = True
    transfer_kind = TRANSFER_3

    def _instantiate(self, **arguments: Any) -> None:
        """Instantiate the FMU by FMPy, with arguments of its interface type."""
        self.fmpy_instance.instantiate(
            loggingOn=True, logMessage=lambda _, status, __, message: self._log_message(status, message), **arguments
        )

    def directional_derivatives(self, unknowns: Scalars, knowns: Scalars, seed: Numbers, values: Numbers) -> Call:
        rows, columns = (layout(self._fmu, variables, range(len(variables))) for variables in (unknowns, knowns))
        references = *counted_references(rows.references), *counted_references(columns.references)
        multiply = self._prepare("derive", *references, *counted_buffer(columns.buffer), *counted_buffer(rows.buffer))
        read = partial(rows.read_into, multiply, np.asarray(values))
        return self.prepare_call("derive", columns.write_from, read, np.asarray(seed))


@final
class CoSimulation3(Instance3):
    """An FMI 3.0 co-simulation instance.

    :param requests_intermediate_update: whether inputs are set inside steps; see :meth:`prepare_intermediate_inputs`.
    """

    fmpy_class = FMU3CoSimulation

    def __init__(self, name: str, fmu: Fmu, directory: Path, *, requests_intermediate_update: bool = False) -> None:
        inputs = (entry.prototype for entry in fmu.variables.entries.values() if entry.prototype.causality == "input")
        moving = (like for like in inputs if like.type == "Real" and like.continuous)
        self._intermediate_references = [like.reference for like in moving if requests_intermediate_update]
        self._intermediate_writes: list[list[Transfer]] = []
        self._count = 0  # of updates in the present step
        self._worst_update = 0
        self._step_end = _StepEnd()
        self._final = c.c_bool(True)  # whether no earlier state is restored after the step
        super().__init__(name, fmu, directory)

    def _instantiate(self, **arguments: Any) -> None:
        if self._intermediate_references:
            arguments["requiredIntermediateVariables"] = self._intermediate_references
            arguments["intermediateUpdate"] = lambda *_: self._set_intermediate_inputs()
        super()._instantiate(**arguments)

    def stepper(self, time: c.c_double, size: c.c_double) -> Call:
        """As :meth:`Instance.stepper`; the call returns Discard if the FMU requests the end of the simulation."""
        ended, is_updated, self._span = self._step_end, bool(self._intermediate_references), (time, size)
        self._event = c.c_bool()
        step = self._prepare(
            "step",
            time,
            size,
            self._final,
            c.byref(self._event),  # events are handled inside: no event mode was asked for
            *(c.byref(ended, getattr(_StepEnd, field).offset) for field in ("terminate", "early", "last_time")),
        )

        def advance() -> int:
            status = step()
            if is_updated:
                status = max(status, self._worst_update)
                self._count = self._worst_update = 0
            return max(status, DISCARD) if ended.terminate or ended.early else status

        call = self.prepare_call("step", advance)
        if is_updated:  # the compiled loop does not check the statuses of updates
            return call
        call.record = step.set_record(STEP_3, self._pointer.value, source=self._final, values=ended).record
        return call

    def prepare_intermediate_inputs(self, variables: Scalars, values: Vector) -> Call:
        inputs = layouts_by_type(self._fmu, variables, self.types)
        writes = [(part, self._transfer_whole("set", part)) for part in inputs]
        reads = [self._transfer_whole("get", part) for part in inputs if not part.is_complete]
        self._intermediate_writes = [[partial(part.write_from, write, row) for part, write in writes] for row in values]
        return self._combined_call("set", reads, self.functions["get"])

    def save_and_restore_calls(self) -> tuple[Call, Call]:
        self._final.value = False
        return super().save_and_restore_calls()

    def output_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        reads = []
        for order in sorted(set(orders)):
            outputs = layout(self._fmu, variables, [k for k, other in enumerate(orders) if other == order])
            numbers = (c.c_int32 * len(outputs.references))(*[order] * len(outputs.references))
            read = self._prepare(
                "slope", *counted_references(outputs.references), c.byref(numbers), *counted_buffer(outputs.buffer)
            )
            reads.append(partial(outputs.read_into, read, np.asarray(values)))
        return self._combined_call("slope", reads, self.functions["slope"])

    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        if action == "step" and self._step_end.early and not self._step_end.terminate:
            self._log_message(DISCARD, b"it returned early, which it was not allowed to")
        return super().failure(action, status, when)

    def _requested_end_time(self) -> float | None:
        return self._step_end.last_time if self._step_end.terminate else None

    def _set_intermediate_inputs(self) -> None:
        """Set the inputs for the next instant inside the step, when the FMU asks for them."""
        if self._count < len(self._intermediate_writes):
            self._worst_update = max(self._worst_update, *(write() for write in self._intermediate_writes[self._count]))
        self._count += 1
