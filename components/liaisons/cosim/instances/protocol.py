"""Instances of FMUs: their protocol, and what FMI 2.0 and 3.0 have in common."""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from ctypes import CFUNCTYPE, byref, c_double, c_int, c_uint32, c_void_p, cast
from functools import cache, partial
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from fmpy.fmi1 import FMICallException

from liaisons.cosim.arrays import Numbers, Vector, pointer_to
from liaisons.cosim.compiled.calls import RESTORE, SAVE, Action, Call, Failure
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.start_values import Starts
from liaisons.cosim.description.variables import Scalar
from liaisons.cosim.instances.buffer_layouts import BufferLayout, Transfer, buffered, layouts, value_references
from liaisons.cosim.instances.loading import FmpyInstance, load
from liaisons.cosim.messages import COMPLAINTS, DISCARD, ERROR, FATAL, STATUSES, SUCCESS, WARNING, logger
from liaisons.errors import EndedError, RefusedError, SimulationError, one_line

INTERMEDIATE_INSTANTS = 5
"""Instants in a step at which an FMU of ours takes inputs: its fifths, the end among them."""

Scalars = Sequence[Scalar]

_MESSAGES_KEPT, _LONGEST_MESSAGE = 20, 10_000  # messages, and bytes that are read of each
_MOST_WARNINGS = 100  # that are shown
_ROUNDING = 1e-6  # relative to a communication step


class Instance(ABC):
    """An instance of an FMU; a context manager that terminates and frees it.

    Callers use only the capabilities that its :class:`Fmu` declares.

    :ivar name: name of the part, used as instance name and in messages.
    :ivar functions: what FMI calls the functions of prepared calls.
    """

    name: str
    functions: ClassVar[Mapping[Action, str]]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def initialize(self, starts: Starts, tolerance: float | None, start_time: float, stop_time: float) -> None:
        """Enter initialization with these start values; tolerance None: the FMU's own.

        :param stop_time: [s]; infinite: none.
        """

    @abstractmethod
    def assign(self, name: str, value: Any) -> None:
        """Set a start value as :func:`liaisons.cosim.description.start_values.start_values` returned it."""

    @abstractmethod
    def exit_initialization(self) -> None:
        """Exit initialization; steps follow."""

    @abstractmethod
    def reset(self) -> None:
        """Prepare for the state from before initialization, which the caller restores next."""

    @abstractmethod
    def getter(self, variables: Scalars, values: Numbers) -> Call:
        """A call that reads variables into a buffer of as many values."""

    @abstractmethod
    def setter(self, variables: Scalars, values: Numbers) -> Call:
        """A call that sets variables from a buffer of as many values."""

    @abstractmethod
    def stepper(self, time: c_double, size: c_double) -> Call:
        """A call that makes a communication step from the time in one buffer, by the size in the other [s]."""

    @abstractmethod
    def save_and_restore_calls(self) -> tuple[Call, Call]:
        """Two calls: one saves the state of the FMU, the other restores it, any number of times."""

    def directional_derivatives(self, unknowns: Scalars, knowns: Scalars, seed: Numbers, values: Numbers) -> Call:
        """A call that multiplies the Jacobian of unknowns with respect to knowns by the seed.

        Only where :attr:`Fmu.provides_directional_derivatives` is true.
        """
        raise NotImplementedError

    def output_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        """A call that reads derivatives of outputs by time, each of its order, into a buffer of as many values.

        Only where :attr:`Fmu.output_derivative_order` is as high.
        """
        raise NotImplementedError

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        """A call that sets derivatives of inputs at the start of the next step from a buffer of as many values.

        Only where :attr:`Fmu.input_derivatives` is true.
        """
        raise NotImplementedError

    def prepare_intermediate_inputs(self, variables: Scalars, values: Vector) -> Call:
        """Set inputs inside each step; returns a call that is made before the step.

        Only where :attr:`Fmu.inside_inputs` is true and the instance was made to request intermediate updates.

        :param values: at the fifths of the step, shape (INTERMEDIATE_INSTANTS, len(variables)); may change any time.
        """
        raise NotImplementedError

    def prepared(self, action: Action, function: Callable[..., Any], *arguments: object) -> Call:
        """A call of a function, whose errors this instance makes."""
        return Call(function, *arguments).set_failure(action, self.failure)

    @abstractmethod
    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        """The error of a prepared call: function, time, status, and the messages of the FMU."""

    @abstractmethod
    def close(self) -> None:
        """Terminate and free it, as far as FMI allows in its state; safe to repeat."""


Instances = Mapping[str, Instance]
"""Instances by the names of their components."""


class Loaded(Instance):
    """An instance in this process.

    FMPy loads, instantiates, initializes, terminates and frees it.  The prepared calls of the loop take the addresses
    of the same functions, without argument types: FMPy converts the arguments of every call and looks its function up,
    and a prepared call costs little more than the function.

    :param name: name of the part, used as instance name and in messages.
    :param fmu: what was read from its file.
    :param directory: where that file was extracted.
    :ivar fmpy_instance: the FMU as an object of FMPy.
    :raises SimulationError: if the library cannot be loaded or refuses to make an instance.
    """

    prefix: ClassVar[str]
    fmpy_class: ClassVar[type[FmpyInstance]]
    types: ClassVar[Mapping[str, Any]]
    flag: ClassVar[Any]
    sized: ClassVar[bool]  # whether FMI's functions take the number of values
    transfer: ClassVar[int]  # kind of the calls that get and set

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
            self.fmpy_instance: Any = load(self.fmpy_class, name, fmu, directory)
        except OSError as error:
            raise SimulationError(f"{name}: the library of {fmu.path.name} cannot be loaded: {error}") from error
        # loggingOn enables all categories; those of OK are not used
        categories = [category for category in COMPLAINTS if category in fmu.log_categories]
        try:
            self._instantiate()
            if categories:
                with suppress(FMICallException):
                    self.fmpy_instance.setDebugLogging(True, categories)
        except AttributeError as error:
            self.close()
            words = f"{name}: the library of {fmu.path.name} is none of FMI {fmu.version}.0: {error}"
            raise SimulationError(words) from error
        except Exception as error:  # FMPy raises nothing more specific
            self.close()
            raise SimulationError(f"{name}: {fmu.path.name} cannot be instantiated{self._complaint()}") from error
        self._pointer = c_void_p(self.fmpy_instance.component)

    @abstractmethod
    def _instantiate(self) -> None:
        """Instantiate it by FMPy."""

    def initialize(self, starts: Starts, tolerance: float | None, start_time: float, stop_time: float) -> None:
        ends = math.isfinite(stop_time)
        experiment = tolerance is not None, tolerance or 0.0, start_time, ends, stop_time if ends else 0.0
        if self._fmu.version == 2:
            self._call("fmi2SetupExperiment", *experiment)
            experiment = ()
        structural = {name for name in starts if self._fmu.variables.entry(name).prototype.structural}
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
        sizes = [len(values)] if self.sized else []
        self._call(f"{self.prefix}Set{base}", *counted, (self.types[base] * len(values))(*texts), *sizes, about=about)

    def exit_initialization(self) -> None:
        self._call(f"{self.prefix}ExitInitializationMode")
        self._initialized = True

    def getter(self, variables: Scalars, values: Numbers) -> Call:
        return self._transfer("get", variables, values)

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        return self._transfer("set", variables, values)

    def _transfer(self, action: Action, variables: Scalars, values: Numbers) -> Call:
        parts = layouts(self._fmu, variables, self.types)
        if len(parts) == 1 and parts[0].direct:
            return self._transfer_whole(action, parts[0], values)
        numbers = np.asarray(values)
        calls: list[Transfer] = []
        if action == "set":
            calls += [self._transfer_whole("get", part) for part in parts if not part.whole]
        for part in parts:
            copy = part.read_into if action == "get" else part.write_from
            calls.append(partial(copy, self._transfer_whole(action, part), numbers))
        return self._combine(action, calls, " or ".join(self._function_name(action, part) for part in parts))

    def _transfer_whole(self, action: Action, layout: BufferLayout, values: Numbers | None = None) -> Call:
        """A call that reads or sets whole variables from these values, else by the buffer that they have."""
        buffer = layout.buffer if values is None else pointer_to(values)
        references, name = value_references(layout.references), self._function_name(action, layout)
        arguments = *buffered(references), *buffered(buffer)[: 2 if self.sized else 1]
        call = Call(self._function(name), self._pointer, *arguments).set_failure(action, self._failure_of(name))
        record = {"source": references, "count": len(references), "values": buffer, "size": len(buffer)}
        return call.set_record(self.transfer, self._pointer.value, **record)

    def _function_name(self, action: Action, layout: BufferLayout) -> str:
        """The name of the FMI function that gets or sets variables of this type."""
        return f"{self.prefix}{action.capitalize()}{layout.base}"

    def _combine(self, action: Action, calls: Sequence[Transfer], function: str) -> Call:
        """One call that makes several calls in order, and returns the worst status."""
        return Call(lambda: max((call() for call in calls), default=0)).set_failure(action, self._failure_of(function))

    def _failure_of(self, function: str) -> Failure:
        """A function that returns the error of a status of an FMI function."""
        return lambda _, status, when: self._error(function, status, when)

    def save_and_restore_calls(self) -> tuple[Call, Call]:
        state = c_void_p()
        self._states.append(state)
        save, restore = self._prepare("save", byref(state)), self._prepare("restore", state)
        address = self._pointer.value
        return save.set_record(SAVE, address, values=state), restore.set_record(RESTORE, address, values=state)

    def reset(self) -> None:
        self._initialized = False

    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        end = self._requested_end() if action == "step" and status == DISCARD else None
        if end is not None:
            begin, size = (number.value for number in self._span) if self._span else (end, 0.0)
            if not -_ROUNDING * size <= end - begin <= (1 + _ROUNDING) * size:  # nor is not-a-number
                end = begin
            return EndedError(f"{self.name} ends the simulation at t = {end:.10g} s", end)
        return self._error(self.functions[action], status, when)

    @abstractmethod
    def _requested_end(self) -> float | None:
        """The time that the last step reached [s], if the FMU requests the end of the simulation; else None."""

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        self._close_own()
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
        """Terminate it, and free its states, itself and its library."""
        if self._initialized and self._worst_status < ERROR:
            try:
                self.fmpy_instance.terminate()
            except FMICallException as error:
                logger.warning("%s: %s failed%s", self.name, error.function, self._complaint())
        for state in filter(None, self._states):
            with suppress(FMICallException):
                self.fmpy_instance.freeFMUState(state)
        self.fmpy_instance.freeInstance()

    def _close_own(self) -> None:
        """Close what belongs to this instance beside its library."""

    def _log_message(self, status: int, message: bytes | None) -> None:
        """Keep a message of the FMU, and log it to the channel ``liaisons.cosim`` if it is new."""
        entry = status, one_line((message or b"")[:_LONGEST_MESSAGE].decode(errors="replace").strip())
        if entry not in self._messages:
            self._messages.append(entry)
            self._warnings += status == WARNING
            shown = status == WARNING and self._warnings <= _MOST_WARNINGS
            more = "; further warnings of it are not shown" if self._warnings == _MOST_WARNINGS else ""
            logger.log(logging.WARNING if shown else logging.DEBUG, "%s: %s%s", self.name, entry[1], more)

    def _complaint(self) -> str:
        """The messages of the FMU with status Discard or worse, else its last message."""
        complaints = dict.fromkeys(message for status, message in self._messages if status >= DISCARD)
        said = list(complaints) or [message for _, message in self._messages][-1:]
        return f": {'; '.join(said)}" if said else " without a message"

    def _error(self, function: str, status: int, about: str) -> SimulationError:
        """The error of a status other than OK and Warning."""
        is_status = status in range(len(STATUSES))
        self._worst_status = max(self._worst_status, status) if is_status else FATAL
        label = STATUSES[status] if is_status else f"{status}, which is no status of FMI"
        words = f"{self.name}: {function}{about} returned {label}{self._complaint()}"
        # after a roll-back, the next failure has its own messages
        self._messages = deque((entry for entry in self._messages if entry[0] < DISCARD), maxlen=_MESSAGES_KEPT)
        return (RefusedError if status in {DISCARD, ERROR} else SimulationError)(words)

    def _call(self, function: str, *arguments: object, about: str = "") -> None:
        """Call a function of FMI by FMPy, which converts the arguments.

        :raises SimulationError: for a status that is none of OK and Warning, and if the library lacks the function.
        """
        try:
            status = getattr(self.fmpy_instance, function)(self.fmpy_instance.component, *arguments)
        except FMICallException as error:
            status = error.status
        except AttributeError:
            raise self._missing_function(function) from None
        self._check(function, status, about)

    def _check(self, function: str, status: int, about: str = "") -> None:
        if status not in SUCCESS:  # to FMPy, a negative one is a success
            raise self._error(function, status, about)

    def _missing_function(self, function: str) -> SimulationError:
        words = f"the library of {self._fmu.path.name} has no function {function}; export it again"
        return SimulationError(f"{self.name}: {words}")

    def _prepare(self, action: Action, *arguments: object) -> Call:
        return self.prepared(action, self._function(self.functions[action]), self._pointer, *arguments)

    def _function(self, name: str) -> Callable[..., int]:
        if name not in self._functions:
            try:
                self._functions[name] = _function_at(cast(self.fmpy_instance.dll[name], c_void_p).value or 0)
            except AttributeError:
                raise self._missing_function(name) from None
        return self._functions[name]


@cache
def _function_at(address: int) -> Callable[..., int]:
    """The function at an address, without argument types, shared by all instances.

    Shared functions of a thousand instances stay in the processor's cache.
    """
    return CFUNCTYPE(c_int)(address)
