"""FMU and SSP archives, checked before they are unpacked."""

from __future__ import annotations

import io
import os
import shutil
import stat
import struct
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePosixPath
from typing import IO, final
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, ZipInfo

from liaisons.base.arguments import shown
from liaisons.errors import LiaisonsError, SimulationError

UNPACKED_LIMIT = 2**30
"""Largest unpacked size of an archive in bytes, FMUs inside included, unless :data:`LIMIT_VARIABLE` is set."""

LIMIT_VARIABLE = "LIAISONS_UNPACKED_LIMIT"
"""Environment variable that replaces the limit; child processes inherit it."""

DESCRIPTION = "modelDescription.xml"
"""Member that every FMU has."""
START_VALUES = "resources/starts.txt"
"""Member of an FMU of liaisons with start values, and with a table that its motion follows."""

_MOST_MEMBERS = 50_000
_LONGEST_DIRECTORY = 2**24  # bytes; Python reads it as a whole
_DAMAGE = (BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, struct.error, OverflowError)
"""Exceptions of Python for a damaged file."""


def unpacked_limit() -> int:
    """Largest allowed size of an archive in bytes, unpacked.

    :raises SimulationError: if :data:`LIMIT_VARIABLE` is not a positive number.
    """
    text = os.environ.get(LIMIT_VARIABLE)
    if text is None:
        return UNPACKED_LIMIT
    try:
        value = float(text)
        if not value >= 1:
            raise ValueError
        return int(value)
    except (ValueError, OverflowError):
        raise SimulationError(f"{LIMIT_VARIABLE} = {text!r}: give a number of bytes, for example 4e9") from None


def size_error(label: str, size: int) -> SimulationError:
    """Error for an archive whose unpacked size is above the limit."""
    return SimulationError(
        f"{label} takes {size} bytes unpacked, more than the limit of {unpacked_limit()}; if you trust it, raise the "
        f"limit by {LIMIT_VARIABLE}"
    )


def file_identity(path: Path) -> tuple[int, ...]:
    """Time of modification, size and inode of a file, which tell whether it was changed or replaced.

    :raises SimulationError: if it is missing, is not a regular file, or cannot be read.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise SimulationError(f"{path}: no such file; check the path, or build it with 'liaisons build'") from None
    except (OSError, ValueError) as error:  # ValueError: a path that no system can have
        raise SimulationError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from None
    if not stat.S_ISREG(status.st_mode):
        what = "a directory" if stat.S_ISDIR(status.st_mode) else "no plain file"
        raise SimulationError(f"{path}: is {what}, not an archive; check the path, or build it with 'liaisons build'")
    return status.st_mtime_ns, status.st_size, status.st_ino


@final
class Archive:
    """An open archive, a context manager.

    :ivar size: of its files in bytes, according to the directory.
    :raises SimulationError: if it is missing, damaged, encrypted or too big, or has names that lead out of a folder,
        links, contradictory duplicates, or a compression that FMI and SSP do not have.  All methods raise it, too.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        file_identity(path)  # raises if there is none
        with ExitStack() as stack, self._translated_errors(Exception):  # anything in an untrusted file
            self._zip = stack.enter_context(ZipFile(stack.enter_context(_DirectoryLimitedFile(path))))
            self._members = self._checked_members()
            if self.size > unpacked_limit():
                raise size_error(str(path), self.size)
            self._stack = stack.pop_all()

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @contextmanager
    def open(self, name: str) -> Iterator[IO[bytes]]:
        """Yield an open file of the archive."""
        with self._translated_errors(*_DAMAGE), self._zip.open(self._members[name]) as file:
            yield file

    @property
    def names(self) -> list[str]:
        """Names of its files."""
        return [name for name in self._members if not name.endswith("/")]

    @property
    def folders(self) -> list[str]:
        """Names of its folders, which end with a slash."""
        return [name for name in self._members if name.endswith("/")]

    def unpacked_size(self, name: str) -> int:
        """Size of a file of the archive in bytes, unpacked."""
        return self._members[name].file_size

    def copy(self, name: str, target: Path) -> None:
        """Extract a file of the archive to a path, whose folder is made."""
        with self.open(name) as file:
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("wb") as out:
                shutil.copyfileobj(file, out)

    def extract(self, folder: Path, excluded_prefixes: tuple[str, ...] = ()) -> Path:
        """Extract all files and folders whose names do not begin with a prefix.

        :returns: the folder.
        """
        for name in self._members:
            if not name.startswith(excluded_prefixes):
                with self._translated_errors(*_DAMAGE):
                    self._zip.extract(name, folder)
        return folder

    @contextmanager
    def _translated_errors(self, *damage: type[Exception]) -> Iterator[None]:
        """Raise a SimulationError instead of an OSError, or of an exception for a damaged archive."""
        try:
            yield
        except LiaisonsError:
            raise
        except OSError as error:
            raise SimulationError(f"{self.path}: cannot be read or unpacked: {error.strerror or error}") from None
        except damage as error:
            kind = "damaged" if "CRC" in str(error) else "truncated, damaged, or no archive at all"
            raise SimulationError(f"{self.path}: {kind} ({error}); build or copy it again") from None

    def _checked_members(self) -> dict[str, ZipInfo]:
        """Members of the archive by name; raises a SimulationError for unsafe, unreadable or contradictory ones."""
        members: dict[str, ZipInfo] = {}
        self.size = 0
        listed = self._zip.infolist()
        if len(listed) > _MOST_MEMBERS:
            raise SimulationError(f"{self.path}: has {len(listed)} files inside; no more than {_MOST_MEMBERS} are read")
        for member in listed:
            reason = _refusal_reason(member)
            other = members.get(member.filename, member)
            if (other.CRC, other.file_size) != (member.CRC, member.file_size):  # some tools write the same file twice
                reason = "is there twice"
            if reason:
                raise SimulationError(f"{self.path}: {shown(member.orig_filename)} inside {reason}; export it anew")
            self.size += 0 if member.filename in members else member.file_size
            members[member.filename] = member
        return members


@final
class _DirectoryLimitedFile(io.FileIO):
    """An archive file whose directory is not read into memory if it is too long."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Read bytes; raises BadZipFile for more than a directory may have."""
        if size is not None and size > _LONGEST_DIRECTORY:
            raise BadZipFile(f"a directory of {size} bytes")
        return super().read(size) or b""


def _refusal_reason(member: ZipInfo) -> str:
    """Reason why a member is refused, as the end of a sentence; empty if it is not."""
    name = member.orig_filename
    if not name or "\0" in name:
        return "is not a name of a file"
    if "\\" in name or ":" in name or name.startswith("/") or ".." in PurePosixPath(name).parts:
        return "would lie outside the folder that it is unpacked to"
    if stat.S_ISLNK(member.external_attr >> 16):
        return "is a symbolic link"
    if member.flag_bits & 0x1:
        return "is encrypted"
    if member.compress_type not in {ZIP_STORED, ZIP_DEFLATED}:
        return f"is compressed by method {member.compress_type}, but FMI and SSP allow only 0 (none) and 8 (deflate)"
    return ""
