"""Folders for passing files, which go with the process that made them, however it ends."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

# Told each folder when it is made and again when it has gone; at the end of its input it removes those that are left.
# No signal that ends the process it serves ends it, too.
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


@contextmanager
def passing_folder() -> Iterator[Path]:
    """A new folder; it goes at the end, and if this process is killed or crashes before, right after it."""
    folder = TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True)
    _tell(folder.name)
    try:
        with folder:
            yield Path(folder.name)
    finally:
        _tell(folder.name)


def _tell(name: str) -> None:
    with suppress(OSError):  # there can be no other process, or it was killed: then only an orderly end removes it
        os.write(_janitor(os.getpid()), os.fsencode(name).hex().encode() + b"\n")


@lru_cache(maxsize=1)
def _janitor(_process: int) -> int:
    """The pipe to a janitor of this process; a forked one has its own."""
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
    janitor.returncode = 0  # nobody waits for it: it ends after us
    return write
