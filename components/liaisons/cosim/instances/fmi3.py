"""A running FMU of FMI 3.0.

FMI 3.0 reads and sets arrays as a whole, while the run of a system knows scalars only.  Where the scalars of a call are
whole arrays in their order, which is the rule, the buffer is handed over as it is; else elements are picked, and set
within what the FMU holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import (
    CDLL,
    CFUNCTYPE,
    POINTER,
    Array,
    addressof,
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_size_t,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
)
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.calls import STEP_3, TRANSFER_3, Action, Call
from liaisons.cosim.description import Fmu
from liaisons.cosim.instances.carriers import (
    Carrier,
    Transfer,
    buffered,
    carrier,
    carriers,
    counted,
    reading,
    setting,
    view,
)
from liaisons.cosim.instances.protocol import Instance
from liaisons.cosim.messages import DISCARD
from liaisons.cosim.variables import Scalar
from liaisons.errors import SimulationError

_LOG = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
_UPDATE = CFUNCTYPE(None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool, POINTER(c_bool), POINTER(c_double))


@final
class Instance3(Instance):
    """An FMI 3.0 co-simulation instance.

    :param asks: it is to ask for inputs inside communication steps; see :meth:`guide`.
    """

    prefix = "fmi3"
    functions: ClassVar = {
        "set": "fmi3SetFloat64",
        "step": "fmi3DoStep",
        "get": "fmi3GetFloat64",
        "save": "fmi3GetFMUState",
        "restore": "fmi3SetFMUState",
        "derive": "fmi3GetDirectionalDerivative",
        "slope": "fmi3GetOutputDerivatives",
    }
    types: ClassVar = {
        "Float32": c_float,
        "Float64": c_double,
        "Int8": c_int8,
        "UInt8": c_uint8,
        "Int16": c_int16,
        "UInt16": c_uint16,
        "Int32": c_int32,
        "UInt32": c_uint32,
        "Int64": c_int64,
        "UInt64": c_uint64,
        "Boolean": c_bool,
        "String": c_char_p,
    }
    true = c_bool(True)
    sized = True

    def __init__(self, name: str, fmu: Fmu, directory: Path, *, asks: bool = False) -> None:
        self._log = _LOG(lambda _, status, __, message: self._note(status, message))
        self._update = _UPDATE(lambda *_: self._answer())
        self._asked = fmu.references_of("input") if asks else []
        self._answers: list[list[Transfer]] = []
        self._count = 0  # of answers in the present step
        self._worst_answer = 0
        self._ended = c_uint16()  # two booleans: terminate the simulation, returned early
        self._final = c_bool(True)  # no state from before the step will be set after it
        self._setup: tuple[object, ...] = ()
        super().__init__(name, fmu, directory)

    def _instantiated(self, library: CDLL, resources: Path) -> int | None:
        instantiate = library["fmi3InstantiateCoSimulation"]
        instantiate.restype = c_void_p
        return instantiate(
            self.name.encode(),
            self._fmu.guid.encode(),
            f"{resources}/".encode(),
            c_bool(False),  # visible
            c_bool(True),  # logging
            c_bool(False),  # event mode
            c_bool(False),  # early return
            (c_uint32 * len(self._asked))(*self._asked),
            c_size_t(len(self._asked)),
            None,
            self._log,
            self._update if self._asked else None,
        )

    def setup(self, tolerance: float | None, start_time: float, stop_time: float) -> None:
        given = c_bool(tolerance is not None), c_double(tolerance or 0.0)
        self._setup = (*given, c_double(start_time), c_bool(True), c_double(stop_time))

    def enter_initialization(self) -> None:
        self._call("fmi3EnterInitializationMode", *self._setup)

    def getter(self, variables: Sequence[Scalar], values: Array[c_double]) -> Call:
        found = carriers(self._fmu, variables)
        if found[0].direct and len(found) == 1:
            return self._transfer("get", found[0], values)
        return self._made("get", reading([(self._transfer("get", c), c) for c in found], values))

    def setter(self, variables: Sequence[Scalar], values: Array[c_double]) -> Call:
        found = carriers(self._fmu, variables)
        if found[0].direct and len(found) == 1:
            return self._transfer("set", found[0], values)
        transfers = [(self._transfer("get", c), self._transfer("set", c), c) for c in found]
        return self._made("set", setting(transfers, values))

    def stepper(self, time: c_double, size: c_double) -> Call:
        """As :meth:`Instance.stepper`; it returns Discard, too, where the FMU wants to end the simulation."""
        ended, asked = self._ended, bool(self._asked)
        self._nowhere = (c_bool(), c_double())
        step = self._prepared(
            "step",
            time,
            size,
            self._final,
            byref(self._nowhere[0]),  # events are handled inside: no event mode was asked for
            byref(ended, 0),
            byref(ended, 1),
            byref(self._nowhere[1]),
        )

        def advance() -> int:
            status = step()
            if asked:
                status = max(status, self._worst_answer)
                self._count = self._worst_answer = 0
            return max(status, DISCARD) if ended.value else status

        call = self._made("step", advance)
        if asked:  # the compiled loop would not look at the answers
            return call
        given, values = addressof(self._final), addressof(ended)
        return call.recorded(STEP_3, function=step.func, instance=self._pointer.value, given=given, values=values)

    def guide(self, variables: Sequence[Scalar], values: NDArray[np.float64]) -> Call:
        found = carriers(self._fmu, variables)
        writes = [(self._transfer("set", c), c) for c in found]
        reads = [self._transfer("get", c) for c in found if not c.whole]
        self._answers = [[_within(write, c, row) for write, c in writes] for row in values]
        return self._made("set", lambda: max((read() for read in reads), default=0))

    def states(self) -> tuple[Call, Call]:
        self._final.value = False
        return super().states()

    def directional(
        self, unknowns: Sequence[Scalar], knowns: Sequence[Scalar], seed: Array[c_double], values: Array[c_double]
    ) -> Call:
        rows = carrier(self._fmu, unknowns, range(len(unknowns)))
        columns = carrier(self._fmu, knowns, range(len(knowns)))
        references = *counted(rows.references), *counted(columns.references)
        multiply = self._prepared("derive", *references, *buffered(columns.buffer), *buffered(rows.buffer))
        read, given, scratch = reading([(multiply, rows)], values), view(seed), columns.scratch

        def derive() -> int:
            scratch[columns.places] = given
            return read()

        return self._made("derive", derive)

    def output_derivatives(self, variables: Sequence[Scalar], orders: Sequence[int], values: Array[c_double]) -> Call:
        reads = []
        for order in sorted(set(orders)):
            c = carrier(self._fmu, variables, [k for k, other in enumerate(orders) if other == order])
            many = (c_int32 * len(c.references))(*[order] * len(c.references))
            reads.append((self._prepared("slope", *counted(c.references), byref(many), *buffered(c.buffer)), c))
        return self._made("slope", reading(reads, values))

    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        if action == "step" and self._ended.value:
            self._note(DISCARD, b"it asks to end the simulation")
        return super().failure(action, status, when)

    def _answer(self) -> None:
        if self._count < len(self._answers):
            self._worst_answer = max(self._worst_answer, *(answer() for answer in self._answers[self._count]))
        self._count += 1

    def _made(self, action: Action, function: Transfer) -> Call:
        return Call(function).of(action, self.failure)

    def _transfer(self, action: Action, whole: Carrier, values: Array[Any] | None = None) -> Call:
        """A call that reads or sets whole variables from these values, else by the buffer that they have."""
        values = whole.buffer if values is None else values
        given = (c_uint32 * len(whole.references))(*whole.references)
        function = self._function(f"fmi3{action.capitalize()}{whole.base}")
        call = Call(function, self._pointer, *buffered(given), *buffered(values)).of(action, self.failure)
        return call.recorded(
            TRANSFER_3,
            function=function,
            instance=self._pointer.value,
            given=addressof(given),
            count=len(given),
            values=addressof(values),
            size=len(values),
        )


def _within(write: Transfer, whole: Carrier, values: NDArray[np.float64]) -> Transfer:
    """A call that sets these values within what stands in the buffer."""
    scratch, places, wanted = whole.scratch, whole.places, whole.wanted

    def call() -> int:
        scratch[places] = values[wanted]
        return write()

    return call
