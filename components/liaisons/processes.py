"""Processes that do not outlive the one that started them; the standard library only, so that they start quickly."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time

_SET_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG
_SYNCHRONIZE, _INFINITE = 0x0010_0000, 0xFFFF_FFFF
_PAUSE = 0.2  # [s] between two looks at the parent


def die_with_parent(parent: int) -> None:
    """End this process as soon as its parent ends, however that comes about and whatever this one does by then.

    Called by the new process, first thing.  On Linux the kernel does it, when the *thread* ends that started the
    process; elsewhere a thread watches, which foreign code that never returns does not stop.

    :param parent: ``os.getpid()`` of the parent, taken there: it may have ended before this is called.
    """
    if not (sys.platform == "linux" and _killed_by_kernel()):
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    if sys.platform != "win32" and os.getppid() != parent:
        os._exit(1)


def _killed_by_kernel() -> bool:
    return ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, ctypes.c_ulong(signal.SIGKILL)) == 0


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
