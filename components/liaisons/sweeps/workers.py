"""Cases on all cores of this machine: processes that are given a few cases at a time, and replaced when they die."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import signal
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import final

from liaisons.cosim import loop
from liaisons.sweeps.errors import SweepError
from liaisons.sweeps.plan import Plan
from liaisons.sweeps.session import Outcome, Session, extract_all

Deliver = Callable[[dict[int, Outcome]], None]
Folders = dict[Path, Path]

_FLUSH = 0.1  # [s] a worker reports as often as this, so that little is lost with it
_PATIENCE = 5.0  # [s] for a worker to release its FMUs
_MOST = 256  # cases that a process is given at a time
_LIVES = 2  # so many processes may die over one case before it is given up


def simulate(plan: Plan, cases: Iterable[int], count: int, deliver: Deliver) -> None:
    """Simulate cases in processes of their own.

    A process that dies, by a crash of an FMU or by the hand of the user, is replaced, and what it had not reported is
    done again, case by case; a case over which two processes have died is a failure.

    :param count: number of processes.
    :param deliver: takes what is finished, in whatever order.
    """
    loop.compiled()  # before there are processes, each of which would compile it
    with TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True) as folder:
        pool = _Pool(plan, extract_all(plan, Path(folder)), deque(cases), count, deliver)
        try:
            pool.run()
        finally:
            pool.close()


@final
class _Worker:
    """A process, the pipe to it, and the cases that it has not reported yet."""

    def __init__(self, plan: Plan, folders: Folders) -> None:
        # A forked process has the plan already, so that functions in it need not be importable; safe on Linux only.
        context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
        self.pipe, far = context.Pipe()
        self.process: BaseProcess = context.Process(target=_work, args=(far, plan, folders, os.getpid()), daemon=True)
        with warnings.catch_warnings():
            # Python 3.12 warns of forks beside threads; ours touch nothing that those could hold locked.
            warnings.simplefilter("ignore", DeprecationWarning)
            try:
                self.process.start()
            except (AttributeError, TypeError, pickle.PicklingError) as error:
                raise SweepError(
                    f"keep: a function cannot go to another process ({error}); define it in a module"
                ) from None
        far.close()
        self.cases: list[int] = []

    def give(self, cases: list[int]) -> None:
        self.cases = cases
        with suppress(OSError):  # it has just died; its sentinel will tell
            self.pipe.send(cases)

    def dismiss(self) -> None:
        """There is nothing more to do for it: it may release its FMUs while others work."""
        with suppress(OSError):
            self.pipe.send(None)

    def close(self) -> None:
        self.process.join(_PATIENCE if not self.cases else 0.0)
        self.process.kill()
        self.process.join()
        self.pipe.close()


@final
class _Pool:
    def __init__(self, plan: Plan, folders: Folders, waiting: deque[int], count: int, deliver: Deliver) -> None:
        self._plan, self._folders = plan, folders
        self._waiting = waiting
        self._suspects: deque[int] = deque()  # of processes that have died: one by one
        self._deaths: dict[int, int] = {}
        self._deliver = deliver
        self._count = count
        self._workers: list[_Worker] = []

    def run(self) -> None:
        for _ in range(min(self._count, len(self._waiting))):
            self._workers.append(self._started())
        while any(worker.cases for worker in self._workers):
            busy = [worker for worker in self._workers if worker.cases]
            ready = wait([*(w.pipe for w in busy), *(w.process.sentinel for w in busy)])
            for worker in busy:
                alive = True
                if worker.pipe in ready:
                    alive = self._receive(worker)
                if not alive or (worker.process.sentinel in ready and not worker.pipe.poll()):
                    self._replace(worker)
                elif not worker.cases:
                    worker.give(self._next())

    def close(self) -> None:
        for worker in self._workers:
            worker.dismiss()
        for worker in self._workers:
            worker.close()

    def _started(self) -> _Worker:
        """A new process, at work before the next one is made."""
        worker = _Worker(self._plan, self._folders)
        worker.give(self._next())
        return worker

    def _next(self) -> list[int]:
        if self._suspects:
            return [self._suspects.popleft()]
        # ever smaller portions: few reports, and yet all processes end together
        size = min(_MOST, -(-len(self._waiting) // (4 * self._count)))
        return [self._waiting.popleft() for _ in range(size)]

    def _receive(self, worker: _Worker) -> bool:
        """Take a report; False if the process died before its end."""
        try:
            outcomes: dict[int, Outcome] = worker.pipe.recv()
        except (EOFError, OSError):
            return False
        worker.cases = [case for case in worker.cases if case not in outcomes]
        self._deliver(outcomes)
        return True

    def _replace(self, worker: _Worker) -> None:
        lost, worker.cases = worker.cases, []
        worker.dismiss()
        worker.close()
        code = worker.process.exitcode
        if len(lost) == 1:
            self._deaths[lost[0]] = self._deaths.get(lost[0], 0) + 1
            if self._deaths[lost[0]] == _LIVES:
                self._deliver({lost[0]: f"the process that simulated it died, {_LIVES} times (exit code {code})"})
                lost = []
        self._suspects.extend(lost)
        self._workers[self._workers.index(worker)] = self._started()


def _work(pipe: Connection, plan: Plan, folders: Folders, parent: int) -> None:
    """What a process does: simulate what comes, until nobody is there any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the parent's, who ends us
    gc.freeze()  # what was there before the fork stays; looking through it would copy its memory
    with Session(plan, folders) as session:
        while True:
            while not pipe.poll(1.0):
                if os.getppid() != parent:
                    return
            outcomes: dict[int, Outcome] = {}
            reported = time.monotonic()
            cases: list[int] | None = pipe.recv()
            if cases is None:
                return
            for case in cases:
                outcomes[case] = session.outcome(case)
                if time.monotonic() - reported > _FLUSH:
                    pipe.send(outcomes)
                    outcomes, reported = {}, time.monotonic()
            if outcomes:
                pipe.send(outcomes)
