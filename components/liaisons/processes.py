"""How processes end: not later than the one that started them, and in good order when they are asked to.

The standard library only, so that they start quickly.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

TIME_LIMIT = 60.0
"""[s] that a call of an FMU in a process of its own may take unless one says more."""
_SET_DEATH_SIGNAL, _SET_DUMPABLE, _SET_SUBREAPER = 1, 4, 36  # PR_SET_PDEATHSIG, _DUMPABLE, _CHILD_SUBREAPER
_SYNCHRONIZE, _INFINITE = 0x0010_0000, 0xFFFF_FFFF
_PAUSE = 0.2  # [s] between two looks at the parent
_GRACE = 3.0  # [s] for an orderly end
_MOMENT = 1e-3  # [s] between two looks at processes that are killed
_ENDINGS = {getattr(signal, name) for name in ("SIGTERM", "SIGCHLD") if hasattr(signal, name)}
_handled: set[int] = set()  # signals that end this process in good order


def die_with_parent(parent: int) -> None:
    """End this process as soon as its parent ends, whatever this one does by then; called by it first thing.

    On Linux the kernel does it, when the *thread* ends that started the
    process; elsewhere a thread watches, which foreign code that never returns does not stop.

    :param parent: ``os.getpid()`` of the parent, taken there: it may have ended before this is called.
    """
    if not (sys.platform == "linux" and _killed_by_kernel()):
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    if sys.platform != "win32" and os.getppid() != parent:
        os._exit(1)


def _killed_by_kernel() -> bool:
    return _process_control(_SET_DEATH_SIGNAL, signal.SIGKILL)


def _process_control(option: int, value: int) -> bool:
    return ctypes.CDLL(None).prctl(option, ctypes.c_ulong(value)) == 0


def fork_guarded(*, close: Callable[[], object]) -> int:
    """Fork (Linux), with a process between both that ends all that the new one has started when either of them ends.

    It ends as the new process does, once nothing of that is left, and ends it all when it is terminated (SIGTERM).

    :param close: closes what the process between must not keep open.
    :returns: in the parent the id of the process between, in the new process 0.
    """
    parent = os.getpid()
    guard = os.fork()
    if guard:
        return guard
    guard = os.getpid()
    usual = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDINGS)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the parent's, who ends us
    _process_control(_SET_DEATH_SIGNAL, signal.SIGTERM)
    _process_control(_SET_SUBREAPER, 1)  # what loses its parent is our child then
    if os.getppid() != parent:
        os._exit(1)
    child = os.fork()
    if not child:
        die_with_parent(guard)
        signal.pthread_sigmask(signal.SIG_SETMASK, usual)
        return 0
    try:
        close()
        code = _guarded(child)
        if code < 0:
            _die_of(-code)
        os._exit(code)
    finally:
        os._exit(1)


def _guarded(child: int) -> int:
    """Wait for the end of a child, or SIGTERM, and end all that is left; the exit code of the child."""
    statuses: dict[int, int] = {}
    while child not in statuses and signal.sigwait(_ENDINGS) != signal.SIGTERM:
        statuses |= _reaped()
    end = time.monotonic() + _GRACE
    while (left := _children()) and time.monotonic() < end:
        for process in left:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)  # does nothing to one that is ending
        time.sleep(_MOMENT)
        statuses |= _reaped()
    return os.waitstatus_to_exitcode(statuses.get(child, 1))


def _die_of(number: int) -> None:
    """End as by this signal, without a core."""
    _process_control(_SET_DUMPABLE, 0)
    if number != signal.SIGKILL:
        signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})
    os.kill(os.getpid(), number)


def _reaped() -> dict[int, int]:
    """Children that have ended, and their statuses."""
    found: dict[int, int] = {}
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            found[ended[0]] = ended[1]
    return found


def _children() -> list[int]:
    """Of this process, by the file system of processes."""
    found = []
    for entry in os.scandir("/proc"):
        if entry.name.isdigit():
            with suppress(OSError):
                words = Path(entry.path, "stat").read_bytes().rpartition(b")")[2].split()
                if int(words[1]) == os.getpid():
                    found.append(int(entry.name))
    return found


def _watch(parent: int) -> None:
    if sys.platform == "win32":
        kernel = ctypes.WinDLL("kernel32")
        kernel.OpenProcess.restype = ctypes.c_void_p
        handle = ctypes.c_void_p(kernel.OpenProcess(_SYNCHRONIZE, 0, parent))
        kernel.WaitForSingleObject(handle, _INFINITE)  # at once if there is no such process any more
    else:
        while os.getppid() == parent:
            time.sleep(_PAUSE)
    os._exit(1)


@contextmanager
def orderly_end() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end this process as an exception does, so that what it holds is released.

    It exits with status 128 + signal.  Foreign code that does not return within some seconds is not waited for.
    """
    usual = signal.SIG_DFL
    wanted = {getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)}
    numbers = {int(number) for number in wanted if signal.getsignal(number) is usual}  # not those that nohup ignores
    if sys.platform == "win32" or _handled or threading.current_thread() is not threading.main_thread():
        yield
        return
    read, write = os.pipe()
    os.set_blocking(write, False)
    before = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    _forget_after_fork()
    _handled.update(numbers)
    for number in numbers:
        signal.signal(number, _end)
    threading.Thread(target=_end_at_last, args=(read,), daemon=True).start()
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, usual)
        _handled.clear()
        signal.set_wakeup_fd(before)
        os.close(write)


def _end(number: int, _frame: object) -> None:
    raise SystemExit(128 + number)


def _end_at_last(pipe: int) -> None:
    """Wait for one of the signals, whose numbers Python writes even while foreign code runs."""
    while number := os.read(pipe, 1):
        if number[0] in _handled:
            time.sleep(_GRACE)
            os._exit(128 + number[0])
    os.close(pipe)


@lru_cache(maxsize=1)
def _forget_after_fork() -> None:
    """A forked process shares the pipe, so that its signals would end us: it is to have none of all this."""
    os.register_at_fork(before=_hold, after_in_parent=_let_go, after_in_child=_forget)


def _hold() -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, _handled)


def _let_go() -> None:
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _handled)


def _forget() -> None:
    if _handled:
        signal.set_wakeup_fd(-1)
        for number in _handled:
            signal.signal(number, signal.SIG_DFL)
        _let_go()
        _handled.clear()
