"""Ends of processes: with their parent, and in good order on signals.

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
"""Default for a call of an isolated FMU [s]."""
_SET_DEATH_SIGNAL, _SET_DUMPABLE, _SET_SUBREAPER = 1, 4, 36  # PR_SET_PDEATHSIG, _DUMPABLE, _CHILD_SUBREAPER
_SYNCHRONIZE, _INFINITE = 0x0010_0000, 0xFFFF_FFFF
_PAUSE = 0.2  # [s] between two checks of the parent
_GRACE = 3.0  # [s] for an orderly end
_MOMENT = 1e-3  # [s] between two checks of killed processes
_ENDINGS = {getattr(signal, name) for name in ("SIGTERM", "SIGCHLD") if hasattr(signal, name)}
_handled: set[int] = set()  # signals that end this process in good order


def die_with_parent(parent: int) -> None:
    """Let this process end as soon as its parent ends; to be called first in a process.

    On Linux the kernel does it, when the *thread* ends that started the
    process; elsewhere a thread watches, which foreign code that never returns does not stop.

    :param parent: ``os.getpid()`` of the parent, taken there: it may have ended before this is called.
    """
    if not (sys.platform == "linux" and _process_control(_SET_DEATH_SIGNAL, signal.SIGKILL)):
        threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()
    if sys.platform != "win32" and os.getppid() != parent:
        os._exit(1)


def _process_control(option: int, value: int) -> bool:
    """Set an attribute of this process (Linux's prctl); returns whether it succeeded."""
    return ctypes.CDLL(None).prctl(option, ctypes.c_ulong(value)) == 0


def fork_guarded(*, close: Callable[[], object]) -> int:
    """Fork (Linux) with a guard process between, which kills all descendants of the child when child or parent ends.

    The guard ends as the new process does, after its descendants, or when it is terminated (SIGTERM).

    :param close: closes files that the guard must not keep open.
    :returns: in the parent the id of the guard, in the new process 0.
    """
    parent = os.getpid()
    if guard := os.fork():
        return guard
    guard = os.getpid()
    usual = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDINGS)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles interrupts
    _process_control(_SET_DEATH_SIGNAL, signal.SIGTERM)
    _process_control(_SET_SUBREAPER, 1)  # orphans become our children
    if os.getppid() != parent:
        os._exit(1)
    child = os.fork()
    if not child:
        die_with_parent(guard)
        signal.pthread_sigmask(signal.SIG_SETMASK, usual)
        return 0
    try:
        close()
        code = _supervise_child(child)
        if code < 0:
            _die_by_signal(-code)
        os._exit(code)
    finally:
        os._exit(1)


def _supervise_child(child: int) -> int:
    """Wait for the end of a child or SIGTERM, then kill all descendants; returns the exit code of the child."""
    statuses: dict[int, int] = {}
    while child not in statuses and signal.sigwait(_ENDINGS) != signal.SIGTERM:
        statuses |= _reap_children()
    end = time.monotonic() + _GRACE
    while (left := _child_processes()) and time.monotonic() < end:
        for process in left:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)  # no effect on one that is ending
        time.sleep(_MOMENT)
        statuses |= _reap_children()
    return os.waitstatus_to_exitcode(statuses.get(child, 1))


def _die_by_signal(number: int) -> None:
    """End this process by a signal, without a core dump."""
    _process_control(_SET_DUMPABLE, 0)
    if number != signal.SIGKILL:
        signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})
    os.kill(os.getpid(), number)


def _reap_children() -> dict[int, int]:
    """Release children that have ended; returns their statuses by process id."""
    statuses: dict[int, int] = {}
    with suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            statuses[ended[0]] = ended[1]
    return statuses


def _child_processes() -> list[int]:
    """Process ids of the children of this process, from /proc."""
    children = []
    for entry in os.scandir("/proc"):
        if entry.name.isdigit():
            with suppress(OSError):
                words = Path(entry.path, "stat").read_bytes().rpartition(b")")[2].split()
                if int(words[1]) == os.getpid():
                    children.append(int(entry.name))
    return children


def _end_with_parent(parent: int) -> None:
    """Wait for the end of the parent, then end this process."""
    if sys.platform == "win32":
        kernel = ctypes.WinDLL("kernel32")
        kernel.OpenProcess.restype = ctypes.c_void_p
        handle = ctypes.c_void_p(kernel.OpenProcess(_SYNCHRONIZE, 0, parent))
        kernel.WaitForSingleObject(handle, _INFINITE)  # returns at once if the process has ended
    else:
        while os.getppid() == parent:
            time.sleep(_PAUSE)
    os._exit(1)


@contextmanager
def orderly_end() -> Iterator[None]:
    """Raise SystemExit in the context for SIGTERM and SIGHUP, which release resources then like any exception.

    It exits with status 128 + signal, after some seconds even if foreign code does not return.
    """
    usual = signal.SIG_DFL
    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    numbers = {number for name in names if signal.getsignal(number := getattr(signal, name)) is usual}  # unless ignored
    if sys.platform == "win32" or _handled or threading.current_thread() is not threading.main_thread():
        yield
        return
    read, write = os.pipe()
    os.set_blocking(write, False)
    before = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    _register_fork_handlers()
    _handled.update(numbers)
    for number in numbers:
        signal.signal(number, _raise_exit)
    threading.Thread(target=_end_after_grace, args=(read,), daemon=True).start()
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, usual)
        _handled.clear()
        signal.set_wakeup_fd(before)
        os.close(write)


def _raise_exit(number: int, _frame: object) -> None:
    """Raise SystemExit for a signal."""
    raise SystemExit(128 + number)


def _end_after_grace(pipe: int) -> None:
    """End this process some seconds after a signal whose number comes through the pipe, even during foreign code."""
    while number := os.read(pipe, 1):
        if number[0] in _handled:
            time.sleep(_GRACE)
            os._exit(128 + number[0])
    os.close(pipe)


@lru_cache(maxsize=1)
def _register_fork_handlers() -> None:
    """Register handlers that block signals before a fork, and restore their defaults in the new process."""
    os.register_at_fork(before=_block_signals, after_in_parent=_unblock_signals, after_in_child=_restore_signals)


def _block_signals() -> None:
    """Block the handled signals before a fork."""
    signal.pthread_sigmask(signal.SIG_BLOCK, _handled)


def _unblock_signals() -> None:
    """Unblock the handled signals after a fork."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _handled)


def _restore_signals() -> None:
    """Restore the handled signals in a forked process."""
    if _handled:
        signal.set_wakeup_fd(-1)
        for number in _handled:
            signal.signal(number, signal.SIG_DFL)
        _unblock_signals()
        _handled.clear()
