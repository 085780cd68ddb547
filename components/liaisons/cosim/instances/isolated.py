"""An FMU in a process of its own: if it crashes, exits or hangs, only its run ends, with the result so far.

The process is forked, makes the instance and calls it.  Rare calls go through a pipe, prepared ones through shared
memory; see ``isolated.c``.
"""

from __future__ import annotations

import ctypes as c
import faulthandler
import gc
import logging
import math
import os
import select
import signal
import sys
import warnings
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from mmap import mmap
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.processes import fork_guarded
from liaisons.cosim.compiled.calls import STEP_2, TRANSFER_2, Action, Call
from liaisons.cosim.compiled.library import loaded
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.start_values import Value
from liaisons.cosim.instances.protocol import Instance, Numbers, Scalars
from liaisons.cosim.messages import ERROR, FATAL, STATUSES, WARNING, logger
from liaisons.errors import EndedError, LiaisonsError, SimulationError

_ENDED, _LATE, _INTERRUPTED = 101, 102, 103  # as isolated.c has them
_ROOM, _LISTEN, _FORGET, _BEGIN = 256, 0, -1, -2
_LINE = 64  # [B] of a cache
_MEMORY, _NUMBERS = 2**24, 64  # [B], and doubles for each scalar of the FMU; what is not used takes no room
_PATIENCE = 5.0  # [s] for the release
_MOST_MESSAGES = 1000  # that wait there until they are read here
_INTERPRETER = ("PyGILState_Ensure", "PyGILState_Release", "PyErr_CheckSignals", "PyErr_Fetch")

Answer = tuple[LiaisonsError | None, Any]
"""What was asked for, or the error that it has raised."""


Shape = int | tuple[int, ...] | None


@final
class _Channel(c.Structure):
    _fields_ = [
        ("posted", c.c_uint32),
        ("parent_sleeps", c.c_uint32),
        ("apart", c.c_char * 56),
        ("made", c.c_uint32),
        ("child_sleeps", c.c_uint32),
        ("refused", c.c_uint32),
        ("status", c.c_int32),
        ("far_apart", c.c_char * 48),
        ("numbers", c.c_int32 * _ROOM),
    ]


@final
class _Far(c.Structure):
    _fields_ = [
        ("channel", c.c_void_p),
        ("child", c.c_int),
        ("reads", c.c_int),
        ("limit", c.c_double),
        ("lost", c.c_int),
        *((name, c.c_void_p) for name in ("hold", "release", "signals", "fetch")),
        ("exception", c.c_void_p * 3),
    ]


@final
class _Command(c.Structure):
    _fields_ = [(name, c.c_void_p) for name in ("far", "arguments", "results")] + [
        ("number", c.c_int32),
        ("posted", c.c_uint32),
    ]


@final
class _Messages(logging.Handler):
    """Hands what is logged to the process at the other end of a pipe, which may read it much later.

    It never waits for that, but before an answer, for which the other one does.
    """

    def __init__(self, pipe: Connection) -> None:
        super().__init__()
        self._pipe, self._waiting = pipe, deque[tuple[int, str]](maxlen=_MOST_MESSAGES)

    def emit(self, record: logging.LogRecord) -> None:
        self._waiting.append((record.levelno, record.getMessage()))
        while self._waiting and select.select([], [self._pipe], [], 0)[1]:
            self._pipe.send(self._waiting.popleft())

    def answer(self, answer: Answer) -> None:
        """Hand over this, after all that was logged before it."""
        while self._waiting:
            self._pipe.send(self._waiting.popleft())
        self._pipe.send(answer)


@final
@dataclass(frozen=True)
class _Slot:
    """Doubles in the shared memory, for an argument that is one (no shape), so many, or an array."""

    address: int
    shape: Shape

    @property
    def size(self) -> int:
        return math.prod(np.atleast_1d(1 if self.shape is None else self.shape).tolist())

    def seen(self) -> Any:
        """As functions of an instance want them."""
        if self.shape is None:
            return c.c_double.from_address(self.address)
        numbers = (c.c_double * self.size).from_address(self.address)
        return numbers if isinstance(self.shape, int) else np.ctypeslib.as_array(numbers).reshape(self.shape)


def library() -> c.CDLL | None:
    """The code of the shared memory; None where there is no such thing."""
    if sys.platform != "linux":
        return None
    return loaded((Path(__file__).with_suffix(".c"),), "FMUs are not isolated")


@final
class Isolated(Instance):
    """An instance in a process of its own.

    To set, to step and to save does not wait for the other process; a refusal is told where one waits next.

    :param name: name of the part.
    :param fmu: what was read from its file.
    :param make: makes the instance, there.
    :param library: see :func:`library`.
    :param limit: how long a call may take [s].
    :raises SimulationError: as ``make`` does, or if it crashes.
    """

    def __init__(self, name: str, fmu: Fmu, make: Callable[[], Instance], library: c.CDLL, limit: float) -> None:
        self.name, self._fmu, self._library = name, fmu, library
        scalars = sum(entry.size for entry in fmu.variables.entries.values())
        self._memory = mmap(-1, _MEMORY + 8 * _NUMBERS * scalars)
        self._channel = _Channel.from_buffer(self._memory)
        self._used = c.sizeof(_Channel)
        self._reason = self._task = ""
        self._pipe, child_end = Pipe()
        self._child: int | None = _forked(self._pipe, child_end, library, self._channel, make)
        addresses = [c.cast(c.pythonapi[word], c.c_void_p).value for word in _INTERPRETER]
        self._far = _Far(c.addressof(self._channel), self._child, 0, limit, 0, *addresses)
        self._commands: list[_Command] = []
        self._calls: list[Call] = []
        self._labels: list[str] = []
        self._halves: dict[Call, tuple[Call, Call]] = {}
        self._posted("copy", "")  # number 0: it listens to the pipe
        try:
            self._functions: Mapping[Action, str] = self._answer("its instantiation")
        except BaseException:
            self.close()
            raise

    def initialize(
        self, starts: Mapping[str, Value], tolerance: float | None, start_time: float, stop_time: float
    ) -> None:
        self._ask("its initialization", "initialize", starts, tolerance, start_time, stop_time)

    def assign(self, name: str, value: Any) -> None:
        self._ask(f"setting {name}", "assign", name, value)

    def exit_initialization(self) -> None:
        self._ask(f"fmi{self._fmu.version}ExitInitializationMode", "exit_initialization")

    def reset(self) -> None:
        self._ask("its reset", "reset")

    def getter(self, variables: Scalars, values: Numbers) -> Call:
        self._far.reads = 1
        return self._moved("get", self._transferring("Get", variables), values, "getter", variables)

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        return self._moved("set", self._transferring("Set", variables), values, "setter", variables)

    def stepper(self, time: c.c_double, size: c.c_double) -> Call:
        first, _ = self._prepared("stepper", shapes=[None, None])
        command = self._command(first)
        call = self._kept(Call(self._library.step, c.byref(command), time, size, 1), "step")
        return call.recorded(STEP_2, c.addressof(command))

    def states(self) -> tuple[Call, Call]:
        self._prepared("states")
        return self._posted("save"), self._posted("restore")

    def directional(self, unknowns: Scalars, knowns: Scalars, seed: Numbers, values: Numbers) -> Call:
        arguments, results = self._prepared("directional", unknowns, knowns, shapes=[len(knowns), len(unknowns)])
        command, functions = self._command(arguments, results), self._library
        one, other = (c.c_size_t(len(knowns)), c.byref(seed)), (c.c_size_t(len(unknowns)), c.byref(values))
        call = self._kept(Call(functions.derive, c.byref(command), *one, *other), "derive")
        halves = (functions.set, *one), (functions.collect, *other)
        write, read = (
            Call(f, c.byref(command), None, *rest).with_failure("derive", self.failure) for f, *rest in halves
        )
        self._halves[call] = write, read
        return call

    def together(self, calls: Sequence[Call]) -> Sequence[Call]:
        """All is written before anything is waited for."""
        halves = [self._halves[call] for call in calls]
        return [*(write for write, _ in halves), *(read for _, read in halves)]

    def output_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        return self._moved("slope", self._functions["slope"], values, "output_derivatives", variables, orders)

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        return self._moved("shape", self._functions["shape"], values, "input_derivatives", variables, orders)

    def intermediate_update(self, variables: Scalars, values: NDArray[np.float64]) -> Call:
        numbers, label = (c.c_double * values.size).from_buffer(values.data), self._transferring("Set", variables)
        return self._moved("set", label, numbers, "intermediate_update", variables, shape=values.shape)

    def failure(self, action: Action, status: int, when: str) -> SimulationError:  # noqa: ARG002 - posted before it
        if status == _INTERRUPTED:  # by what a signal has raised, which goes on
            c.pythonapi.PyErr_Restore(*map(c.c_void_p, self._far.exception))
        if status in {_ENDED, _LATE}:
            return SimulationError(self._lost(status, when))
        channel = self._channel
        number, *rest = (channel.numbers[k % _ROOM] for k in range(channel.refused, channel.posted))
        error: SimulationError = self._asked("its refusal", "failure", number, status, self._when(number, when))
        if isinstance(error, EndedError):  # it is read all the same
            for skipped in rest:
                self._calls[skipped]()
        return error

    def close(self) -> None:
        """Release it, and end its process; safe to repeat."""
        if self._child is None:
            return
        try:
            if not self._far.lost:
                self._far.limit = min(self._far.limit, _PATIENCE)
                self._asked("its release", "close")
        except SimulationError as error:
            logger.warning("%s", error)
        finally:
            self._ended()
            self._pipe.close()

    def _prepared(self, *message: object, shapes: Sequence[Shape] = ()) -> list[_Slot]:
        """Room for numbers, and calls in the other process that have it as arguments."""
        slots: list[_Slot] = []
        self._used += -self._used % _LINE
        for shape in shapes:
            slots.append(_Slot(c.addressof(self._channel) + self._used, shape))
            self._used += 8 * slots[-1].size
        if self._used > len(self._memory):
            raise SimulationError(f"{self.name}: its calls need more than {len(self._memory)} B; do not isolate it")
        self._ask("its preparation", "prepare", *message, *slots)
        return slots

    def _command(self, *slots: _Slot) -> _Command:
        addresses = (slots[0].address, slots[-1].address) if slots else (None, None)
        self._commands.append(_Command(c.addressof(self._far), *addresses, len(self._commands), 0))
        return self._commands[-1]

    def _posted(self, action: Action, label: str | None = None) -> Call:
        return self._kept(Call(self._library.post, c.byref(self._command())), action, label)

    def _moved(self, action: Action, label: str, values: Numbers, *message: object, shape: Shape = None) -> Call:
        """The call of a command that gets numbers, or hands them over."""
        command = self._command(*self._prepared(*message, shapes=[shape or len(values)]))
        function = self._library.get if action in {"get", "slope"} else self._library.set
        call = self._kept(
            Call(function, c.byref(command), None, c.c_size_t(len(values)), c.byref(values)), action, label
        )
        return call.recorded(TRANSFER_2, c.addressof(command), count=len(values), values=values)

    def _kept(self, call: Call, action: Action, label: str | None = None) -> Call:
        """The call of the last command, whose function of FMI is called so."""
        self._calls.append(call)
        self._labels.append(self._functions.get(action, action) if label is None else label)
        return call.with_failure(action, self.failure)

    def _transferring(self, word: str, variables: Scalars) -> str:
        return " or ".join(f"fmi{self._fmu.version}{word}{base}" for base in dict.fromkeys(v.base for v in variables))

    def _ask(self, task: str, *message: object) -> Any:
        """Call the other process, once all posted calls are made.

        :param task: for a message.
        """
        status = self._library.finish(c.byref(self._far))
        if status > WARNING:
            raise self.failure("copy", status, "")
        return self._asked(task, *message)

    def _asked(self, task: str, *message: object) -> Any:
        if not self._far.lost:
            self._task = task
            self._calls[_LISTEN]()
        if self._far.lost:
            raise SimulationError(self._lost(self._far.lost, ""))
        with suppress(OSError):  # it has just ended, as the answer will tell
            self._pipe.send(message)
        return self._answer(task)

    def _answer(self, task: str) -> Any:
        self._task, self._far.lost = task, _ENDED  # an interrupt while we wait leaves its state unknown
        error, value = None, None
        with suppress(EOFError, OSError):
            lost = _LATE
            while lost and self._pipe.poll(self._far.limit):
                error, value = self._pipe.recv()
                if isinstance(error, int):
                    logger.log(error, "%s", value)
                else:
                    lost = 0
            self._far.lost = lost
        if self._far.lost:
            raise SimulationError(self._lost(self._far.lost, ""))
        if isinstance(error, BaseException):
            raise error
        return value

    def _lost(self, status: int, when: str) -> str:
        """What to say of a process that has ended, or is ended here."""
        if not self._reason:
            with suppress(EOFError, OSError):
                while self._pipe.poll(0):
                    level, text = self._pipe.recv()
                    if isinstance(level, int):
                        logger.log(level, "%s", text)
            number = self._channel.numbers[self._channel.made % _ROOM]
            task = self._labels[number] or self._task
            how = self._ended()
            fate = (
                f"crashed ({how})"
                if status == _ENDED
                else f"has not returned within {self._far.limit:g} s; give isolated more seconds if it needs them"
            )
            self._reason = f"{self.name}: {task}{self._when(number, when)} {fate}"
        return self._reason

    def _when(self, number: int, when: str) -> str:
        """When a call was made; a step of its own, which may have been posted before the call that fails."""
        if self._calls[number].action != "step":
            return f" at t{when.rpartition(' t')[2]}" if when else ""
        time, size = (c.c_double * 2).from_address(self._commands[number].arguments)
        return f" from t = {time:.10g} s to t = {time + size:.10g} s"

    def _ended(self) -> str:
        """End the process, if it has not ended; how it did."""
        child, self._child = self._child, None
        with suppress(ChildProcessError):  # somebody else has waited for it
            if child is not None:
                os.kill(child, signal.SIGTERM)  # does nothing to one that has crashed
                code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
                with suppress(ValueError):
                    return signal.Signals(-code).name if code < 0 else f"exit status {code}"
                return f"signal {-code}"
        return "its process has ended"


def _forked(pipe: Connection, child_end: Connection, *task: Any) -> int:
    """The id of a process that guards one that works."""

    def close() -> None:
        pipe.close()
        child_end.close()

    _flush()
    with warnings.catch_warnings():
        # Python 3.12 warns of forks beside threads; ours touches nothing that those could hold locked.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = fork_guarded(close=close)
    if child:
        child_end.close()
        return child
    try:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        faulthandler.disable()  # the parent says what has happened
        gc.freeze()
        pipe.close()
        _work(child_end, *task)
    finally:
        _flush()
        os._exit(0)


def _work(pipe: Connection, library: c.CDLL, channel: _Channel, make: Callable[[], Instance]) -> None:
    """What that process does: make an instance, and whatever calls of it are wanted."""
    messages = _Messages(pipe)
    logger.logger.handlers, logger.logger.propagate = [messages], False
    logger.setLevel(min(logger.getEffectiveLevel(), logging.WARNING))
    calls: list[Call] = []
    raised: list[LiaisonsError] = []
    returned = 0  # by the last call; the parent hears of statuses of FMI only, beside which it has its own

    def respond(word: str, *arguments: Any) -> Any:
        if word == "failure":
            number, _, when = arguments
            call = calls[number - 1]
            assert call.failure is not None
            return raised.pop() if raised else call.failure(call.action, returned, when)
        if word != "prepare":
            return getattr(instance, word)(*arguments)
        method, *rest = arguments
        made = getattr(instance, method)(*(value.seen() if isinstance(value, _Slot) else value for value in rest))
        calls.extend(made if isinstance(made, tuple) else [made])
        return None

    try:
        instance = make()
    except LiaisonsError as error:
        messages.answer((error, None))
        return
    messages.answer((None, dict(instance.functions)))
    status, word = _BEGIN, ""
    while word != "close":
        number = library.next(c.byref(channel), status)
        if number != _LISTEN:
            try:
                returned = calls[number - 1]() or 0
                status = returned if returned in range(len(STATUSES)) else FATAL
            except LiaisonsError as error:
                raised.append(error)
                status = ERROR
            continue
        word, *arguments = pipe.recv()
        try:
            answer: Answer = None, respond(word, *arguments)
        except LiaisonsError as error:
            answer = error, None
        messages.answer(answer)
        status = _FORGET


def _flush() -> None:
    """What was printed so far, by Python and by C: neither process is to print it again."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):
            stream.flush()
    c.CDLL(None).fflush(None)
