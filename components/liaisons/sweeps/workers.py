"""Cases on all cores of this machine: processes that are given a few cases at a time, and replaced when they die."""

from __future__ import annotations

import gc
import logging
import math
import multiprocessing
import os
import pickle
import secrets
import signal
import subprocess
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing, suppress
from multiprocessing.connection import Client, Connection, Listener, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import final
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.instances import extracted, isolated
from liaisons.errors import SweepError
from liaisons.folders import passing_folder
from liaisons.processes import die_with_parent
from liaisons.sweeps.outcome import LIVES, Outcome, died, too_long
from liaisons.sweeps.session import Task, session
from liaisons.sweeps.study import Study

Deliver = Callable[[Mapping[int, Outcome]], None]

_logger = logging.getLogger("liaisons.sweeps")

_FLUSH = 0.1  # [s] a worker reports as often as this, so that little is lost with it
_PATIENCE = 5.0  # [s] for a worker to release its FMUs
_MOST = 256  # cases that a process is given at a time
_SERVE = "import sys; from liaisons.sweeps.workers import serve; serve(int(sys.argv[1]), sys.argv[2])"
_LONG = 60.0  # [s] after which one is told that a case still runs


def simulate(study: Study, cases: Iterable[int], count: int, deliver: Deliver, time_limit: float | None = None) -> None:
    """Simulate cases in processes of their own.

    A process that dies, by a crash of an FMU or by the hand of the user, is replaced, and what it had not reported is
    done again, case by case, with isolated FMUs; a case over which two processes have died is a failure, and so is one
    that takes too long.

    :param count: number of processes.
    :param deliver: takes what is finished, in whatever order.
    :param time_limit: of a case [s].
    """
    for library in (compiled.steps, isolated.library):
        library()  # before there are processes, each of which would compile it
    with passing_folder() as folder:
        task: Task | bytes = study, extracted(study.fmus(), folder), str(folder)
        if sys.platform != "linux":  # elsewhere a fork is not safe
            try:
                task = pickle.dumps(task)
            except (AttributeError, TypeError, pickle.PicklingError) as error:
                raise SweepError(
                    f"keep: a function cannot go to another process ({error}); define it in a module"
                ) from None
        with closing(Pool(task, folder, count, time_limit)) as pool:
            pool.run(cases, deliver)


@final
class _Worker:
    """A process, the pipe to it, and the cases that it has not reported yet.

    :param task: a process is forked for it, which has functions that need not be importable; what is pickled goes to a
        fresh interpreter, which a Dask worker may start, too: a daemon may have no children of multiprocessing's.
    :ivar at: when the case that it is at was begun, on the monotonic clock [s], infinite for none; and which one it is.
    """

    def __init__(self, task: Task | bytes, folder: Path) -> None:
        self.cases: list[int] = []
        place = folder / f"{uuid4().hex}.at"
        self.at = np.memmap(place, float, "w+", shape=(2,))
        self.at[:] = math.inf, 0.0
        self.process, self.pipe = _interpreter(task, place) if isinstance(task, bytes) else _forked(task, self.at)

    def give(self, cases: list[int], *, suspect: bool = False) -> None:
        """What to do next; none: it may release its FMUs, and end."""
        self.cases = cases
        with suppress(OSError):  # it has just died; its end of the pipe will tell
            self.pipe.send((cases, suspect))

    def since(self) -> float:
        """How long it has been at its case [s]."""
        return max(0.0, time.monotonic() - self.at[0])

    def end(self, patience: float) -> int | None:
        """Wait for the end of the process, but not for ever [s]; how it ended."""
        if isinstance(self.process, BaseProcess):
            self.process.join(patience)
            self.process.kill()
            self.process.join()
            return self.process.exitcode
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(patience)
        self.process.kill()
        return self.process.wait()


@final
class Pool:
    """Processes that do cases of one sweep, until it is closed; from another thread, too, where cases are under way.

    :param task: as it goes to them; pickled if they cannot be forked.
    :param folder: that of the task.
    :param count: number of processes.
    :param time_limit: of a case [s].
    """

    def __init__(self, task: Task | bytes, folder: Path, count: int, time_limit: float | None) -> None:
        self._task, self._folder, self._count, self._time_limit = task, folder, count, time_limit
        self._waiting: deque[int] = deque()
        self._suspects: deque[int] = deque()  # of processes that have died: one by one
        self._deaths: dict[int, int] = {}
        self._deliver: Deliver = lambda _: None
        self._patient = time_limit is None  # nobody has been told yet that a case takes long
        self._workers: list[_Worker] = []
        self._closed = False

    def run(self, cases: Iterable[int], deliver: Deliver) -> None:
        """Do these cases.

        :raises SweepError: if it has been closed, or a process cannot be started.
        """
        self._waiting.extend(cases)
        self._deliver = deliver
        for worker in self._workers:
            self._go_on(worker)
        while self._waiting and len(self._workers) < self._count:
            self._workers.append(self._started())
        while any(worker.cases for worker in self._workers):
            busy = [worker for worker in self._workers if worker.cases]
            ready = wait([worker.pipe for worker in busy], self._rest(busy))
            for worker in busy:
                if worker.pipe in ready and not self._receive(worker):
                    self._bury(worker)
                elif not worker.cases:
                    self._go_on(worker)
                elif self._time_limit is not None and worker.since() > self._time_limit:
                    self._stop(worker, self._time_limit)
                elif self._patient and worker.since() > _LONG:
                    self._patient = False
                    _logger.warning(
                        "case %d has been running for %.0f s; a time limit (time_limit, --time-limit) would end it",
                        worker.at[1],
                        worker.since(),
                    )

    def close(self, patience: float = _PATIENCE) -> None:
        """End the processes, whatever they do, for good; those that do nothing are given time to release FMUs [s]."""
        self._closed = True
        for worker in self._workers:
            if worker.cases:
                worker.process.kill()
            else:
                worker.give([])
        for worker in self._workers:
            worker.end(patience)

    def _started(self) -> _Worker:
        """A new process, at work before the next one is made."""
        if self._closed:
            raise SweepError("the sweep has been ended")
        worker = _Worker(self._task, self._folder)
        self._go_on(worker)
        return worker

    def _go_on(self, worker: _Worker) -> None:
        if self._suspects:
            worker.give([self._suspects.popleft()], suspect=True)
        elif self._waiting:
            # ever smaller portions: few reports, and yet all processes end together
            size = min(_MOST, -(-len(self._waiting) // (4 * self._count)))
            worker.give([self._waiting.popleft() for _ in range(size)])

    def _receive(self, worker: _Worker) -> bool:
        """Take a report; False if the process died before its end."""
        try:
            outcomes: dict[int, Outcome] = worker.pipe.recv()
        except (EOFError, OSError):
            return False
        worker.cases = [case for case in worker.cases if case not in outcomes]
        self._deliver(outcomes)
        return True

    def _rest(self, busy: list[_Worker]) -> float | None:
        """How long to wait until somebody may have taken too long [s]."""
        limit = self._time_limit or (_LONG if self._patient else None)
        return None if limit is None else max(0.01, limit - max(worker.since() for worker in busy))

    def _stop(self, worker: _Worker, limit: float) -> None:
        """End a process whose case takes too long, unless it has come to the next one meanwhile."""
        begun = worker.at[0]
        worker.end(0.0)
        while worker.pipe.poll() and self._receive(worker):
            pass
        case = int(worker.at[1])
        if worker.at[0] == begun and case in worker.cases:
            worker.cases.remove(case)
            self._deliver({case: too_long(limit)})
        self._replace(worker)

    def _bury(self, worker: _Worker) -> None:
        """Of a process that has died, whose only case may be to blame."""
        code = worker.end(_PATIENCE)
        if len(worker.cases) == 1:
            (case,) = worker.cases
            self._deaths[case] = self._deaths.get(case, 0) + 1
            if self._deaths[case] == LIVES:
                self._deliver({case: died(code)})
                worker.cases = []
        self._replace(worker)

    def _replace(self, worker: _Worker) -> None:
        self._suspects.extend(worker.cases)
        worker.pipe.close()
        self._workers[self._workers.index(worker)] = self._started()


def _forked(task: Task, at: NDArray[np.float64]) -> tuple[BaseProcess, Connection]:
    context = multiprocessing.get_context("fork")
    pipe, far = context.Pipe()
    process = context.Process(target=_work, args=(far, at, task, os.getpid()), daemon=True)
    with warnings.catch_warnings():
        # Python 3.12 warns of forks beside threads; ours touch nothing that those could hold locked.
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    far.close()
    return process, pipe


def _interpreter(task: bytes, at: Path) -> tuple[subprocess.Popen[bytes], Connection]:
    key = secrets.token_bytes()
    process = subprocess.Popen(
        [sys.executable, "-c", _SERVE, str(os.getpid()), str(at)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert process.stdin is not None
    assert process.stdout is not None
    with suppress(OSError), process.stdin as inward:
        pickle.dump((key, task), inward)
    with process.stdout as outward:
        port = outward.readline()
    if not port:
        raise SweepError(f"a process ended when it was to begin (exit code {process.wait()}); its log says why")
    return process, Client(("127.0.0.1", int(port)), authkey=key)


def serve(parent: int, at: str) -> None:
    """What such an interpreter does.

    :param parent: its process.
    :param at: the file in which it says what it is at.
    """
    die_with_parent(parent)
    key, task = pickle.load(sys.stdin.buffer)
    with Listener(("127.0.0.1", 0), authkey=key) as listener:
        _, port = listener.address
        os.write(1, f"{port}\n".encode())
        os.dup2(2, 1)  # what an FMU prints is for the log
        pipe = listener.accept()
    _work(pipe, np.memmap(at, float, "r+", shape=(2,)), pickle.loads(task), parent)


def _work(pipe: Connection, at: NDArray[np.float64], task: Task, parent: int) -> None:
    """What a process does: simulate what comes, until nobody is there any more."""
    die_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the parent's, who ends us
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # not what the parent does then, which a fork has inherited
    gc.freeze()  # what was there before the fork stays; looking through it would copy its memory
    with session(task) as outcome:
        while True:
            outcomes: dict[int, Outcome] = {}
            reported = time.monotonic()
            message: tuple[list[int], bool] = pipe.recv()
            cases, suspect = message
            if not cases:
                return
            for case in cases:
                at[1], at[0] = case, time.monotonic()
                outcomes[case] = outcome(case, suspect=suspect)
                at[0] = math.inf
                if time.monotonic() - reported > _FLUSH:
                    pipe.send(outcomes)
                    outcomes, reported = {}, time.monotonic()
            if outcomes:
                pipe.send(outcomes)
