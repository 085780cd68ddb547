"""Files that are replaced as a whole."""

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
    """A temporary file that replaces another one at the end, unless an exception is raised.

    Links are followed.  A device, a pipe, the file of a standard stream, and a file in a folder that cannot be written
    are overwritten instead.

    :raises SimulationError: if it cannot be written.
    """
    try:
        if _is_overwritten(path):
            with tempfile.TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True) as folder:
                part = Path(folder, path.name)
                yield part
                with part.open("rb") as source, _opened(path) as sink:
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
    """Check before a long run that :func:`replacing` can write after it, as far as possible.

    :raises SimulationError: if it cannot be written.
    """
    try:
        if not _is_overwritten(path):
            part = _part(path.resolve())
            part.open("xb").close()
            part.unlink()
        elif path.is_dir():
            raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
        elif not os.access(path, os.W_OK):  # not opened: opening a pipe waits for a reader
            raise PermissionError(EACCES, os.strerror(EACCES))
    except OSError as error:
        raise _unwritable(path, error) from None


def _part(target: Path) -> Path:
    return target.with_name(f".{target.name}.{os.getpid()}.part")


def _is_overwritten(path: Path) -> bool:
    """Whether a file is overwritten instead of replaced."""
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
    """A file opened for overwriting; a standard stream continues at its position."""
    descriptor = _standard_stream(path.stat())
    if descriptor is None:
        return path.open("wb")
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    return os.fdopen(os.dup(descriptor), "wb")


def _unwritable(path: Path, error: OSError) -> SimulationError:
    return SimulationError(f"{path}: cannot be written: {error.strerror}; choose another path")
