"""Instances of FMUs in this process, the part that FMI 2.0 and 3.0 share.

They use subclasses of FMPy's classes, whose instances share the functions of their library.

FMPy looks up every function of FMI for each instance, which takes a millisecond and 50 kB, and refuses a library that
lacks one.  Here the instances of a library share the functions, and a missing one raises its error when it is called.
"""

from __future__ import annotations

import logging
import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir, suppress
from ctypes import CDLL, CFUNCTYPE, byref, c_double, c_int, c_uint32, c_void_p, cast
from functools import cache, partial
from pathlib import Path
from threading import RLock
from typing import Any, ClassVar, final

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from liaisons.base.logs import logger
from liaisons.cosim.compiled.calls import (
    DISCARD,
    ERROR,
    FATAL,
    RESTORE,
    SAVE,
    STATUSES,
    SUCCESS,
    WARNING,
    Action,
    Call,
    Numbers,
    pointer_to,
)
from liaisons.cosim.instances.buffer_layouts import (
    BufferLayout,
    Transfer,
    counted_buffer,
    layouts_by_type,
    value_references,
)
from liaisons.cosim.instances.protocol import Instance, Scalars
from liaisons.errors import EndedError, RefusedError, SimulationError, one_line
from liaisons.fmu_files import Fmu, Starts

COMPLAINTS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
"""FMI's standard log categories of statuses that are not OK."""

_MESSAGES_KEPT, _LONGEST_MESSAGE = 20, 10_000  # messages, and bytes that are read of each
_MOST_WARNINGS = 100  # that are shown
_ROUNDING = 1e-6  # relative to a communication step
_lock = RLock()


@final
class _Library(CDLL):
    """A library in which a missing function raises an error when it is called, not when it is looked up.

    :ivar functions: those of FMI, by name, as FMPy calls them.
    :ivar users: number of instances.
    """

    def __init__(self, library: CDLL) -> None:
        super().__init__(library._name, handle=library._handle)  # noqa: SLF001 - ctypes has no other way
        self.functions: dict[str, Any] = {}
        self.users = 0

    def __getattr__(self, name: str) -> Any:
        try:
            return super().__getattr__(name)
        except AttributeError as error:
            return _raising_function(str(error))


def _raising_function(message: str) -> Callable[..., Any]:
    """Function that raises an AttributeError, for one that a library lacks."""

    def call(*_: object) -> None:
        raise AttributeError(message)

    return call


_libraries: dict[tuple[type, int | None], _Library] = {}


class SharedFunctions:
    """Shares the functions of a library among its instances."""

    dll: CDLL
    _functions: dict[str, Any]

    def _loadFunctions(self) -> None:  # noqa: N802 - FMPy's name
        """Set the functions of the library, which FMPy looks up for its first instance."""
        key = type(self), self.dll._handle  # noqa: SLF001 - likewise
        library = _libraries.get(key) or _Library(self.dll)
        self.dll, self._functions = library, library.functions
        if key not in _libraries:
            super()._loadFunctions()  # type: ignore[misc] - of the FMPy class beside this one
            _libraries[key] = library
        library.users += 1

    def freeLibrary(self) -> None:  # noqa: N802 - likewise
        """Unload the library, once for each instance."""
        assert isinstance(self.dll, _Library)
        with _lock:
            self.dll.users -= 1
            if not self.dll.users:
                del _libraries[type(self), self.dll._handle]  # noqa: SLF001 - likewise
            super().freeLibrary()  # type: ignore[misc] - likewise


# the first four characters of a name tell FMPy the version


@final
class FMU2CoSimulation(SharedFunctions, FMU2Slave):
    """A Co-Simulation FMU of FMI 2.0."""


@final
class FMU3CoSimulation(SharedFunctions, FMU3Slave):
    """A Co-Simulation FMU of FMI 3.0."""


def load_fmu(fmpy_class: Callable[..., Any], name: str, fmu: Fmu, directory: Path) -> Any:
    """Load the library of an FMU; returns the object of FMPy, not yet instantiated.

    :param fmpy_class: a class of FMPy with :class:`SharedFunctions`.
    :param name: instance name.
    :param directory: folder of the extracted FMU.
    :raises OSError: if the library cannot be loaded.
    """
    folder = directory.resolve()
    paths = {"unzipDirectory": str(folder), "libraryPath": str(folder / fmu.binary)}
    with _lock, chdir("."):  # FMPy loads in the folder of the library, and stays there if that fails
        try:
            return fmpy_class(guid=fmu.guid, modelIdentifier=fmu.identifier, instanceName=name, **paths)
        except Exception as error:  # FMPy raises nothing more specific
            raise OSError(error.__context__ or error) from error


class Loaded(Instance):
    """An instance in this process.

    FMPy loads, instantiates, initializes, terminates and frees it.  The prepared calls of the loop take the addresses
    of the same functions, without argument types: FMPy converts the arguments of every call and looks its function up,
    and a prepared call costs little more than the function.

    :param name: name of the component, used as instance name and in messages.
    :param fmu: description of the FMU.
    :param directory: folder of the extracted FMU.
    :ivar fmpy_instance: object of FMPy for the FMU.
    :raises SimulationError: if the library cannot be loaded or refuses to make an instance.
    """

    prefix: ClassVar[str]
    fmpy_class: ClassVar[Callable[..., Any]]
    types: ClassVar[Mapping[str, Any]]
    flag: ClassVar[Any]
    takes_size: ClassVar[bool]  # whether functions that get and set take the number of values
    transfer_kind: ClassVar[int]  # kind of the records of calls that get and set

    def __init__(self, name: str, fmu: Fmu, directory: Path) -> None:
        self.name = name
        self._fmu = fmu
        self._worst_status = self._warnings = 0
        self._messages: deque[tuple[int, str]] = deque(maxlen=_MESSAGES_KEPT)
        self._initialized = self._closed = False
        self._span: tuple[c_double, c_double] | None = None  # begin and size of the step under way [s]
        self._states: list[c_void_p] = []
        self._functions: dict[str, Callable[..., int]] = {}
        try:
            self.fmpy_instance = load_fmu(self.fmpy_class, name, fmu, directory)
        except OSError as error:
            raise SimulationError(f"{name}: the library of {fmu.path.name} cannot be loaded: {error}") from error
        # loggingOn enables all categories; those of OK are not used
        categories = [*filter(fmu.log_categories.__contains__, COMPLAINTS)]
        try:
            self._instantiate()
            if categories:
                with suppress(FMICallException):
                    self.fmpy_instance.setDebugLogging(True, categories)
        except AttributeError as error:
            self.close()
            words = f"{name}: the library of {fmu.path.name} is not one of FMI {fmu.version}.0: {error}"
            raise SimulationError(words) from error
        except Exception as error:  # FMPy raises nothing more specific
            self.close()
            raise SimulationError(f"{name}: {fmu.path.name} cannot be instantiated{self._message_text()}") from error
        self._pointer = c_void_p(self.fmpy_instance.component)

    @abstractmethod
    def _instantiate(self) -> None:
        """Instantiate the FMU by FMPy."""

    def initialize(self, starts: Starts, tolerance: float | None, start_time: float, stop_time: float) -> None:
        self._initialized, ends = False, math.isfinite(stop_time)
        experiment = tolerance is not None, tolerance or 0.0, start_time, ends, stop_time if ends else 0.0
        if self._fmu.version == 2:
            self._call("fmi2SetupExperiment", *experiment)
            experiment = ()
        structural = self._fmu.structural_parameters & starts.keys()
        if structural:
            self._call(f"{self.prefix}EnterConfigurationMode")
            for name in structural:
                self.assign(name, starts[name])
            self._call(f"{self.prefix}ExitConfigurationMode")
        for name, value in starts.items():
            if name not in structural:
                self.assign(name, value)
        self._call(f"{self.prefix}EnterInitializationMode", *experiment)

    def assign(self, name: str, value: Any) -> None:
        entry = self._fmu.variables.entry(name)
        base, references = entry.prototype.base, entry.references
        values = value if isinstance(value, tuple) else (value,)
        about = f" of {name} = {value}" if len(values) == 1 else f" of {name} ({len(values)} values)"
        texts = tuple(text.encode() for text in values) if base == "String" else values
        counted = (c_uint32 * len(references))(*references), len(references)
        sizes = [len(values)] if self.takes_size else []
        self._call(f"{self.prefix}Set{base}", *counted, (self.types[base] * len(values))(*texts), *sizes, about=about)

    def exit_initialization(self) -> None:
        self._call(f"{self.prefix}ExitInitializationMode")
        self._initialized = True

    def getter(self, variables: Scalars, values: Numbers) -> Call:
        return self._transfer("get", variables, values)

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        return self._transfer("set", variables, values)

    def _transfer(self, action: Action, variables: Scalars, values: Numbers) -> Call:
        """Call that gets or sets variables of any types, elements of arrays among them."""
        parts = layouts_by_type(self._fmu, variables, self.types)
        if len(parts) == 1 and parts[0].is_identity:
            return self._transfer_whole(action, parts[0], values)
        numbers = np.asarray(values)
        calls: list[Transfer] = []
        if action == "set":
            calls += [self._transfer_whole("get", part) for part in parts if not part.is_complete]
        for part in parts:
            copy = part.read_into if action == "get" else part.write_from
            calls.append(partial(copy, self._transfer_whole(action, part), numbers))
        return self._combined_call(action, calls, " or ".join(self._function_name(action, part) for part in parts))

    def _transfer_whole(self, action: Action, layout: BufferLayout, values: Numbers | None = None) -> Call:
        """Call that gets or sets whole variables of one type by the values, or by the buffer of the layout."""
        buffer = layout.buffer if values is None else pointer_to(values)
        references, name = value_references(layout.references), self._function_name(action, layout)
        arguments = *counted_buffer(references), *counted_buffer(buffer)[: 2 if self.takes_size else 1]
        call = self._call_of_function(name, action, self._function(name), self._pointer, *arguments)
        record = {"source": references, "count": len(references), "values": buffer, "size": len(buffer)}
        return call.set_record(self.transfer_kind, self._pointer.value, **record)

    def _function_name(self, action: Action, layout: BufferLayout) -> str:
        """Name of the FMI function that gets or sets the variables of a layout."""
        return f"{self.prefix}{action.capitalize()}{layout.base}"

    def _combined_call(self, action: Action, calls: Sequence[Transfer], function: str) -> Call:
        """Call that makes several calls in order, and returns the worst status."""
        return self._call_of_function(function, action, lambda: max((call() for call in calls), default=0))

    def _call_of_function(self, name: str, action: Action, function: Callable[..., int], *arguments: object) -> Call:
        """Call whose errors name another FMI function than that of the action."""
        return Call(function, *arguments).set_failure(action, lambda _, status, when: self._error(name, status, when))

    def save_and_restore_calls(self) -> tuple[Call, Call]:
        state = c_void_p()
        self._states.append(state)
        save, restore = self._prepare("save", byref(state)), self._prepare("restore", state)
        address = self._pointer.value
        return save.set_record(SAVE, address, values=state), restore.set_record(RESTORE, address, values=state)

    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        end = self._requested_end_time() if action == "step" and status == DISCARD else None
        if end is not None:
            begin, size = (number.value for number in self._span) if self._span else (end, 0.0)
            if not -_ROUNDING * size <= end - begin <= (1 + _ROUNDING) * size:  # nor is not-a-number
                end = begin
            return EndedError(f"{self.name} ends the simulation at t = {end:.10g} s", end)
        return self._error(self.functions[action], status, when)

    @abstractmethod
    def _requested_end_time(self) -> float | None:
        """Time [s] at which the FMU requests the end of the simulation, in the last step; None if it does not."""

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        self._close_private()
        if self._worst_status == FATAL:  # then FMI forbids every call, the release included
            return
        try:
            if self.fmpy_instance.component:
                self._release()
                return
        except AttributeError as error:
            logger.warning("%s: it cannot be released: %s", self.name, error)
        self.fmpy_instance.freeLibrary()

    def _release(self) -> None:
        """Terminate the FMU; free its saved states, the instance and the library."""
        if self._initialized and self._worst_status < ERROR:
            try:
                self.fmpy_instance.terminate()
            except FMICallException as error:
                logger.warning("%s: %s failed%s", self.name, error.function, self._message_text())
        for state in filter(None, self._states):
            with suppress(FMICallException):
                self.fmpy_instance.freeFMUState(state)
        self.fmpy_instance.freeInstance()

    def _close_private(self) -> None:
        """Release the resources of this instance that are not of FMPy."""

    def _log_message(self, status: int, message: bytes | None) -> None:
        """Store a message of the FMU, and log it to the channel ``liaisons.cosim`` if it is new."""
        entry = status, one_line((message or b"")[:_LONGEST_MESSAGE].decode(errors="replace").strip())
        if entry not in self._messages:
            self._messages.append(entry)
            self._warnings += status == WARNING
            shown = status == WARNING and self._warnings <= _MOST_WARNINGS
            more = "; further warnings from it are not shown" if self._warnings == _MOST_WARNINGS else ""
            logger.log(logging.WARNING if shown else logging.DEBUG, "%s: %s%s", self.name, entry[1], more)

    def _message_text(self) -> str:
        """The messages of the FMU with status Discard or worse, else its last message, as the end of an error."""
        complaints = dict.fromkeys(message for status, message in self._messages if status >= DISCARD)
        messages = list(complaints) or [message for _, message in self._messages][-1:]
        return f": {'; '.join(messages)}" if messages else " without a message"

    def _error(self, function: str, status: int, about: str) -> SimulationError:
        """Error for a status other than OK and Warning."""
        is_status = status in range(len(STATUSES))
        self._worst_status = max(self._worst_status, status) if is_status else FATAL
        label = STATUSES[status] if is_status else f"{status}, which is not a status of FMI"
        words = f"{self.name}: {function}{about} returned {label}{self._message_text()}"
        # after a roll-back, the next failure has its own messages
        self._messages = deque((entry for entry in self._messages if entry[0] < DISCARD), maxlen=_MESSAGES_KEPT)
        return (RefusedError if status in {DISCARD, ERROR} else SimulationError)(words)

    def _call(self, function: str, *arguments: object, about: str = "") -> None:
        """Call an FMI function by FMPy, which converts the arguments, and check the status.

        :raises SimulationError: for a status other than OK and Warning, and if the library lacks the function.
        """
        try:
            status = getattr(self.fmpy_instance, function)(self.fmpy_instance.component, *arguments)
        except FMICallException as error:
            status = error.status
        except AttributeError:
            raise self._missing_function_error(function) from None
        self._check(function, status, about)

    def _check(self, function: str, status: int, about: str = "") -> None:
        """Raise the error for a status of a function unless it is OK or Warning."""
        if status not in SUCCESS:  # to FMPy, a negative one is a success
            raise self._error(function, status, about)

    def _missing_function_error(self, function: str) -> SimulationError:
        words = f"the library of {self._fmu.path.name} has no function {function}; export it again"
        return SimulationError(f"{self.name}: {words}")

    def _prepare(self, action: Action, *arguments: object) -> Call:
        """Call of the FMI function of an action, with arguments behind the instance."""
        call = Call(self._function(self.functions[action]), self._pointer, *arguments)
        return call.set_failure(action, self.failure)

    def _function(self, name: str) -> Callable[..., int]:
        """The function of the library with a name, without argument types."""
        if name not in self._functions:
            try:
                self._functions[name] = _function_at(cast(self.fmpy_instance.dll[name], c_void_p).value or 0)
            except AttributeError:
                raise self._missing_function_error(name) from None
        return self._functions[name]


@cache
def _function_at(address: int) -> Callable[..., int]:
    """The function at an address, without argument types, shared by all instances."""
    return CFUNCTYPE(c_int)(address)
