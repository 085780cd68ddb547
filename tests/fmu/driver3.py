"""A small FMI 3.0 importer on ctypes, like that of driver.py: calls return their status, what is logged is kept."""

from __future__ import annotations

import ctypes as c
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import numpy as np
from driver import OK, reals
from numpy.typing import ArrayLike, NDArray

_LOGGER = c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p)
_UPDATE = c.CFUNCTYPE(
    None,
    *(c.c_void_p, c.c_double, c.c_bool, c.c_bool, c.c_bool, c.c_bool),
    *(c.POINTER(c.c_bool), c.POINTER(c.c_double)),
)
REFERENCES, REALS, SIZES, BOOL = c.POINTER(c.c_uint), c.POINTER(c.c_double), c.POINTER(c.c_size_t), c.POINTER(c.c_bool)
N = c.c_size_t
TYPES = {
    "Float32": c.c_float,
    "Float64": c.c_double,
    **{f"{sign}Int{bits}": getattr(c, f"c_{sign.lower()}int{bits}") for sign in ("", "U") for bits in (8, 16, 32, 64)},
    "Boolean": c.c_bool,
    "String": c.c_char_p,
}
_DERIVATIVE = [REFERENCES, N, REFERENCES, N, REALS, N, REALS, N]
SIGNATURES: dict[str, list[Any]] = {
    **{f"{way}{name}": [REFERENCES, N, c.POINTER(t), N] for name, t in TYPES.items() for way in ("Get", "Set")},
    **{f"{way}Binary": [REFERENCES, N, SIZES, c.c_void_p, N] for way in ("Get", "Set")},
    **{f"{way}Clock": [REFERENCES, N, BOOL] for way in ("Get", "Set")},
    **{f"{way}{what}Decimal": [REFERENCES, N, REALS] for way in ("Get", "Set") for what in ("Interval", "Shift")},
    **{
        f"{way}{what}Fraction": [REFERENCES, N, c.c_void_p, c.c_void_p]
        for way in ("Get", "Set")
        for what in ("Interval", "Shift")
    },
    "GetIntervalDecimal": [REFERENCES, N, REALS, c.c_void_p],
    "GetIntervalFraction": [REFERENCES, N, c.c_void_p, c.c_void_p, c.c_void_p],
    "SetDebugLogging": [c.c_bool, N, c.POINTER(c.c_char_p)],
    "EnterInitializationMode": [c.c_bool, c.c_double, c.c_double, c.c_bool, c.c_double],
    "ExitInitializationMode": [],
    "EnterEventMode": [],
    "EnterStepMode": [],
    "EnterContinuousTimeMode": [],
    "EnterConfigurationMode": [],
    "ExitConfigurationMode": [],
    "EvaluateDiscreteStates": [],
    "Terminate": [],
    "Reset": [],
    "UpdateDiscreteStates": [*[BOOL] * 5, REALS],
    "GetNumberOfVariableDependencies": [c.c_uint, SIZES],
    "GetVariableDependencies": [c.c_uint, SIZES, REFERENCES, SIZES, c.c_void_p, N],
    "GetFMUState": [c.POINTER(c.c_void_p)],
    "SetFMUState": [c.c_void_p],
    "FreeFMUState": [c.POINTER(c.c_void_p)],
    "SerializedFMUStateSize": [c.c_void_p, SIZES],
    "SerializeFMUState": [c.c_void_p, c.c_char_p, N],
    "DeserializeFMUState": [c.c_char_p, N, c.POINTER(c.c_void_p)],
    "GetDirectionalDerivative": _DERIVATIVE,
    "GetAdjointDerivative": _DERIVATIVE,
    "CompletedIntegratorStep": [c.c_bool, BOOL, BOOL],
    "SetTime": [c.c_double],
    **{f"{n}ContinuousStates": [REALS, N] for n in ("Set", "Get", "GetNominalsOf")},
    "GetContinuousStateDerivatives": [REALS, N],
    "GetEventIndicators": [REALS, N],
    "GetNumberOfEventIndicators": [SIZES],
    "GetNumberOfContinuousStates": [SIZES],
    "GetOutputDerivatives": [REFERENCES, N, c.POINTER(c.c_int32), REALS, N],
    "DoStep": [c.c_double, c.c_double, c.c_bool, BOOL, BOOL, BOOL, REALS],
    "ActivateModelPartition": [c.c_uint, c.c_double],
}
"""Arguments behind the instance of every function that has one and returns a status."""

MODEL_EXCHANGE, CO_SIMULATION, SCHEDULED_EXECUTION = "ModelExchange", "CoSimulation", "ScheduledExecution"

Observer = Callable[["Instance3", float], float | None]
"""Called in intermediate update mode with the time; returns when to return early, or None."""


class Step(NamedTuple):
    status: int
    event: bool
    early: bool
    time: float


class Event(NamedTuple):
    states_changed: bool
    next_time: float | None


class Library3:
    """The shared library of an FMU, and what its model description says."""

    def __init__(self, fmu: Path) -> None:
        self.path = fmu
        self.description = fmpy.read_model_description(str(fmu))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.counts = {v.name: int(np.prod(v.shape)) if v.shape else 1 for v in self.description.modelVariables}
        with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(fmu) as archive:
            name = self.description.modelName
            member = f"binaries/{fmpy.platform_tuple}/{name}{fmpy.sharedLibraryExtension}"
            self.functions = c.CDLL(archive.extract(member, folder))
        for kind in (MODEL_EXCHANGE, CO_SIMULATION, SCHEDULED_EXECUTION):
            getattr(self.functions, f"fmi3Instantiate{kind}").restype = c.c_void_p

    def instantiate(self, kind: str = CO_SIMULATION, **options: Any) -> Instance3:
        return Instance3(self, kind, **options)

    def start(
        self, kind: str = CO_SIMULATION, /, *, tolerance: float | None = None, options: Any = None, **values: ArrayLike
    ) -> Instance3:
        """An instance that has left initialization mode; values by name, input_reconstruction among them."""
        instance = self.instantiate(kind, **(options or {}))
        mode = values.pop("input_reconstruction", None)
        assert instance.initialize(tolerance) == OK
        if mode is not None:
            assert instance.set_mode(mode) == OK
        assert instance.set(values) == OK
        assert instance.call("ExitInitializationMode") == OK, instance.messages
        return instance


class Instance3:
    """One instance; freed with the object."""

    def __init__(
        self,
        library: Library3,
        kind: str,
        *,
        name: bytes | None = b"it",
        token: str | None = None,
        resources: str | None = None,
        logging: bool = True,
        events: bool = False,
        early: bool = False,
        observer: Observer | None = None,
        wanted: Iterable[str] = (),
    ) -> None:
        self.library = library
        self.messages: list[str] = []
        self.log: list[tuple[int, str, str]] = []
        self._logger = _LOGGER(self._note)  # must live as long as the instance
        token = token or library.description.instantiationToken or ""
        folder = resources and resources.encode()
        arguments: list[Any] = [name, token.encode(), folder, c.c_bool(False), c.c_bool(logging)]
        if kind == CO_SIMULATION:
            references = self.refs(wanted)
            arguments += [c.c_bool(events), c.c_bool(early), references, N(len(references))]
        arguments += [None, self._logger]
        self.seen: list[tuple[bool, bool, bool, bool]] = []
        if kind == CO_SIMULATION:
            self._observer = observer
            self._update = _UPDATE(self._tell) if observer else _UPDATE()
            arguments.append(self._update)
        elif kind == SCHEDULED_EXECUTION:
            arguments += [None, None, None]
        self.pointer = getattr(library.functions, f"fmi3Instantiate{kind}")(*arguments)

    def _note(self, _environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(message.decode())
        self.log.append((status, category.decode(), message.decode()))

    def _tell(self, _environment: Any, time: float, *rest: Any) -> None:
        *flags, requested, return_time = rest
        self.seen.append(tuple(flags))
        assert self._observer is not None
        until = self._observer(self, time)
        if until is not None:
            requested[0], return_time[0] = True, until

    def __del__(self) -> None:
        self.library.functions.fmi3FreeInstance(c.c_void_p(self.pointer))

    def call(self, function: str, *arguments: Any) -> int:
        """A function of the instance by its name without fmi3."""
        entry = getattr(self.library.functions, f"fmi3{function}")
        entry.argtypes = [c.c_void_p, *SIGNATURES[function]]
        return entry(c.c_void_p(self.pointer), *arguments)

    def refs(self, names: Iterable[str]) -> Any:
        found = [self.library.references[name] for name in names]
        return (c.c_uint * len(found))(*found)

    def count(self, names: Iterable[str]) -> int:
        return sum(self.library.counts[name] for name in names)

    def initialize(self, tolerance: float | None = None, start: float = 0.0, stop: float | None = None) -> int:
        given = (tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0)
        return self.call("EnterInitializationMode", *given)

    def set(self, values: Mapping[str, ArrayLike] | None = None, /, **more: ArrayLike) -> int:
        """Numbers, or columns of them for arrays."""
        values = {**(values or {}), **more}
        flat = np.concatenate([np.ravel(v) for v in values.values()]) if values else np.zeros(0)
        return self.call("SetFloat64", self.refs(values), len(values), reals(flat.tolist()), flat.size)

    def get(self, *names: str) -> NDArray:
        """Numbers of all variables, one behind the other."""
        values = (c.c_double * self.count(names))()
        assert self.call("GetFloat64", self.refs(names), len(names), values, len(values)) == OK, self.messages
        return np.array(values)

    def __getitem__(self, name: str) -> float:
        return float(self.get(name)[0])

    def set_mode(self, mode: Any) -> int:
        return self.call("SetInt32", self.refs(["input_reconstruction"]), 1, (c.c_int32 * 1)(int(mode)), 1)

    def step(self, time: float, size: float) -> Step:
        flags, reached = (c.c_bool * 3)(), c.c_double()
        pointers = [c.cast(c.byref(flags, i), BOOL) for i in range(3)]
        status = self.call("DoStep", time, size, True, *pointers, c.byref(reached))
        return Step(status, flags[0], flags[2], reached.value)

    def update(self) -> Event:
        """fmi3UpdateDiscreteStates."""
        flags, time = (c.c_bool * 5)(), c.c_double()
        pointers = [c.cast(c.byref(flags, i), BOOL) for i in range(5)]
        assert self.call("UpdateDiscreteStates", *pointers, c.byref(time)) == OK, self.messages
        assert list(flags[:3]) == [False, False, False]
        return Event(flags[3], time.value if flags[4] else None)

    def directional(self, unknowns: Sequence[str], known: Mapping[str, ArrayLike]) -> NDArray:
        """J v, of all unknowns one behind the other."""
        seed = np.concatenate([np.ravel(v) for v in known.values()])
        return self._derivative("GetDirectionalDerivative", unknowns, list(known), seed, self.count(unknowns))

    def adjoint(self, unknowns: Mapping[str, ArrayLike], knowns: Sequence[str]) -> NDArray:
        """wᵀ J, of all knowns one behind the other."""
        seed = np.concatenate([np.ravel(v) for v in unknowns.values()])
        return self._derivative("GetAdjointDerivative", list(unknowns), knowns, seed, self.count(knowns))

    def _derivative(
        self, function: str, unknowns: Sequence[str], knowns: Sequence[str], seed: NDArray, size: int
    ) -> NDArray:
        result = (c.c_double * size)()
        variables = (self.refs(unknowns), len(unknowns), self.refs(knowns), len(knowns))
        assert self.call(function, *variables, reals(seed.tolist()), seed.size, result, size) == OK, self.messages
        return np.array(result)

    def vector(self, function: str, n: int) -> NDArray:
        values = (c.c_double * n)()
        assert self.call(function, values, n) == OK, self.messages
        return np.array(values)

    def save(self) -> c.c_void_p:
        state = c.c_void_p()
        assert self.call("GetFMUState", c.byref(state)) == OK
        return state

    def serialize(self) -> bytes:
        state, size = self.save(), c.c_size_t()
        assert self.call("SerializedFMUStateSize", state, c.byref(size)) == OK
        content = c.create_string_buffer(size.value)
        assert self.call("SerializeFMUState", state, content, size) == OK
        assert self.call("FreeFMUState", c.byref(state)) == OK
        return content.raw

    def deserialize(self, content: bytes) -> int:
        state = c.c_void_p()
        status = self.call("DeserializeFMUState", content, len(content), c.byref(state))
        if status == OK:
            status = self.call("SetFMUState", state)
        self.call("FreeFMUState", c.byref(state))
        return status
