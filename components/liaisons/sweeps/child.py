"""A process that simulates for a thread of a Dask worker, which could neither end nor survive what an FMU does in it.

Not of :mod:`multiprocessing`: a Dask worker is a daemon, and those may have no children there.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from contextlib import suppress
from threading import Event, Timer
from typing import final

from liaisons.errors import SweepError
from liaisons.processes import die_with_parent
from liaisons.sweeps.outcome import LIVES, Outcome, died, too_long
from liaisons.sweeps.session import session

_SERVE = "import sys; from liaisons.sweeps.child import serve; serve(int(sys.argv[1]))"


@final
class Child:
    """The process; started when it is needed, and anew when it has died.

    :param task: a :data:`liaisons.sweeps.session.Task`, pickled.
    """

    def __init__(self, task: bytes) -> None:
        self._task: bytes | None = task  # None when it is closed
        self._process: subprocess.Popen[bytes] | None = None

    def outcome(self, case: int, time_limit: float | None) -> Outcome:
        """Simulate one case; what goes wrong comes back in words.

        :param time_limit: after which the process is ended [s]; its start does not count.
        :raises SweepError: if the process cannot be started.
        """
        code = None
        for _ in range(LIVES):
            process, late = self._running(), Event()
            found = _asked(process, case, time_limit, late)
            if found is not None and not late.is_set():
                return found
            code = self._end()
            if late.is_set():
                return found or too_long(time_limit or 0.0)
        return died(code)

    def close(self) -> None:
        """End the process, whatever it does, for good."""
        self._task = None
        self._end()

    def _running(self) -> subprocess.Popen[bytes]:
        if self._task is None:
            raise SweepError("the sweep has been ended")
        if self._process is None:
            self._process = process = subprocess.Popen(
                [sys.executable, "-c", _SERVE, str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
            assert process.stdin is not None
            assert process.stdout is not None
            with suppress(OSError):
                process.stdin.write(self._task)
                process.stdin.flush()
            if process.stdout.read(1) != b"!":
                raise SweepError(f"a process ended when it was to begin (exit code {self._end()}); its log says why")
        return self._process

    def _end(self) -> int | None:
        process, self._process = self._process, None
        if process is None:
            return None
        process.kill()
        with suppress(OSError), process:  # closes the pipes
            process.wait()
        return process.returncode


def serve(parent: int) -> None:
    """What the process does: simulate what comes, until nobody is there any more."""
    die_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the one who waits
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what an FMU prints is no answer
    with session(pickle.load(sys.stdin.buffer)) as outcome, suppress(EOFError):
        answers.write(b"!")
        answers.flush()
        while True:
            pickle.dump(outcome(pickle.load(sys.stdin.buffer)), answers)
            answers.flush()


def _asked(process: subprocess.Popen[bytes], case: int, time_limit: float | None, late: Event) -> Outcome | None:
    """What the process says of a case; None if it dies over it."""

    def end() -> None:
        late.set()
        process.kill()

    assert process.stdin is not None
    assert process.stdout is not None
    timer = Timer(time_limit or 0.0, end)
    if time_limit is not None:
        timer.start()
    try:
        pickle.dump(case, process.stdin)
        process.stdin.flush()
        return pickle.load(process.stdout)
    except (EOFError, OSError, pickle.UnpicklingError):
        return None
    finally:
        timer.cancel()
