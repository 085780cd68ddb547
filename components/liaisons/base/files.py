"""Files that are replaced as a whole, and arguments in TOML files."""

from __future__ import annotations

import os
import shutil
import stat
import sys
import tempfile
import tomllib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from errno import EACCES, EISDIR
from pathlib import Path
from typing import IO, Any

from liaisons.errors import LiaisonsError, SimulationError, suggestion


@contextmanager
def atomic_replacement(path: Path) -> Iterator[Path]:
    """Yield a temporary path, whose file replaces another one at the end unless an exception is raised.

    Links are followed.  A device, a pipe, the file of a standard stream, and a file in a folder that cannot be written
    are overwritten instead.

    :raises OSError: if it cannot be written.
    """
    if _must_be_overwritten(path):
        with tempfile.TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True) as folder:
            part = Path(folder, path.name)
            yield part
            with part.open("rb") as source, _open_for_overwriting(path) as sink:
                shutil.copyfileobj(source, sink)
        return
    target = path.resolve()
    part = _temporary_path(target)
    try:
        yield part
        part.replace(target)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


@contextmanager
def replacement_path(path: Path) -> Iterator[Path]:
    """Yield the path of :func:`atomic_replacement`; for files that a user has named.

    :raises SimulationError: if it cannot be written.
    """
    try:
        with atomic_replacement(path) as part:
            yield part
    except OSError as error:
        raise _unwritable_error(path, error) from None


def check_writable(path: Path) -> None:
    """Raise the SimulationError of :func:`replacement_path` before a long run, not after it.

    :raises SimulationError: if it cannot be written.
    """
    try:
        if not _must_be_overwritten(path):
            part = _temporary_path(path.resolve())
            part.open("xb").close()
            part.unlink()
        elif path.is_dir():
            raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
        elif not os.access(path, os.W_OK):  # not opened: opening a pipe waits for a reader
            raise PermissionError(EACCES, os.strerror(EACCES))
    except OSError as error:
        raise _unwritable_error(path, error) from None


def read_toml_arguments(
    path: Path, keys: Collection[str], examples: Mapping[str, str], error: type[LiaisonsError]
) -> dict[str, Any]:
    """Read the arguments of a function from a TOML file.

    :param keys: their names.
    :param examples: required keys, each with an example value.
    :raises LiaisonsError: the class ``error``, if it cannot be read, has another key, or lacks one.
    """
    try:
        arguments = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as problem:
        raise error(f"{path}: {problem}") from None
    for key in arguments:
        if key not in keys:
            raise error(f"{path}: unknown key {key!r}{suggestion(key, keys)}")
    for key, example in examples.items():
        if key not in arguments:
            raise error(f"{path}: {key} is missing, for example {key} = {example}")
    return arguments


def file_beside(path: Path, name: str) -> str:
    """Path of the file of a name in the folder of ``path``; the name itself if there is no such file."""
    file = path.parent / name
    return str(file) if file.is_file() else name


def _temporary_path(target: Path) -> Path:
    """New path beside a file."""
    return target.with_name(f".{target.name}.{os.urandom(4).hex()}.part")


def _must_be_overwritten(path: Path) -> bool:
    """Whether a file cannot be replaced: a device, a pipe, a standard stream, or in a locked folder."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return False
    locked = not os.access(path.resolve().parent, os.W_OK)
    return locked or not stat.S_ISREG(status.st_mode) or _standard_output_descriptor(status) is not None


def _standard_output_descriptor(status: os.stat_result) -> int | None:
    """File descriptor of standard output (1) or error (2) if it goes to this file; else None."""
    for descriptor in (1, 2):
        with suppress(OSError):  # it is closed
            if os.path.samestat(status, os.fstat(descriptor)):
                return descriptor
    return None


def _open_for_overwriting(path: Path) -> IO[bytes]:
    """Open a file for overwriting; a standard stream continues at its position."""
    descriptor = _standard_output_descriptor(path.stat())
    if descriptor is None:
        return path.open("wb")
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    return os.fdopen(os.dup(descriptor), "wb")


def _unwritable_error(path: Path, error: OSError) -> SimulationError:
    """Error for a path that cannot be written."""
    return SimulationError(f"{path}: cannot be written: {error.strerror}; choose another path")
