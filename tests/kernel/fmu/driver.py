"""A small importer on ctypes for FMI 2.0, FMI 3.0 and FMUs in Python: calls return their status, logs are kept.

Functions go by their names in FMI 3.0, with its arguments, in both versions: FMI 2.0 has most of them, too, under other
names and without the sizes of what cannot be an array there.  Arrays are one variable for FMI 2.0 as well.
"""

from __future__ import annotations

import ctypes as c
import re
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import count, takewhile
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import numpy as np
from numpy.typing import ArrayLike, NDArray

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
MODEL_EXCHANGE, CO_SIMULATION, SCHEDULED_EXECUTION = "ModelExchange", "CoSimulation", "ScheduledExecution"

N = c.c_size_t
REALS, BOOL = c.POINTER(c.c_double), c.POINTER(c.c_bool)
TYPES = {
    "Float32": c.c_float,
    "Float64": c.c_double,
    **{f"{sign}Int{bits}": getattr(c, f"c_{sign.lower()}int{bits}") for sign in ("", "U") for bits in (8, 16, 32, 64)},
    "Boolean": c.c_bool,
    "String": c.c_char_p,
}
_OTHERWISE: dict[str, tuple[str, tuple[int, ...]]] = {
    **{
        f"{way}{name}": (way + old, (3,))
        for way in ("Get", "Set")
        for name, old in (("Float64", "Real"), ("Int32", "Integer"), ("Boolean", "Boolean"), ("String", "String"))
    },
    "GetDirectionalDerivative": ("GetDirectionalDerivative", (5, 7)),
    "GetOutputDerivatives": ("GetRealOutputDerivatives", (4,)),
    "GetContinuousStateDerivatives": ("GetDerivatives", ()),
    "DoStep": ("DoStep", (3, 4, 5, 6)),
    "DeserializeFMUState": ("DeSerializeFMUstate", ()),
    "SerializedFMUStateSize": ("SerializedFMUstateSize", ()),
    **{f"{way}FMUState": (f"{way}FMUstate", ()) for way in ("Get", "Set", "Free", "Serialize")},
}
"""Names in FMI 2.0, and the arguments that are missing there."""


def _type(parameter: str, version: str) -> Any:
    """That of a parameter in a header of the standard."""
    (name,) = re.findall(r"size_t|(?<=fmi\d)[A-Z]\w*(?=[\s*\[])", f"{parameter} ")[:1]
    of_version = (
        {"Integer": c.c_int, "Boolean": c.c_int, "FMUstate": c.c_void_p} if version == "2" else {"Clock": c.c_bool}
    )
    known = {"size_t": N, "ValueReference": c.c_uint, "FMUState": c.c_void_p, "Real": c.c_double, **TYPES, **of_version}
    if name == "Byte":
        return c.c_char_p
    if "*" not in parameter and "[" not in parameter:
        return known.get(name, c.c_int)
    return c.POINTER(known[name]) if name in known else c.c_void_p


def _signatures(version: str) -> dict[str, list[Any]]:
    header = (Path(fmpy.__file__).parent / "c-code" / f"fmi{version}FunctionTypes.h").read_text(encoding="utf-8")
    status = rf"typedef\s+fmi{version}Status\s+fmi{version}(\w+)TYPE\s*\(([^)]*)\)"
    names: dict[str, str] = {old: name for name, (old, _) in _OTHERWISE.items()} if version == "2" else {}
    return {
        names.get(name) or name: [_type(parameter, version) for parameter in parameters.split(",")[1:]]
        for name, parameters in re.findall(status, header)
    }


SIGNATURES = {version: _signatures(version) for version in ("2", "3")}
"""By version: arguments behind the instance of every function that has one and returns a status."""

Observer = Callable[["Instance", float], float | None]
"""Called in intermediate update mode with the time; returns when to return early, or None."""


class Step(NamedTuple):
    status: int
    event: bool
    early: bool
    time: float


class Event(NamedTuple):
    states_changed: bool
    next_time: float | None


class _EventInfo(c.Structure):
    _fields_ = (*((name, c.c_int) for name in ("again", "end", "nominals", "states", "timed")), ("time", c.c_double))


class _Callbacks(c.Structure):
    _fields_ = tuple((name, c.c_void_p) for name in ("logger", "allocate", "free", "finished", "environment"))


_LOGGERS = {
    "2": c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int, c.c_char_p, c.c_char_p),
    "3": c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p),
}
_UPDATE = c.CFUNCTYPE(None, c.c_void_p, c.c_double, *[c.c_bool] * 4, c.POINTER(c.c_bool), c.POINTER(c.c_double))


def members(fmu: Path) -> dict[str, bytes]:
    """The files in an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


class Library:
    """The shared library of an FMU, and what its model description says."""

    def __init__(self, fmu: Path) -> None:
        self.path = fmu
        self.description = fmpy.read_model_description(str(fmu))
        self.fmi = (self.description.fmiVersion or "")[0]
        self.token = self.description.guid or self.description.instantiationToken or ""
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self._counts = {v.name: int(np.prod(v.shape)) if v.shape else 1 for v in self.description.modelVariables}
        derived = (d.variable for d in self.description.derivatives)
        self.states = sum(self.count(v.name) for v in derived if v is not None)
        platform = fmpy.platform if self.fmi == "2" else fmpy.platform_tuple
        self.member = f"binaries/{platform}/{self.description.modelName}{fmpy.sharedLibraryExtension}"
        with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(fmu) as archive:
            self.python = "resources/slavemodule.txt" in archive.namelist()
            self.folder = fmu.with_suffix("") if self.python else Path(folder)  # what Python imports later stays there
            if not (self.folder / self.member).exists():  # never over a library that is loaded
                archive.extractall(self.folder, None if self.python else [self.member])
            self.functions = c.CDLL(str(self.folder / self.member))

    def full(self, function: str) -> str:
        """What a function is called in this version."""
        return f"fmi{self.fmi}{_OTHERWISE.get(function, (function,))[0] if self.fmi == '2' else function}"

    def elements(self, name: str) -> list[str]:
        """A variable, or in FMI 2.0 those that an array is."""
        if name in self.references:
            return [name]
        return list(takewhile(self.references.__contains__, (f"{name}[{i}]" for i in count(1))))

    def count(self, *names: str) -> int:
        """How many numbers variables have."""
        return sum(self._counts[element] for name in names for element in self.elements(name))

    def instantiate(self, kind: str = CO_SIMULATION, **options: Any) -> Instance:
        return Instance(self, kind, **options)

    def start(self, *kind: str, **values: Any) -> Instance:
        """An instance that has left initialization mode; values by name, settings among them."""
        instance = self.initializing(*kind, **values)
        instance.exit_initialization()
        return instance

    def initializing(
        self, kind: str = CO_SIMULATION, /, *, tolerance: float | None = None, options: Any = None, **values: ArrayLike
    ) -> Instance:
        """The same in initialization mode."""
        instance = self.instantiate(kind, **(options or {}))
        instance.initialize(tolerance)
        for name in ("input_reconstruction", "symplectic_steps", "stiff_solver"):
            if name in values:
                instance.set_integer(name, int(np.asarray(values.pop(name))))
        instance.set(values)
        return instance

    def running(self, kind: str = MODEL_EXCHANGE, /, **options: Any) -> Instance:
        """The same out of event mode, in continuous-time or step mode."""
        instance = self.start(kind, **options)
        instance.go_on()
        return instance

    def restored(self, content: bytes, kind: str = CO_SIMULATION, **options: Any) -> Instance:
        """A new instance with a saved state."""
        instance = self.instantiate(kind, **options)
        instance.deserialize(content)
        return instance


class Instance:
    """One instance; freed with the object."""

    def __init__(
        self,
        library: Library,
        kind: str,
        *,
        name: bytes | None = b"it",
        token: str | None = None,
        resources: Path | None = None,
        logging: bool = False,
        events: bool = False,
        early: bool = False,
        observer: Observer | None = None,
        wanted: Iterable[str] = (),
    ) -> None:
        self.library = library
        self.messages: list[str] = []
        self.log: list[tuple[int, str, str]] = []
        self.seen: list[tuple[bool, ...]] = []
        self._observer = observer
        self._logger = _LOGGERS[library.fmi](self._note)  # this and what follows must live as long as the instance
        self._update = _UPDATE(self._tell) if observer else _UPDATE()
        self._callbacks = _Callbacks(c.cast(self._logger, c.c_void_p))
        self._two, self._exchanges = library.fmi == "2", kind == MODEL_EXCHANGE
        token = library.token if token is None else token
        if library.python:  # pythonfmu's wrapper passes on no message unless logging is on
            resources, logging = resources or library.folder / "resources", True
        folder = resources and (resources.as_uri() if self._two else str(resources)).encode()
        made = f"Instantiate{kind}" if library.fmi == "3" else "Instantiate"
        arguments: list[Any] = [name, token.encode(), folder, c.c_bool(False), c.c_bool(logging)]
        if self._two:
            callbacks = c.byref(self._callbacks)
            arguments = [name, int(not self._exchanges), token.encode(), folder, callbacks, 0, int(logging)]
        elif kind == CO_SIMULATION:
            references = self.refs(wanted)
            arguments += [c.c_bool(events), c.c_bool(early), references, N(len(references)), None, self._logger]
            arguments.append(self._update)
        else:
            arguments += [None, self._logger, *([None] * 3 if kind == SCHEDULED_EXECUTION else [])]
        entry = getattr(library.functions, f"fmi{library.fmi}{made}")
        entry.restype = c.c_void_p
        self.pointer = entry(*arguments)

    def _note(self, _environment: Any, *rest: Any) -> None:
        status, category, message = rest[-3], *((text or b"").decode() for text in rest[-2:])
        if self.library.python and status == FATAL:
            message = message.partition("\n")[2]  # before it the wrapper says where
        self.messages.append(message)
        self.log.append((status, category, message))

    def _tell(self, _environment: Any, time: float, *rest: Any) -> None:
        *flags, requested, return_time = rest
        self.seen.append(tuple(flags))
        assert self._observer is not None
        until = self._observer(self, time)
        if until is not None:
            requested[0], return_time[0] = True, until

    def __del__(self) -> None:
        getattr(self.library.functions, f"fmi{self.library.fmi}FreeInstance")(c.c_void_p(self.pointer))

    def call(self, function: str, *arguments: Any) -> int:
        """A function of the instance, by its name and with its arguments in FMI 3.0 where it is there."""
        missing = _OTHERWISE[function][1] if self._two and function in _OTHERWISE else ()
        return self.invoke(function, *(a for i, a in enumerate(arguments) if i not in missing))

    def invoke(self, function: str, *arguments: Any) -> int:
        """The same with the arguments that it has in this version."""
        entry = getattr(self.library.functions, self.library.full(function))
        entry.argtypes = [c.c_void_p, *SIGNATURES[self.library.fmi][function]]
        before = len(self.log)
        status = entry(c.c_void_p(self.pointer), *arguments)
        if not self.library.python:
            return status
        # pythonfmu's wrapper knows OK and, of steps, Discard, of a start and of what is read after it, Fatal: what is
        # meant is in the log.
        refused = [entry[0] for entry in self.log[before:] if entry[0] >= DISCARD]
        expected = {"DoStep": DISCARD, "ExitInitializationMode": FATAL}.get(function, OK) if refused else OK
        assert status == (FATAL if FATAL in refused else expected)
        return min(refused[-1], ERROR) if refused else OK

    def do(self, function: str, *arguments: Any) -> None:
        """A call that is not refused."""
        self.expect(self.call(function, *arguments))

    def expect(self, status: int, expected: int | None = OK, message: str | None = None) -> int:
        """The status, which is the expected one (None: any), and said in this message alone."""
        assert expected in (None, status), self.messages
        if message is not None:
            assert self.messages == [message]
            self.messages.clear()
        return status

    def refuse(self, message: str, function: str, *arguments: Any, status: int = ERROR) -> None:
        """A call that is refused with this message alone, in which {} is the name of the function."""
        self.expect(self.call(function, *arguments), status, message.format(self.library.full(function)))

    def flags(self, n: int) -> Any:
        """What n booleans are written to."""
        return ((c.c_int if self._two else c.c_bool) * n)(*[True] * n)

    # ---- variables

    def refs(self, names: Iterable[str]) -> Any:
        found = [self.library.references[element] for name in names for element in self.library.elements(name)]
        return (c.c_uint * len(found))(*found)

    def set(self, values: Mapping[str, ArrayLike] | None = None, /, *expected: Any, **more: ArrayLike) -> int:
        """Numbers, or columns of them for arrays."""
        values = {**(values or {}), **more}
        flat = [number for value in values.values() for number in np.ravel(value).tolist()]
        references = self.refs(values)
        return self.expect(self.call("SetFloat64", references, len(references), reals(flat), len(flat)), *expected)

    def read(self, *names: str) -> tuple[int, NDArray]:
        """Status, and the numbers of all variables, one behind the other."""
        values, references = (c.c_double * self.library.count(*names))(), self.refs(names)
        status = self.call("GetFloat64", references, len(references), values, len(values))
        return status, np.array(values)

    def get(self, *names: str) -> NDArray:
        status, values = self.read(*names)
        self.expect(status)
        return values

    def __getitem__(self, name: str) -> float:
        return float(self.get(name)[0])

    def set_integer(self, name: str, value: int, *expected: Any) -> int:
        return self.expect(self.call("SetInt32", self.refs([name]), 1, (c.c_int32 * 1)(value), 1), *expected)

    def get_integer(self, name: str) -> int:
        value = (c.c_int32 * 1)()
        self.do("GetInt32", self.refs([name]), 1, value, 1)
        return value[0]

    # ---- derivatives

    def directional(self, unknowns: Sequence[str], known: Mapping[str, ArrayLike]) -> NDArray:
        """J v, of all unknowns one behind the other."""
        return self._derivative("GetDirectionalDerivative", unknowns, list(known), known.values(), unknowns)

    def adjoint(self, unknowns: Mapping[str, ArrayLike], knowns: Sequence[str]) -> NDArray:
        """wᵀ J, of all knowns one behind the other."""
        return self._derivative("GetAdjointDerivative", list(unknowns), knowns, unknowns.values(), knowns)

    def _derivative(
        self, function: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Any, sought: Sequence[str]
    ) -> NDArray:
        unknown, known, result = self.refs(unknowns), self.refs(knowns), (c.c_double * self.library.count(*sought))()
        given = reals(np.concatenate([np.ravel(v) for v in seed]).tolist())
        self.do(function, unknown, len(unknown), known, len(known), given, len(given), result, len(result))
        return np.array(result)

    def output_derivatives(self, *names: str) -> NDArray:
        """Of first order."""
        references, values = self.refs(names), (c.c_double * self.library.count(*names))()
        orders = (c.c_int32 * len(references))(*[1] * len(references))
        self.do("GetOutputDerivatives", references, len(references), orders, values, len(values))
        return np.array(values)

    # ---- life

    def initialize(
        self, tolerance: float | None = None, start: float = 0.0, stop: float | None = None, *expected: Any
    ) -> int:
        """Into initialization mode."""
        given = (tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0)
        if self._two:
            status = self.call("SetupExperiment", *given) or self.call("EnterInitializationMode")
        else:
            status = self.call("EnterInitializationMode", *given)
        return self.expect(status, *expected)

    def exit_initialization(self, *expected: Any) -> int:
        return self.expect(self.call("ExitInitializationMode"), *expected)

    def step(self, time: float, size: float, *expected: Any) -> int:
        return self.expect(self.advance(time, size).status, *expected)

    def advance(self, time: float, size: float) -> Step:
        """fmi3DoStep; in FMI 2.0 what says the same."""
        flags, reached = (c.c_bool * 3)(), c.c_double()
        pointers = [c.cast(c.byref(flags, i), BOOL) for i in range(3)]
        status = self.call("DoStep", time, size, True, *pointers, c.byref(reached))
        if self._two and status in (OK, DISCARD) and not self.library.python:
            self.do("GetRealStatus", 2, c.byref(reached))
        return Step(status, flags[0], flags[2], reached.value)

    def follow(
        self,
        size: float,
        count: int,
        inputs: Callable[[float], Mapping[str, ArrayLike]] | None = None,
        *,
        first: int = 0,
        ahead: bool = False,
    ) -> None:
        """Equal steps; before each, the inputs of its beginning are set, ahead those of its end."""
        for i in range(first, first + count):
            if inputs:
                self.set(inputs((i + ahead) * size))
            self.step(i * size, size)

    def update(self) -> Event:
        """fmi3UpdateDiscreteStates, fmi2NewDiscreteStates."""
        info, flags = _EventInfo(), (c.c_bool * 5)()
        pointers = [c.cast(c.byref(flags, i), BOOL) for i in range(5)]
        if self._two:
            self.do("NewDiscreteStates", c.byref(info))
            flags[:] = [bool(flag) for flag in (info.again, info.end, info.nominals, info.states, info.timed)]
        else:
            time = c.cast(c.byref(info, _EventInfo.time.offset), REALS)
            self.do("UpdateDiscreteStates", *pointers, time)
        assert list(flags[:3]) == [False, False, False]
        return Event(flags[3], info.time if flags[4] else None)

    def go_on(self) -> Event:
        """From event mode into continuous-time mode, or in co-simulation into step mode."""
        event = self.update()
        self.do("EnterContinuousTimeMode" if self._exchanges else "EnterStepMode")
        return event

    def vector(self, function: str, n: int) -> NDArray:
        values = (c.c_double * n)()
        self.do(function, values, n)
        return np.array(values)

    # ---- saved states

    def save(self) -> c.c_void_p:
        state = c.c_void_p()
        self.do("GetFMUState", c.byref(state))
        return state

    def restore(self, state: c.c_void_p, /, *expected: Any) -> int:
        return self.expect(self.call("SetFMUState", state), *expected)

    def drop(self, state: c.c_void_p) -> None:
        self.do("FreeFMUState", c.byref(state))
        assert state.value is None or self.library.python

    def serialize(self) -> bytes:
        state, size = self.save(), N()
        self.do("SerializedFMUStateSize", state, c.byref(size))
        content = c.create_string_buffer(size.value)
        self.do("SerializeFMUState", state, content, size)
        self.drop(state)
        return content.raw

    def deserialize(self, content: bytes, /, *expected: Any) -> int:
        state = c.c_void_p()
        status = self.call("DeserializeFMUState", content, len(content), c.byref(state)) or self.restore(state, None)
        self.call("FreeFMUState", c.byref(state))
        return self.expect(status, *expected)


def reals(values: Iterable[float]) -> Any:
    listed = list(values)
    return (c.c_double * len(listed))(*listed)
