"""A small FMI 2.0 importer on ctypes: calls return their status, what is logged is kept."""

from __future__ import annotations

import ctypes as c
import tempfile
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

OK, WARNING, DISCARD, ERROR = range(4)
MODEL_EXCHANGE, CO_SIMULATION = range(2)

_LOGGER = c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int, c.c_char_p, c.c_char_p)
_REFERENCES, _REALS, _INTEGERS = c.POINTER(c.c_uint), c.POINTER(c.c_double), c.POINTER(c.c_int)
_SIGNATURES = {
    "SetupExperiment": [c.c_int, c.c_double, c.c_double, c.c_int, c.c_double],
    "GetReal": [_REFERENCES, c.c_size_t, _REALS],
    "SetReal": [_REFERENCES, c.c_size_t, _REALS],
    "GetInteger": [_REFERENCES, c.c_size_t, _INTEGERS],
    "SetInteger": [_REFERENCES, c.c_size_t, _INTEGERS],
    "GetBoolean": [_REFERENCES, c.c_size_t, _INTEGERS],
    "SetString": [_REFERENCES, c.c_size_t, c.POINTER(c.c_char_p)],
    "GetDirectionalDerivative": [_REFERENCES, c.c_size_t, _REFERENCES, c.c_size_t, _REALS, _REALS],
    "SetRealInputDerivatives": [_REFERENCES, c.c_size_t, _INTEGERS, _REALS],
    "GetRealOutputDerivatives": [_REFERENCES, c.c_size_t, _INTEGERS, _REALS],
    "DoStep": [c.c_double, c.c_double, c.c_int],
    "GetFMUstate": [c.POINTER(c.c_void_p)],
    "SetFMUstate": [c.c_void_p],
    "FreeFMUstate": [c.POINTER(c.c_void_p)],
    "SerializedFMUstateSize": [c.c_void_p, c.POINTER(c.c_size_t)],
    "SerializeFMUstate": [c.c_void_p, c.c_char_p, c.c_size_t],
    "DeSerializeFMUstate": [c.c_char_p, c.c_size_t, c.POINTER(c.c_void_p)],
    "SetDebugLogging": [c.c_int, c.c_size_t, c.POINTER(c.c_char_p)],
    "GetRealStatus": [c.c_int, _REALS],
    "GetStatus": [c.c_int, _INTEGERS],
    "SetTime": [c.c_double],
    "SetContinuousStates": [_REALS, c.c_size_t],
    "GetContinuousStates": [_REALS, c.c_size_t],
    "GetDerivatives": [_REALS, c.c_size_t],
    "GetNominalsOfContinuousStates": [_REALS, c.c_size_t],
    "GetEventIndicators": [_REALS, c.c_size_t],
    "NewDiscreteStates": [c.c_void_p],
}


class Callbacks(c.Structure):
    _fields_ = (
        ("logger", _LOGGER),
        ("allocateMemory", c.c_void_p),
        ("freeMemory", c.c_void_p),
        ("stepFinished", c.c_void_p),
        ("componentEnvironment", c.c_void_p),
    )


class EventInfo(c.Structure):
    _fields_ = (
        ("newDiscreteStatesNeeded", c.c_int),
        ("terminateSimulation", c.c_int),
        ("nominalsOfContinuousStatesChanged", c.c_int),
        ("valuesOfContinuousStatesChanged", c.c_int),
        ("nextEventTimeDefined", c.c_int),
        ("nextEventTime", c.c_double),
    )


class Library:
    """The shared library of an FMU, and what its model description says."""

    def __init__(self, fmu: Path) -> None:
        self.path = fmu
        self.description = fmpy.read_model_description(str(fmu))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(fmu) as archive:
            name = self.description.modelName
            member = f"binaries/{fmpy.platform}/{name}{fmpy.sharedLibraryExtension}"
            self.functions = c.CDLL(archive.extract(member, folder))
        self.functions.fmi2Instantiate.restype = c.c_void_p

    def instantiate(self, kind: int = CO_SIMULATION, **options: Any) -> Instance:
        return Instance(self, kind, **options)

    def start(self, kind: int = CO_SIMULATION, *, tolerance: float | None = None, **values: float) -> Instance:
        """An instance that has left initialization mode; values by name, input_reconstruction among them."""
        instance = self.instantiate(kind)
        integers = {name: values.pop(name) for name in ("input_reconstruction",) if name in values}
        assert instance.setup(tolerance=tolerance) == OK
        assert instance.call("EnterInitializationMode") == OK
        for name, value in integers.items():
            assert instance.set_integer(name, int(value)) == OK
        assert instance.set(values) == OK
        assert instance.call("ExitInitializationMode") == OK, instance.messages
        return instance


class Instance:
    """One instance; freed with the object."""

    def __init__(
        self,
        library: Library,
        kind: int,
        *,
        name: bytes | None = b"it",
        guid: str | None = None,
        resources: str | None = None,
        logging: int = 0,
    ) -> None:
        self.library = library
        self.messages: list[str] = []
        self.log: list[tuple[int, str, str]] = []
        self._logger = _LOGGER(self._note)  # must live as long as the instance
        self._callbacks = Callbacks(self._logger)
        guid = guid or library.description.guid or ""
        self.component = library.functions.fmi2Instantiate(
            name, kind, guid.encode(), resources and resources.encode(), c.byref(self._callbacks), 0, logging
        )

    def _note(self, _environment: Any, _name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(message.decode())
        self.log.append((status, category.decode(), message.decode()))

    def __del__(self) -> None:
        self.library.functions.fmi2FreeInstance(c.c_void_p(self.component))

    def call(self, function: str, *arguments: Any) -> int:
        """A function of the instance by its name without fmi2."""
        entry = getattr(self.library.functions, f"fmi2{function}")
        entry.argtypes = [c.c_void_p, *_SIGNATURES.get(function, [])] if function in _SIGNATURES else None
        return entry(c.c_void_p(self.component), *arguments)

    def refs(self, names: Iterable[str]) -> Any:
        found = [self.library.references[name] for name in names]
        return (c.c_uint * len(found))(*found)

    def setup(self, tolerance: float | None = None, start: float = 0.0) -> int:
        return self.call("SetupExperiment", int(tolerance is not None), tolerance or 0.0, start, 0, 0.0)

    def set(self, values: Mapping[str, float] | None = None, /, **more: float) -> int:
        values = {**(values or {}), **more}
        return self.call("SetReal", self.refs(values), len(values), reals(values.values()))

    def get(self, *names: str) -> NDArray:
        values = (c.c_double * len(names))()
        assert self.call("GetReal", self.refs(names), len(names), values) == OK, self.messages
        return np.array(values)

    def __getitem__(self, name: str) -> float:
        return float(self.get(name)[0])

    def set_integer(self, name: str, value: int) -> int:
        return self.call("SetInteger", self.refs([name]), 1, (c.c_int * 1)(value))

    def step(self, time: float, size: float) -> int:
        return self.call("DoStep", time, size, 1)

    def derivative(self, unknowns: Iterable[str], known: Mapping[str, float]) -> NDArray:
        """Directional derivative of the unknowns along a direction of the known variables."""
        unknowns = list(unknowns)
        result = (c.c_double * len(unknowns))()
        direction = reals(known.values())
        status = self.call(
            "GetDirectionalDerivative",
            self.refs(unknowns),
            len(unknowns),
            self.refs(known),
            len(known),
            direction,
            result,
        )
        assert status == OK, self.messages
        return np.array(result)

    def vector(self, function: str, n: int) -> NDArray:
        values = (c.c_double * n)()
        assert self.call(function, values, n) == OK, self.messages
        return np.array(values)

    def save(self) -> c.c_void_p:
        state = c.c_void_p()
        assert self.call("GetFMUstate", c.byref(state)) == OK
        return state

    def serialize(self) -> bytes:
        state, size = self.save(), c.c_size_t()
        assert self.call("SerializedFMUstateSize", state, c.byref(size)) == OK
        content = c.create_string_buffer(size.value)
        assert self.call("SerializeFMUstate", state, content, size) == OK
        assert self.call("FreeFMUstate", c.byref(state)) == OK
        assert state.value is None
        return content.raw

    def deserialize(self, content: bytes) -> int:
        state = c.c_void_p()
        status = self.call("DeSerializeFMUstate", content, len(content), c.byref(state))
        if status == OK:
            status = self.call("SetFMUstate", state)
        self.call("FreeFMUstate", c.byref(state))
        return status

    def new_discrete_states(self) -> EventInfo:
        info = EventInfo()
        assert self.call("NewDiscreteStates", c.byref(info)) == OK
        return info


def reals(values: Iterable[float]) -> Any:
    listed = list(values)
    return (c.c_double * len(listed))(*listed)
