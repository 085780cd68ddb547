"""An FMU in a process of its own: if it crashes, exits or hangs, only its run ends, with the result so far.

The process is forked, makes the instance and calls its methods; each call is a message through a pipe and an answer.
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
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pickle import dumps, loads
from typing import Any, final

import numpy as np

from liaisons.base.arrays import Floats
from liaisons.base.logs import logger
from liaisons.base.processes import fork_guarded
from liaisons.cosim import FATAL, STATUSES, Action, Call, Fmu, Instance, Numbers, Scalars
from liaisons.errors import LiaisonsError, ProcessEndedError, SimulationError

_RELEASE_LIMIT = 5.0
"""Time limit of the release [s]."""
_LONGEST_LIMIT = 1e6
"""Largest time limit that the operating system takes [s]."""


class _LostError(Exception):
    """There is no answer from the process."""


@final
class Isolated(Instance):
    """An instance in a process of its own.

    :param name: name of the part.
    :param fmu: description of the FMU.
    :param make: makes the instance in the other process.
    :param limit: time limit of a call [s].
    :raises SimulationError: as ``make`` does, or if it crashes.
    """

    def __init__(self, name: str, fmu: Fmu, make: Callable[[], Instance], limit: float) -> None:
        self.name, self._fmu, self._limit = name, fmu, limit
        self._pipe, child_end = Pipe()
        self._answers = select.poll()
        self._answers.register(self._pipe, select.POLLIN)
        self._fate = self._exit_status = ""  # how its process ended, once it does not answer
        self._function = ""  # of FMI, that the last prepared call calls
        self._guard: int | None = _fork(self._pipe, child_end, make)
        try:
            self._functions: Mapping[Action, str] = self._ask("its instantiation", "functions")
        except BaseException:
            self._fate = self._fate or "has made no instance"
            self.close()
            raise

    def initialize(
        self, starts: Mapping[str, Any], tolerance: float | None, start_time: float, stop_time: float
    ) -> None:
        self._ask("its initialization", "initialize", starts, tolerance, start_time, stop_time)

    def assign(self, name: str, value: Any) -> None:
        self._ask(f"setting {name}", "assign", name, value)

    def exit_initialization(self) -> None:
        self._ask(f"fmi{self._fmu.version}ExitInitializationMode", "exit_initialization")

    def getter(self, variables: Scalars, values: Numbers) -> Call:
        return self._prepare("get", "getter", variables, received=values)

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        return self._prepare("set", "setter", variables, sent=[values])

    def stepper(self, time: c.c_double, size: c.c_double) -> Call:
        return self._prepare("step", "stepper", sent=[time, size])

    def save_and_restore_calls(self) -> tuple[Call, Call]:
        return self._prepare("save", "save_and_restore_calls"), self._prepare("restore", None)

    def directional_derivatives(self, unknowns: Scalars, knowns: Scalars, seed: Numbers, values: Numbers) -> Call:
        return self._prepare("derive", "directional_derivatives", unknowns, knowns, sent=[seed], received=values)

    def output_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        return self._prepare("slope", "output_derivatives", variables, orders, received=values)

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        return self._prepare("shape", "input_derivatives", variables, orders, sent=[values])

    def prepare_intermediate_inputs(self, variables: Scalars, values: Floats) -> Call:
        return self._prepare("set", "prepare_intermediate_inputs", variables, sent=[values])

    def failure(self, action: Action, status: int, when: str) -> SimulationError:  # noqa: ARG002 - of the last call
        if self._fate:
            return self._lost_error(f"{self._function}{when}")
        return self._ask("its refusal", "failure", when)

    def close(self) -> None:
        try:
            self.release()
        except SimulationError as error:
            logger.warning("%s", error)

    def release(self) -> None:
        try:
            if not self._fate:
                self._limit = min(self._limit, _RELEASE_LIMIT)
                self._ask("its release", "close")
        finally:
            self._fate = self._fate or "has been released"
            self._end_process()

    def _prepare(
        self,
        action: Action,
        method: str | None,
        *arguments: Any,
        sent: Sequence[Any] = (),
        received: Numbers | None = None,
    ) -> Call:
        """Prepare a call in the other process; returns the call that makes it through the pipe.

        :param method: name of the method that prepares it; None: the second call that the last method returned.
        :param arguments: first arguments of the method; its buffers follow.
        :param sent: buffers whose values are sent with each call.
        :param received: the one whose values come back.
        """
        shapes = [np.shape(buffer) for buffer in (*sent, *([] if received is None else [received]))]
        number = self._ask("its preparation", "prepare", method, arguments, shapes)
        function = self._functions.get(action, action)  # for messages
        if action in {"get", "set"}:
            types = dict.fromkeys(variable.base for variable in arguments[0])
            function = " or ".join(f"fmi{self._fmu.version}{action.title()}{base}" for base in types)

        def call_by_pipe() -> int:
            self._function = function
            try:
                status, data = self._request("call", number, b"".join(sent))
            except _LostError:
                return FATAL
            if received is not None:
                received[:] = np.frombuffer(data)
            return status if status in range(len(STATUSES)) else FATAL  # the others are those of compiled code

        return self.prepare_call(action, call_by_pipe)

    def _ask(self, task: str, method: str, *arguments: object) -> Any:
        """Call a method in the other process; returns its result.

        :param task: words for the call, for the message.
        :raises SimulationError: as the method does, or if there is no answer.
        """
        try:
            return self._request(method, *arguments)
        except _LostError:
            raise self._lost_error(task) from None

    def _request(self, *message: object) -> Any:
        """Send a message, and wait for the answer; returns the result of the method.

        :raises LiaisonsError: as the method does.
        :raises _LostError: if there is no answer.
        """
        if self._fate:
            raise _LostError
        self._fate = "was interrupted"  # after an interrupt the state of the process is unknown
        with suppress(OSError):  # it has just ended, as the answer will tell
            self._pipe.send_bytes(dumps(message))
        with suppress(EOFError, OSError):
            while self._answers.poll(math.ceil(1000 * min(self._limit, _LONGEST_LIMIT))):
                answer = list(loads(self._pipe.recv_bytes()))
                if isinstance(answer[0], int):
                    logger.log(answer[0], "%s", answer[1])
                    continue
                self._fate = ""
                if answer[0] is not None:
                    raise answer.pop(0)  # by a name it would refer to itself, and to all that this frame does
                return answer[1]
            self._fate = f"has not returned within {self._limit:g} s; give isolated more seconds if it needs them"
            self._end_process()
            raise _LostError
        self._exit_status = self._end_process()
        self._fate = f"crashed ({self._exit_status})"
        raise _LostError

    def _lost_error(self, task: str) -> SimulationError:
        """Error for a task without an answer."""
        words = f"{self.name}: {task} {self._fate}"
        return ProcessEndedError(words, self._exit_status) if self._exit_status else SimulationError(words)

    def _end_process(self) -> str:
        """End the process, unless it has ended; returns its signal or exit status as text."""
        guard, self._guard = self._guard, None
        self._pipe.close()
        with suppress(ChildProcessError):  # somebody else has waited for it
            if guard is not None:
                os.kill(guard, signal.SIGTERM)  # does nothing to one that has crashed
                code = os.waitstatus_to_exitcode(os.waitpid(guard, 0)[1])
                with suppress(ValueError):
                    return signal.Signals(-code).name if code < 0 else f"exit status {code}"
                return f"signal {-code}"
        return "its process has ended"


def _fork(pipe: Connection, child_end: Connection, make: Callable[[], Instance]) -> int:
    """Fork a process that makes the instance and calls it; returns the process id of its guard."""

    def close_pipe() -> None:
        pipe.close()
        child_end.close()

    _flush_streams()
    with warnings.catch_warnings():
        # Python 3.12, and others, warn of forks beside threads; ours touches nothing that those could hold locked.
        warnings.simplefilter("ignore")
        guard = fork_guarded(close=close_pipe)
    if guard:
        child_end.close()
        return guard
    try:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        faulthandler.disable()  # the parent says what has happened
        gc.freeze()
        pipe.close()
        _serve(child_end, make)
    finally:
        _flush_streams()
        os._exit(0)


@final
class _Server:
    """Calls the methods of an instance and the calls that they prepare, as messages ask."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._calls: list[tuple[Call, bytearray]] = []
        self._last: tuple[Call, int]

    def respond(self, method: str, *arguments: Any) -> Any:
        """Call the method that a message names; returns its result."""
        if method == "functions":
            return dict(self._instance.functions)
        if method in {"call", "prepare", "failure"}:
            return getattr(self, f"_{method}")(*arguments)
        return getattr(self._instance, method)(*arguments)

    def _call(self, number: int, sent: bytes) -> tuple[int, bytes]:
        """Make a prepared call with the bytes of its buffers; returns its status, and the bytes that it has read."""
        call, store = self._calls[number]
        store[: len(sent)] = sent
        self._last = call, (status := call() or 0)
        return status, bytes(memoryview(store)[len(sent) :])

    def _prepare(self, method: str | None, arguments: tuple[Any, ...], shapes: Sequence[tuple[int, ...]]) -> int:
        """Prepare calls by a method with buffers of some shapes, () for one double; returns the number of the first."""
        if method is None:
            return len(self._calls) - 1
        sizes = [math.prod(shape) for shape in shapes]
        store, offset, buffers = bytearray(8 * sum(sizes)), 0, list[Any]()
        for shape, size in zip(shapes, sizes, strict=True):
            numbers = (c.c_double * size).from_buffer(store, offset)
            buffers.append(np.asarray(numbers).reshape(shape) if shape else c.c_double.from_buffer(numbers))
            offset += 8 * size
        made, first = getattr(self._instance, method)(*arguments, *buffers), len(self._calls)
        self._calls += [(call, store) for call in (made if isinstance(made, tuple) else (made,))]
        return first

    def _failure(self, when: str) -> LiaisonsError:
        """Error for the status of the last prepared call."""
        call, status = self._last
        return call.error(status, when)


@final
class _Messages(logging.Handler):
    """Sends log records to the other process, which waits for an answer."""

    def __init__(self, pipe: Connection) -> None:
        super().__init__()
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        self._pipe.send_bytes(dumps((record.levelno, record.getMessage())))


def _serve(pipe: Connection, make: Callable[[], Instance]) -> None:
    """Make an instance, and answer messages until one closes it."""
    logger.logger.handlers, logger.logger.propagate = [_Messages(pipe)], False
    logger.setLevel(min(logger.getEffectiveLevel(), logging.WARNING))
    server, method = None, ""
    while method != "close":
        error, value = None, None
        try:
            server = server or _Server(make())
            method, *arguments = loads(pipe.recv_bytes())
            value = server.respond(method, *arguments)
        except LiaisonsError as raised:
            error = raised
        pipe.send_bytes(dumps((error, value)))
        if server is None:
            return


def _flush_streams() -> None:
    """Flush the output of Python and of C, which both processes would print after a fork."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):
            stream.flush()
    c.CDLL(None).fflush(None)
