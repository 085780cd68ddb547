"""Folders: of built FMUs, and temporary ones, which are removed when their process ends, however it ends."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import sleep

# Reads the name of each folder when it is created and again when it is removed; at the end of its input it removes the
# rest.  It ignores the signals that end the process it serves.
_JANITOR = """
import shutil, signal, sys
for name in ("SIGINT", "SIGTERM", "SIGHUP"):
    if hasattr(signal, name):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
folders = set()
for line in sys.stdin.buffer:
    folders ^= {bytes.fromhex(line.decode())}
for folder in folders:
    shutil.rmtree(folder, ignore_errors=True)
"""


_PAUSES = (0.0, 0.01, 0.1, 0.0)
"""Pauses before a folder is removed once more [s]; what is left then is left to the janitor."""


def fmus_directory() -> Path:
    """Directory of built FMUs: ``$LIAISONS_FMUS``, else ``fmus/`` in the working directory."""
    return Path(os.environ.get("LIAISONS_FMUS") or "fmus")


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a new folder, which is removed at the end of the context, or when this process is killed."""
    folder = TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True)
    _report_folder(folder.name)
    try:
        with folder:
            yield Path(folder.name)
    finally:
        for pause in _PAUSES:  # what could not be removed at that instant
            if not os.path.lexists(folder.name):
                _report_folder(folder.name)
                break
            sleep(pause)
            shutil.rmtree(folder.name, ignore_errors=True)


@lru_cache(maxsize=1)
def process_folder() -> Path:
    """Path of the temporary folder of this process, made at the first call and removed when the process ends."""
    stack = ExitStack()
    atexit.register(stack.close)
    return stack.enter_context(temporary_folder())


def _report_folder(name: str) -> None:
    """Send the name of a folder to the janitor, when it is created and when it is removed."""
    with suppress(OSError):  # no second process: then only the context removes it
        os.write(_start_janitor(os.getpid()), os.fsencode(name).hex().encode() + b"\n")


@lru_cache(maxsize=1)
def _start_janitor(_process: int) -> int:
    """Start a process that removes folders after this one has ended; returns the pipe to it.

    :param _process: id of this process: a forked one starts its own.
    """
    read, write = os.pipe()
    try:
        janitor = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _JANITOR],
            stdin=read,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=Path(sys.executable).anchor,
            start_new_session=True,
        )
    except OSError:
        os.close(write)
        raise
    finally:
        os.close(read)
    janitor.returncode = 0  # it ends after this process: no wait
    return write
