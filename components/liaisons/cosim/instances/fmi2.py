"""One running FMU on fmpy: from instantiation to release, with calls that cost little more than the call.

The run of a system uses the public methods of :class:`Instance` only, so an instance of another FMI version can stand
in its place.  An instance is asked only for what its :class:`Fmu` says it can.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import CFUNCTYPE, Array, addressof, byref, c_double, c_int, c_size_t, c_uint, c_void_p, cast
from functools import cache, cached_property, lru_cache
from itertools import count
from pathlib import Path
from typing import Any, final

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2True,
)
from fmpy.logging import addLoggerProxy

from liaisons.cosim.calls import Call, Kind, Prepared
from liaisons.cosim.description import Fmu
from liaisons.cosim.messages import COMPLAINTS, ERROR, FATAL, Action, Messages, logger
from liaisons.cosim.variables import Array as Elements
from liaisons.cosim.variables import Scalar
from liaisons.errors import SimulationError

_FUNCTION: dict[Action, str] = {
    "set": "fmi2SetReal",
    "step": "fmi2DoStep",
    "get": "fmi2GetReal",
    "save": "fmi2GetFMUstate",
    "restore": "fmi2SetFMUstate",
    "derive": "fmi2GetDirectionalDerivative",
    "shape": "fmi2SetRealInputDerivatives",
    "slope": "fmi2GetRealOutputDerivatives",
}

_YES = c_int(fmi2True)
_handles = count(1)
_instances: dict[int, Instance2] = {}


@final
class Instance2:
    """An FMI 2.0 co-simulation instance; a context manager that terminates, frees and unloads it.

    :param name: name of the component, used as instance name and in messages.
    :param fmu: what was read from its file.
    :param directory: where that file was extracted.
    :raises SimulationError: if the library cannot be loaded or refuses to make an instance.
    """

    def __init__(self, name: str, fmu: Fmu, directory: Path) -> None:
        self.name = name
        self.messages = Messages(name)
        self._fmu = fmu
        self._initialized = False
        self._saved: list[c_void_p] = []
        self._slave = _load(name, fmu, directory)
        self._handle = next(_handles)
        _instances[self._handle] = self
        try:
            self._slave.instantiate(callbacks=_callbacks(self._handle), loggingOn=True)
        except Exception as error:  # fmpy raises the base class
            self.close()
            raise SimulationError(f"{name}: {fmu.path.name} cannot be instantiated{self.messages.words()}") from error
        # loggingOn asks for everything; only what comes with a status is of use
        categories = [category for category in COMPLAINTS if category in fmu.log_categories]
        with suppress(FMICallException):
            self._slave.setDebugLogging(True, categories)

    def __enter__(self) -> Instance2:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def setup(self, tolerance: float | None, start_time: float, stop_time: float) -> None:
        """Announce tolerance (None: the FMU's own), start and stop time [s]."""
        self._call("setupExperiment", tolerance, start_time, stop_time)

    def assign(self, name: str, value: Any) -> None:
        """Set a start value as :func:`liaisons.cosim.description.start_values` returned it."""
        references = list(self._fmu.references(name))
        entry = self._fmu.variables.entries.get(name)
        base = entry.like.base if isinstance(entry, Elements) else self._fmu.variables[name].base
        values = list(value) if isinstance(value, tuple) else [value]
        shown = f" of {name} = {value}" if len(values) == 1 else f" of {name} ({len(values)} values)"
        self._call(f"set{base}", references, values, about=shown)

    def enter_initialization(self) -> None:
        self._call("enterInitializationMode")

    def exit_initialization(self) -> None:
        self._call("exitInitializationMode")
        self._initialized = True

    def getter(self, variables: Sequence[Scalar], values: Array[c_double]) -> Call:
        """A call that reads these reals into a buffer of as many values."""
        return self._transfer("get", variables, values)

    def setter(self, variables: Sequence[Scalar], values: Array[c_double]) -> Call:
        """A call that sets these reals from a buffer of as many values."""
        return self._transfer("set", variables, values)

    def stepper(self, time: c_double, size: c_double) -> Call:
        """A call that steps by the size from the time that stand in the two buffers then [s]."""
        call = self._prepared("step", time, size, _YES)
        return call.recorded(Kind.STEP_2, function=call.func, instance=self._pointer.value)

    def states(self) -> tuple[Call, Call]:
        """Two calls, one that saves the state of the FMU, and one that brings this state back, as often as wanted."""
        state = c_void_p()
        self._saved.append(state)
        return self._prepared("save", byref(state)), self._prepared("restore", state)

    def directional(
        self, unknowns: Sequence[Scalar], knowns: Sequence[Scalar], seed: Array[c_double], values: Array[c_double]
    ) -> Call:
        """A call that calculates how the unknowns change with the knowns, which change like the seed."""
        return self._prepared("derive", *_references(unknowns), *_references(knowns), seed, values)

    def input_derivatives(self, variables: Sequence[Scalar], orders: Sequence[int], values: Array[c_double]) -> Call:
        """A call that sets derivatives of inputs at the begin of the next step from a buffer of as many values."""
        return self._prepared("shape", *_references(variables), (c_int * len(orders))(*orders), values)

    def output_derivatives(self, variables: Sequence[Scalar], orders: Sequence[int], values: Array[c_double]) -> Call:
        """A call that reads derivatives of outputs into a buffer of as many values."""
        return self._prepared("slope", *_references(variables), (c_int * len(orders))(*orders), values)

    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        """The error that says which prepared call failed and when, with the FMU's own words."""
        return self.messages.failure(_FUNCTION[action], status, when)

    def close(self) -> None:
        """Terminate, free and unload, as far as the state of the instance allows; safe to repeat."""
        if _instances.pop(self._handle, None) is None:
            return
        with suppress(AttributeError):
            # pythonfmu 0.7 stays loaded, and at the end of the process frees its interpreter twice, unless it has let
            # go of it before; it takes hold of it again when it is needed
            self._slave.dll.finalizePythonInterpreter()
        if self.messages.worst == FATAL:  # then FMI forbids every call, the release included
            return
        if self._initialized and self.messages.worst < ERROR:
            try:
                self._slave.terminate()
            except FMICallException as error:
                logger.warning("%s: %s", self.name, error)
        if self._slave.component is None:
            self._slave.freeLibrary()
            return
        for state in self._saved:
            if state:
                self._function("fmi2FreeFMUstate")(self._pointer, byref(state))
        self._slave.freeInstance()

    def _call(self, method: str, *arguments: object, about: str = "") -> None:
        try:
            getattr(self._slave, method)(*arguments)
        except FMICallException as error:
            raise self.messages.failure(error.function, error.status, about) from None

    def _transfer(self, action: Action, variables: Sequence[Scalar], values: Array[c_double]) -> Call:
        references, count = _references(variables)
        call = self._prepared(action, references, count, values)
        return call.recorded(
            Kind.TRANSFER_2,
            function=call.func,
            instance=self._pointer.value,
            given=addressof(references),
            count=len(variables),
            values=addressof(values),
        )

    def _prepared(self, action: Action, *arguments: object) -> Prepared:
        return Prepared(self._function(_FUNCTION[action]), self._pointer, *arguments)

    def _function(self, name: str) -> Callable[..., int]:
        # a function object of our own: fmpy declares argument types on its
        return shared_function(cast(self._slave.dll[name], c_void_p).value or 0)

    @cached_property
    def _pointer(self) -> c_void_p:
        address: Any = self._slave.component  # an int, whatever fmpy declares
        return c_void_p(address)


def _references(variables: Sequence[Scalar]) -> tuple[Array[c_uint], c_size_t]:
    return _numbers(tuple(variable.reference for variable in variables))


@lru_cache(maxsize=1024)
def _numbers(references: tuple[int, ...]) -> tuple[Array[c_uint], c_size_t]:
    """Shared by all instances, as functions are: what a thousand of them have in common stays in the cache."""
    return (c_uint * len(references))(*references), c_size_t(len(references))


@cache
def shared_function(address: int) -> Callable[..., int]:
    """The function at an address, without argument types: those would make every call convert its arguments."""
    return CFUNCTYPE(c_int)(address)


def _load(name: str, fmu: Fmu, directory: Path) -> FMU2Slave:
    here = Path.cwd()
    try:
        return FMU2Slave(
            guid=fmu.guid,
            modelIdentifier=fmu.identifier,
            unzipDirectory=str(directory),
            instanceName=name,
            libraryPath=str(directory / fmu.binary),
        )
    except Exception as error:  # fmpy raises the base class
        raise SimulationError(f"{name}: the library of {fmu.path.name} cannot be loaded: {error}") from error
    finally:
        os.chdir(here)  # fmpy stays in the library's directory when loading fails


@fmi2CallbackLoggerTYPE
def _log(environment: int | None, name: bytes | None, status: int, _category: bytes, message: bytes | None) -> None:
    instance = _instances.get(environment or 0)
    if instance is None:  # an FMU that does not hand the environment back
        instance = next((i for i in _instances.values() if i.name.encode() == name), None)
    if instance is not None:
        instance.messages.note(status, message)


_allocate = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
_release = fmi2CallbackFreeMemoryTYPE(fmpy.free)


def _callbacks(handle: int) -> fmi2CallbackFunctions:
    callbacks = fmi2CallbackFunctions(_log, _allocate, _release, componentEnvironment=handle)
    # The proxy formats the variadic message.  It remembers one logger for the whole process, the last that was added:
    # hence one logger for all instances, told apart by the environment, and added anew each time.
    addLoggerProxy(byref(callbacks))
    return callbacks
