"""Files that appear when they are complete."""

from __future__ import annotations

import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EACCES, EISDIR
from pathlib import Path
from typing import IO

from liaisons.errors import SimulationError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file to write in place of another; takes its place at the end, if nothing went wrong.

    Links are followed.  What is no plain file (a device, a pipe, what the standard output goes to), or has no file
    beside it because the folder is locked, is written into.

    :raises SimulationError: if it cannot be written.
    """
    try:
        if _is_kept(path):
            with tempfile.TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True) as folder:
                whole = Path(folder, path.name)
                yield whole
                with whole.open("rb") as source, _opened(path) as sink:
                    shutil.copyfileobj(source, sink)
            return
        target = path.resolve()
        part = _part(target)
        try:
            yield part
            part.replace(target)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)
    except OSError as error:
        raise _unwritable(path, error) from None


def check_writable(path: Path) -> None:
    """Notice before a long run what would keep :func:`replacing` from writing after it, as far as one can know.

    :raises SimulationError: if it cannot be written.
    """
    try:
        if not _is_kept(path):
            part = _part(path.resolve())
            part.open("xb").close()
            part.unlink()
        elif path.is_dir():
            raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
        elif not os.access(path, os.W_OK):  # not opened: that of a pipe waits until somebody reads
            raise PermissionError(EACCES, os.strerror(EACCES))
    except OSError as error:
        raise _unwritable(path, error) from None


def _part(target: Path) -> Path:
    return target.with_name(f".{target.name}.{os.getpid()}.part")


def _is_kept(path: Path) -> bool:
    """Whether this is written into rather than replaced."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return False
    locked = not os.access(path.resolve().parent, os.W_OK)
    return locked or not stat.S_ISREG(status.st_mode) or _standard_stream(status) is not None


def _standard_stream(status: os.stat_result) -> int | None:
    """The descriptor of the standard output or error, if it goes to this file."""
    for descriptor in (1, 2):
        with suppress(OSError):  # it is closed
            if os.path.samestat(status, os.fstat(descriptor)):
                return descriptor
    return None


def _opened(path: Path) -> IO[bytes]:
    """What is no plain file, to be written into; a standard stream goes on where it is."""
    descriptor = _standard_stream(path.stat())
    if descriptor is None:
        return path.open("wb")
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    return os.fdopen(os.dup(descriptor), "wb")


def _unwritable(path: Path, error: OSError) -> SimulationError:
    return SimulationError(f"{path}: cannot be written: {error.strerror}; choose another path")
