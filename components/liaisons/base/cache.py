"""The user's cache: object files, compiled libraries, and digests of FMUs that need no trial before they are run.

An entry is a file whose name is its key: a checksum, and the content.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from functools import lru_cache
from hashlib import file_digest, sha256
from pathlib import Path

from liaisons.base.files import atomic_replacement

_ENTRIES = "entries"  # folder of the entries in that of the cache
_LARGEST = 2**27  # bytes of all entries that are stored, those that were used last
_CHECKSUM = 32  # bytes of SHA-256
_BLOCK = 2**12  # bytes that a file takes beside its content, at most
_entries: dict[str, bytes] = {}  # of this process, also if the cache cannot be written


def folder() -> Path:
    """Path of the cache folder of this user."""
    if sys.platform == "win32":
        root = os.environ.get("LOCALAPPDATA")
    elif sys.platform == "darwin":
        root = "~/Library/Caches"
    else:
        root = os.environ.get("XDG_CACHE_HOME")
        root = root if root and Path(root).is_absolute() else None  # others are invalid (XDG Base Directory)
    try:
        return Path(root or "~/.cache").expanduser() / "liaisons"
    except RuntimeError:  # a user without a home: nothing can be written there, nor read
        return Path(os.devnull) / "liaisons"


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


def is_trusted_fmu(key: str) -> bool:
    """Whether an FMU with this digest was built by us, or has been tried with success."""
    return read_entry(key) is not None


def add_trusted_fmu(key: str) -> None:
    """Store the digest of an FMU that was built by us, or has been tried with success."""
    write_entry(key, b"")


def read_entry(key: str) -> bytes | None:
    """Content of an entry; None if there is none, or a damaged one."""
    path = folder() / _ENTRIES / key
    with suppress(OSError):
        content = path.read_bytes() if key not in _entries else b""
        if content[:_CHECKSUM] == sha256(content[_CHECKSUM:]).digest():
            _entries[key] = content[_CHECKSUM:]
            os.utime(path)
    return _entries.get(key)


def write_entry(key: str, content: bytes) -> None:
    """Store an entry; where the cache cannot be written, for this process only."""
    _entries[key] = content
    with suppress(OSError):
        entries = folder() / _ENTRIES
        entries.mkdir(parents=True, exist_ok=True)
        with atomic_replacement(entries / key) as part:
            part.write_bytes(sha256(content).digest() + content)
        used = sum(_BLOCK + len(each) for each in _entries.values())
        _remove_least_recent(entries, 8 * used // _LARGEST)


@lru_cache(maxsize=1)
def _remove_least_recent(entries: Path, _eighth: int) -> None:
    """Remove the least recently used entries, if all together are too large.

    :param _eighth: of the limit, to which this process has come; the folder is not read more often.
    """
    size = 0
    files = ((file.stat(), file) for file in entries.iterdir())
    for status, file in sorted(files, key=lambda entry: entry[0].st_mtime_ns, reverse=True):
        size += _BLOCK + status.st_size
        if size > _LARGEST:
            file.unlink(missing_ok=True)
