"""One running FMU of FMI 3.0, with the public methods of :class:`liaisons.cosim.instance.Instance`.

FMI 3.0 reads and sets arrays as a whole, while the run of a system knows scalars only.  Where the scalars of a call are
whole arrays in their order, which is the rule, the buffer is handed over as it is; else elements are picked, and set
within what the FMU holds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
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
from functools import partial
from pathlib import Path
from typing import Any, final

import fmpy
import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.calls import Call, Kind, Prepared
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
from liaisons.cosim.messages import COMPLAINTS, DISCARD, ERROR, FATAL, Action, Messages, logger
from liaisons.cosim.variables import Array as Elements
from liaisons.cosim.variables import Scalar
from liaisons.errors import SimulationError

_FUNCTION: dict[Action, str] = {
    "set": "fmi3SetFloat64",
    "step": "fmi3DoStep",
    "get": "fmi3GetFloat64",
    "save": "fmi3GetFMUState",
    "restore": "fmi3SetFMUState",
    "derive": "fmi3GetDirectionalDerivative",
    "slope": "fmi3GetOutputDerivatives",
}
_TYPES: dict[str, Any] = {
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
_LOG = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
_UPDATE = CFUNCTYPE(None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool, POINTER(c_bool), POINTER(c_double))

ASKED = 5
"""How often an FMU of ours asks for inputs inside a step: at its fifths, the end among them."""


@final
class Instance3:
    """An FMI 3.0 co-simulation instance; a context manager that terminates, frees and unloads it.

    :param name: name of the component, used as instance name and in messages.
    :param fmu: what was read from its file.
    :param directory: where that file was extracted.
    :param asks: it is to ask for inputs inside communication steps; see :meth:`guide`.
    :raises SimulationError: if the library cannot be loaded or refuses to make an instance.
    """

    def __init__(self, name: str, fmu: Fmu, directory: Path, *, asks: bool = False) -> None:
        self.name = name
        self._fmu = fmu
        self._messages = Messages(name)
        self._log = _LOG(lambda _, status, __, message: self._messages.note(status, message))
        self._update = _UPDATE(lambda *_: self._answer())
        self._asked = fmu.references_of("input") if asks else []
        self._answers: list[list[Transfer]] = []
        self._count = 0  # of answers in the present step
        self._worst_answer = 0
        self._initialized = False
        self._ended = c_uint16()  # two booleans: terminate the simulation, returned early
        self._final = c_bool(True)  # no state from before the step will be set after it
        self._setup: tuple[object, ...] = ()
        self._states: list[c_void_p] = []
        try:
            self._library: CDLL | None = CDLL(str(directory / fmu.binary))
        except OSError as error:
            raise SimulationError(f"{name}: the library of {fmu.path.name} cannot be loaded: {error}") from error
        try:
            address = self._instantiate(directory)
        except AttributeError as error:
            self.close()
            raise SimulationError(f"{name}: the library of {fmu.path.name} is none of FMI 3.0: {error}") from error
        self._pointer = c_void_p.from_param(address)
        self._address = address
        if not address:
            self.close()
            raise SimulationError(f"{name}: {fmu.path.name} cannot be instantiated{self._messages.words()}")
        # logging asks for everything; only what comes with a status is of use
        categories = [category.encode() for category in COMPLAINTS if category in fmu.log_categories]
        if categories:
            self._function("fmi3SetDebugLogging")(
                self._pointer, c_bool(True), c_size_t(len(categories)), (c_char_p * len(categories))(*categories)
            )

    def __enter__(self) -> Instance3:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def setup(self, tolerance: float | None, start_time: float, stop_time: float) -> None:
        """Announce tolerance (None: the FMU's own), start and stop time [s]."""
        self._setup = (
            c_bool(tolerance is not None),
            c_double(tolerance or 0.0),
            c_double(start_time),
            c_bool(True),
            c_double(stop_time),
        )

    def assign(self, name: str, value: Any) -> None:
        """Set a start value as :func:`liaisons.cosim.starts.start_values` returned it."""
        entry = self._fmu.variables.entries[name]
        variable = entry.like if isinstance(entry, Elements) else entry
        values = value if isinstance(value, tuple) else (value,)
        if variable.base == "String":
            values = tuple(text.encode() for text in values)
        buffer = (_TYPES[variable.base] * len(values))(*values)
        references = (c_uint32 * 1)(variable.reference)
        shown = f"{name} = {value}" if len(values) == 1 else f"{name} ({len(values)} values)"
        self._call(
            f"fmi3Set{variable.base}",
            references,
            c_size_t(1),
            buffer,
            c_size_t(len(values)),
            about=f" of {shown}",
        )

    def enter_initialization(self) -> None:
        self._call("fmi3EnterInitializationMode", *self._setup)

    def exit_initialization(self) -> None:
        self._call("fmi3ExitInitializationMode")
        self._initialized = True

    def getter(self, variables: Sequence[Scalar], values: Array[c_double]) -> Call:
        """A call that reads these reals into a buffer of as many values."""
        found = carriers(self._fmu, variables)
        if found[0].direct and len(found) == 1:
            return self._transfer("fmi3GetFloat64", found[0].references, values)
        return reading([(self._transfer(f"fmi3Get{p.base}", p.references, p.buffer), p) for p in found], values)

    def setter(self, variables: Sequence[Scalar], values: Array[c_double]) -> Call:
        """A call that sets these reals from a buffer of as many values."""
        found = carriers(self._fmu, variables)
        if found[0].direct and len(found) == 1:
            return self._transfer("fmi3SetFloat64", found[0].references, values)
        reads = [self._transfer(f"fmi3Get{p.base}", p.references, p.buffer) for p in found]
        writes = [self._transfer(f"fmi3Set{p.base}", p.references, p.buffer) for p in found]
        return setting(list(zip(reads, writes, found, strict=True)), values)

    def stepper(self, time: c_double, size: c_double) -> Call:
        """A call that steps by the size from the time that stand in the two buffers then [s].

        It returns Discard, too, where the FMU wants to end the simulation.
        """
        ended, asked = self._ended, bool(self._asked)
        self._nowhere = (c_bool(), c_double())
        step = partial(
            self._function("fmi3DoStep"),
            self._pointer,
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

        if asked:  # the compiled loop would not look at the answers
            return advance
        return Prepared(advance).recorded(
            Kind.STEP_3,
            function=step.func,
            instance=self._address,
            given=addressof(self._final),
            values=addressof(ended),
        )

    def guide(self, variables: Sequence[Scalar], values: NDArray[np.float64]) -> Call:
        """Let these inputs follow values inside each step; returns a call to make before it.

        :param values: at the fifths of the step, shape (ASKED, len(variables)); may change from step to step.
        """
        found = carriers(self._fmu, variables)
        writes = [(self._transfer(f"fmi3Set{p.base}", p.references, p.buffer), p) for p in found]
        reads = [self._transfer(f"fmi3Get{p.base}", p.references, p.buffer) for p in found if not p.whole]
        self._answers = [[_within(write, p, row) for write, p in writes] for row in values]

        def prepare() -> int:
            return max((read() for read in reads), default=0)

        return prepare

    def _answer(self) -> None:
        if self._count < len(self._answers):
            self._worst_answer = max(self._worst_answer, *(answer() for answer in self._answers[self._count]))
        self._count += 1

    def states(self) -> tuple[Call, Call]:
        """Calls that save the state and restore it, over one storage."""
        state = c_void_p()
        self._states.append(state)
        self._final.value = False
        save = partial(self._function("fmi3GetFMUState"), self._pointer, byref(state))
        return save, partial(self._function("fmi3SetFMUState"), self._pointer, state)

    def directional(
        self,
        unknowns: Sequence[Scalar],
        knowns: Sequence[Scalar],
        seed: Array[c_double],
        values: Array[c_double],
    ) -> Call:
        """A call that multiplies the partial derivatives of unknowns by knowns with a seed."""
        rows = carrier(self._fmu, unknowns, range(len(unknowns)))
        columns = carrier(self._fmu, knowns, range(len(knowns)))
        multiply = partial(
            self._function("fmi3GetDirectionalDerivative"),
            self._pointer,
            *counted(rows.references),
            *counted(columns.references),
            *buffered(columns.buffer),
            *buffered(rows.buffer),
        )
        read, given, scratch = reading([(multiply, rows)], values), view(seed), columns.scratch

        def derive() -> int:
            scratch[columns.places] = given
            return read()

        return derive

    def output_derivatives(self, variables: Sequence[Scalar], orders: Sequence[int], values: Array[c_double]) -> Call:
        """A call that reads derivatives of outputs by time, each of its order."""
        reads = []
        for order in sorted(set(orders)):
            p = carrier(self._fmu, variables, [k for k, other in enumerate(orders) if other == order])
            many = (c_int32 * len(p.references))(*[order] * len(p.references))
            function = self._function("fmi3GetOutputDerivatives")
            reads.append(
                (partial(function, self._pointer, *counted(p.references), byref(many), *buffered(p.buffer)), p)
            )
        return reading(reads, values)

    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        """The error that says which prepared call failed and when, with the FMU's own words."""
        if action == "step" and self._ended.value:
            self._messages.note(DISCARD, b"it asks to end the simulation")
        return self._messages.failure(_FUNCTION[action], status, when)

    def close(self) -> None:
        """Terminate, free and unload, as far as the state of the instance allows; safe to repeat."""
        library, self._library = self._library, None
        if library is None or self._messages.worst == FATAL:  # FATAL: FMI forbids every call, the release included
            return
        if getattr(self, "_address", None):
            for state in self._states:
                library["fmi3FreeFMUState"](self._pointer, byref(state))
            if self._initialized and self._messages.worst < ERROR and library["fmi3Terminate"](self._pointer) > 1:
                logger.warning("%s: fmi3Terminate failed%s", self.name, self._messages.words())
            library["fmi3FreeInstance"](self._pointer)
        with suppress(OSError):
            fmpy.freeLibrary(library._handle)  # noqa: SLF001 - ctypes has no other way

    def _instantiate(self, directory: Path) -> int | None:
        assert self._library is not None
        instantiate = self._library["fmi3InstantiateCoSimulation"]
        instantiate.restype = c_void_p
        return instantiate(
            self.name.encode(),
            self._fmu.guid.encode(),
            f"{directory.resolve() / 'resources'}/".encode(),
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

    def _call(self, function: str, *arguments: object, about: str = "") -> None:
        status = self._function(function)(self._pointer, *arguments)
        if status >= DISCARD:
            raise self._messages.failure(function, status, about)

    def _function(self, name: str) -> Callable[..., int]:
        assert self._library is not None
        try:
            return self._library[name]
        except AttributeError:
            raise SimulationError(
                f"{self.name}: the library of {self._fmu.path.name} has no function {name}; export it again"
            ) from None

    def _transfer(self, function: str, references: Sequence[int], values: Array[Any]) -> Prepared:
        given = (c_uint32 * len(references))(*references)
        call = Prepared(self._function(function), self._pointer, *buffered(given), *buffered(values))
        return call.recorded(
            Kind.TRANSFER_3,
            function=call.func,
            instance=self._address,
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
