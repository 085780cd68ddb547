"""A pool of processes that simulate cases; a process that crashes or takes too long is replaced.

Pools in libraries report a whole portion of cases at a time, and lose it with the process; ours reports case by case,
and runs in the daemons of Dask, too.
"""

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
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from multiprocessing.connection import Client, Connection, Listener, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import final
from uuid import uuid4

import numpy as np

from liaisons.base.arrays import Floats
from liaisons.base.folders import temporary_folder
from liaisons.base.processes import die_with_parent
from liaisons.errors import SweepError
from liaisons_tools.sweeps.session import Task, case_simulator
from liaisons_tools.sweeps.study import Failure, Outcomes, Study

Deliver = Callable[[Outcomes], None]

_logger = logging.getLogger("liaisons.sweeps")

_REPORT_INTERVAL = 0.1  # [s] between two reports of a worker
_PATIENCE = 5.0  # [s] for a worker to release its FMUs
_MOST = 256  # cases of one portion
_SERVE = (
    "import sys; from liaisons_tools.sweeps.workers import serve_parent; serve_parent(int(sys.argv[1]), sys.argv[2])"
)
_MOST_DEATHS = 2  # processes that may die over one case before it is a failure
_LONG_CASE = 60.0  # [s] after which a warning says that a case still runs


def simulate_locally(
    study: Study, cases: Iterable[int], count: int, deliver: Deliver, time_limit: float | None
) -> None:
    """Simulate cases in processes of this machine.

    A process that crashes or is killed is replaced, and the cases it had not reported are simulated again, one by one,
    with isolated FMUs; a case over which two processes have died is a failure, and so is one that takes too long.

    :param count: number of processes.
    :param deliver: takes outcomes, in any order.
    :param time_limit: of a case [s].
    """
    with temporary_folder() as folder:
        task: Task | bytes = study, study.simulation.extract(folder), str(folder)
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

    :param task: for a fork, whose functions need not be importable; pickled, for a new interpreter, as a Dask worker
        needs, which may not have children of multiprocessing.
    :ivar current: start of the current case on the monotonic clock [s], infinite for none, and its number.
    """

    def __init__(self, task: Task | bytes, folder: Path) -> None:
        self.cases: list[int] = []
        file = folder / f"{uuid4().hex}.current"
        self.current = np.memmap(file, float, "w+", shape=(2,))
        self.current[:] = math.inf, 0.0
        begun = _start_interpreter(task, file) if isinstance(task, bytes) else _fork_worker(task, self.current)
        self.process, self.pipe = begun

    def send(self, cases: list[int], *, suspect: bool = False) -> None:
        """Send the next cases to the process; an empty list ends it after it has released its FMUs."""
        self.cases = cases
        with suppress(OSError):  # it has died, as its pipe will report
            self.pipe.send((cases, suspect))

    def elapsed(self) -> float:
        """Time since the start of the worker's current case [s]."""
        return max(0.0, time.monotonic() - self.current[0])

    def end(self, patience: float) -> int | None:
        """End the process, by force after a time [s], and return its exit code."""
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
    """Processes for the cases of one sweep; ``close`` may be called from another thread.

    :param task: pickled if processes cannot be forked.
    :param folder: for temporary files.
    :param count: number of processes.
    :param time_limit: of a case [s].
    """

    def __init__(self, task: Task | bytes, folder: Path, count: int, time_limit: float | None) -> None:
        self._task, self._folder, self._count, self._time_limit = task, folder, count, time_limit
        self._waiting: deque[int] = deque()
        self._suspects: deque[int] = deque()  # of processes that have died
        self._deaths: dict[int, int] = {}
        self._deliver: Deliver = lambda _: None
        self._warns = time_limit is None  # of a long case, once
        self._workers: list[_Worker] = []
        self._closed = False

    def run(self, cases: Iterable[int], deliver: Deliver) -> None:
        """Simulate cases and deliver their outcomes.

        :raises SweepError: if it has been closed, or a process cannot be started.
        """
        self._waiting.extend(cases)
        self._deliver = deliver
        for worker in self._workers:
            self._send_next(worker)
        while self._waiting and len(self._workers) < self._count:
            self._workers.append(self._start_worker())
        while any(worker.cases for worker in self._workers):
            busy = [worker for worker in self._workers if worker.cases]
            limit = self._time_limit or (_LONG_CASE if self._warns else None)
            longest = max(worker.elapsed() for worker in busy)
            ready = wait([worker.pipe for worker in busy], None if limit is None else max(0.01, limit - longest))
            for worker in busy:
                if worker.pipe in ready and not self._receive(worker):
                    self._replace_dead(worker)
                elif not worker.cases:
                    self._send_next(worker)
                elif self._time_limit is not None and worker.elapsed() > self._time_limit:
                    self._end_overdue(worker, self._time_limit)
                elif self._warns and worker.elapsed() > _LONG_CASE:
                    self._warns = False
                    _logger.warning(
                        "case %d has been running for %.0f s; a time limit (time_limit, --time-limit) would end it",
                        worker.current[1],
                        worker.elapsed(),
                    )

    def close(self, patience: float = _PATIENCE) -> None:
        """Kill the busy processes, and give the idle ones some time [s] to release their FMUs."""
        self._closed = True
        for worker in self._workers:
            if worker.cases:
                worker.process.kill()
            else:
                worker.send([])
        for worker in self._workers:
            worker.end(patience)

    def _start_worker(self) -> _Worker:
        """Start a process and send it its first cases."""
        if self._closed:
            raise SweepError("the sweep has been ended")
        worker = _Worker(self._task, self._folder)
        self._send_next(worker)
        return worker

    def _send_next(self, worker: _Worker) -> None:
        """Send a process its next cases, or one case over which another process has died."""
        if self._suspects:
            worker.send([self._suspects.popleft()], suspect=True)
        elif self._waiting:
            # decreasing portions: few reports, and yet all processes end together
            size = min(_MOST, -(-len(self._waiting) // (4 * self._count)))
            worker.send([self._waiting.popleft() for _ in range(size)])

    def _receive(self, worker: _Worker) -> bool:
        """Receive outcomes from a process and deliver them; return False if it has died."""
        try:
            outcomes: Outcomes = worker.pipe.recv()
        except (EOFError, OSError):
            return False
        worker.cases = [case for case in worker.cases if case not in outcomes]
        self._deliver(outcomes)
        return True

    def _end_overdue(self, worker: _Worker, limit: float) -> None:
        """End a process over its time limit, and deliver a failure of its case unless that has just finished."""
        start = worker.current[0]
        worker.end(0.0)
        while worker.pipe.poll() and self._receive(worker):
            pass
        case = int(worker.current[1])
        if worker.current[0] == start and case in worker.cases:
            worker.cases.remove(case)
            self._deliver({case: Failure(f"took longer than the time limit of {limit:g} s", refused=False)})
        self._replace(worker)

    def _replace_dead(self, worker: _Worker) -> None:
        """Replace a process that has died, with a failure for a case over which several have died."""
        code = worker.end(_PATIENCE)
        if len(worker.cases) == 1:
            (case,) = worker.cases
            self._deaths[case] = self._deaths.get(case, 0) + 1
            if self._deaths[case] == _MOST_DEATHS:
                reason = f"the process that simulated it died, {_MOST_DEATHS} times (exit code {code})"
                self._deliver({case: Failure(reason, refused=False)})
                worker.cases = []
        self._replace(worker)

    def _replace(self, worker: _Worker) -> None:
        """Replace a process that has ended by another one, and queue its cases to be simulated one by one."""
        self._suspects.extend(worker.cases)
        worker.pipe.close()
        self._workers[self._workers.index(worker)] = self._start_worker()


def _fork_worker(task: Task, current: Floats) -> tuple[BaseProcess, Connection]:
    """Start a worker as a fork of this process; return its process and the pipe to it."""
    context = multiprocessing.get_context("fork")
    pipe, far = context.Pipe()
    process = context.Process(target=_simulate_piped_cases, args=(far, current, task, os.getpid()), daemon=True)
    with warnings.catch_warnings():
        # Python 3.12 warns of forks beside threads; ours use no locks of those.
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    far.close()
    return process, pipe


def _start_interpreter(task: bytes, current: Path) -> tuple[subprocess.Popen[bytes], Connection]:
    """Start a worker as a new interpreter; return its process and the connection to it."""
    key = secrets.token_bytes()
    process = subprocess.Popen(
        [sys.executable, "-c", _SERVE, str(os.getpid()), str(current)],
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


def serve_parent(parent: int, current: str) -> None:
    """Simulate the cases of a parent process: the main function of a new interpreter.

    :param parent: process id of its parent.
    :param current: file of the current case.
    """
    die_with_parent(parent)
    key, task = pickle.load(sys.stdin.buffer)
    with Listener(("127.0.0.1", 0), authkey=key) as listener:
        _, port = listener.address
        os.write(1, f"{port}\n".encode())
        os.dup2(2, 1)  # what an FMU prints is for the log
        pipe = listener.accept()
    _simulate_piped_cases(pipe, np.memmap(current, float, "r+", shape=(2,)), pickle.loads(task), parent)


def _simulate_piped_cases(pipe: Connection, current: Floats, task: Task, parent: int) -> None:
    """Simulate the cases that come through a pipe, until an empty list comes or the parent ends."""
    die_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles interrupts
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # not the inherited handler of the parent
    gc.freeze()  # else a collection would copy the memory of the parent
    with case_simulator(task) as outcome:
        while True:
            outcomes: Outcomes = {}
            reported = time.monotonic()
            cases, suspect = pipe.recv()
            if not cases:
                return
            for case in cases:
                current[1], current[0] = case, time.monotonic()
                outcomes[case] = outcome(case, suspect)
                current[0] = math.inf
                if time.monotonic() - reported > _REPORT_INTERVAL:
                    pipe.send(outcomes)
                    outcomes, reported = {}, time.monotonic()
            if outcomes:
                pipe.send(outcomes)
