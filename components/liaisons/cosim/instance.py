"""One running FMU on fmpy: from instantiation to release, with calls that cost little more than the call.

The run of a system (:mod:`liaisons.cosim.execution`) uses the public methods of :class:`Instance` only, so an
instance of another FMI version can stand in its place.
"""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from ctypes import Array, byref, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Literal, final

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

from liaisons.cosim.description import Fmu, Variable
from liaisons.errors import SimulationError

Call = Callable[[], int | None]
"""A prepared call without arguments; returns an FMI status, or None where there can be none."""

Action = Literal["set", "step", "get"]

WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_FUNCTION: dict[Action, str] = {"set": "fmi2SetReal", "step": "fmi2DoStep", "get": "fmi2GetReal"}
_COMPLAINTS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")

_logger = logging.getLogger("liaisons.cosim")
_handles = count(1)
_instances: dict[int, Instance] = {}


@final
class Instance:
    """An FMI 2.0 co-simulation instance; a context manager that terminates, frees and unloads it.

    :param name: name of the component, used as instance name and in messages.
    :param fmu: what was read from its file.
    :param directory: where that file was extracted.
    :raises SimulationError: if the library cannot be loaded or refuses to make an instance.
    """

    def __init__(self, name: str, fmu: Fmu, directory: Path) -> None:
        self.name = name
        self._messages: deque[tuple[int, str]] = deque(maxlen=20)
        self._initialized = False
        self._worst = 0
        self._slave = _load(name, fmu, directory)
        self._handle = next(_handles)
        _instances[self._handle] = self
        try:
            self._slave.instantiate(callbacks=_callbacks(self._handle), loggingOn=True)
        except Exception as error:  # fmpy raises the base class
            self.close()
            raise SimulationError(f"{name}: {fmu.path.name} cannot be instantiated{self._words()}") from error
        # loggingOn asks for everything; only what comes with a status is of use
        categories = [category for category in _COMPLAINTS if category in fmu.log_categories]
        with suppress(FMICallException):
            self._slave.setDebugLogging(True, categories)

    def __enter__(self) -> Instance:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def setup(self, tolerance: float | None, start_time: float, stop_time: float) -> None:
        """Announce tolerance (None: the FMU's own), start and stop time [s]."""
        self._call("setupExperiment", tolerance, start_time, stop_time)

    def assign(self, variable: Variable, value: Any) -> None:
        """Set a start value, of the type that :func:`liaisons.cosim.description.start_value` returns."""
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        self._call(f"set{kind}", [variable.reference], [value], about=f" of {variable.name} = {value}")

    def enter_initialization(self) -> None:
        self._call("enterInitializationMode")

    def exit_initialization(self) -> None:
        self._call("exitInitializationMode")
        self._initialized = True

    def getter(self, references: Iterable[int], values: Array[c_double]) -> Call:
        """A call that reads these reals into a buffer of as many values."""
        return self._transfer(_FUNCTION["get"], references, values)

    def setter(self, references: Iterable[int], values: Array[c_double]) -> Call:
        """A call that sets these reals from a buffer of as many values."""
        return self._transfer(_FUNCTION["set"], references, values)

    def stepper(self, time: c_double, size: c_double) -> Call:
        """A call that steps by the size from the time that stand in the two buffers then [s]."""
        return partial(self._function(_FUNCTION["step"]), self._pointer(), time, size, c_int(fmi2True))

    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        """The error that says which prepared call failed and when, with the FMU's own words."""
        return self._failure(_FUNCTION[action], status, when)

    def _failure(self, function: str, status: int, about: str) -> SimulationError:
        self._worst = max(self._worst, status)
        label = _STATUS[status] if status in range(len(_STATUS)) else str(status)
        return SimulationError(f"{self.name}: {function}{about} returned {label}{self._words()}")

    def close(self) -> None:
        """Terminate, free and unload, as far as the state of the instance allows; safe to repeat."""
        if _instances.pop(self._handle, None) is None:
            return
        with suppress(AttributeError):
            # pythonfmu 0.7 stays loaded, and at the end of the process frees its interpreter twice, unless it has let
            # go of it before; it takes hold of it again when it is needed
            self._slave.dll.finalizePythonInterpreter()
        if self._worst == FATAL:  # then FMI forbids every call, the release included
            return
        if self._initialized and self._worst < ERROR:
            try:
                self._slave.terminate()
            except FMICallException as error:
                _logger.warning("%s: %s", self.name, error)
        if self._slave.component is None:
            self._slave.freeLibrary()
        else:
            self._slave.freeInstance()

    def note(self, status: int, message: str) -> None:
        """Keep what the FMU logs; a new warning goes to the ``logging`` channel ``liaisons.cosim``, too."""
        if (status, message) not in self._messages:
            self._messages.append((status, message))
            _logger.log(logging.WARNING if status == WARNING else logging.DEBUG, "%s: %s", self.name, message)

    def _call(self, method: str, *arguments: object, about: str = "") -> None:
        try:
            getattr(self._slave, method)(*arguments)
        except FMICallException as error:
            raise self._failure(error.function, error.status, about) from None

    def _transfer(self, function: str, references: Iterable[int], values: Array[c_double]) -> Call:
        size = len(values)
        return partial(self._function(function), self._pointer(), (c_uint * size)(*references), c_size_t(size), values)

    def _function(self, name: str) -> Callable[..., int]:
        # a function object of our own: fmpy declares argument types on its, which makes every call convert them
        return self._slave.dll[name]

    def _pointer(self) -> c_void_p:
        address: Any = self._slave.component  # an int, whatever fmpy declares
        return c_void_p(address)

    def _words(self) -> str:
        """The FMU's complaints, else the last thing it said."""
        complaints = dict.fromkeys(message for status, message in self._messages if status >= DISCARD)
        said = list(complaints) or [message for _, message in self._messages][-1:]
        return f": {'; '.join(said)}" if said else " without a message"


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
        instance.note(status, (message or b"").decode(errors="replace").strip())


_allocate = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
_release = fmi2CallbackFreeMemoryTYPE(fmpy.free)


def _callbacks(handle: int) -> fmi2CallbackFunctions:
    callbacks = fmi2CallbackFunctions(_log, _allocate, _release, componentEnvironment=handle)
    # The proxy formats the variadic message.  It remembers one logger for the whole process, the last that was added:
    # hence one logger for all instances, told apart by the environment, and added anew each time.
    addLoggerProxy(byref(callbacks))
    return callbacks
