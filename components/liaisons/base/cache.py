"""The user's cache: object files, compiled libraries, and digests of FMUs that need no trial before they are run."""

from __future__ import annotations

import os
import secrets
import sys
from contextlib import suppress
from hashlib import file_digest, sha256
from pathlib import Path

_MOST = 1000  # digests that are stored, the newest
_LARGEST = 2**27  # bytes of all object files that are stored, those that were used last
_remembered: set[str] = set()  # by this process, also if the cache cannot be written
_objects: dict[str, bytes] = {}  # likewise


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
    return key in _remembered or key in _stored_digests()


def add_trusted_fmu(key: str) -> None:
    """Store a digest; where the cache cannot be written, for this process only."""
    _remembered.add(key)
    path = _digests_file()
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    lines = [line for line in _stored_digests() if line != key][1 - _MOST :]
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_text("\n".join([*lines, key]), encoding="ascii")
            part.replace(path)  # of two at once one is lost, and its FMU tried again
        finally:
            part.unlink(missing_ok=True)


def _digests_file() -> Path:
    """Path of the file of stored digests."""
    return folder() / "fmus-that-run"


def _stored_digests() -> list[str]:
    """Stored digests, the newest last."""
    try:
        return _digests_file().read_text(encoding="ascii").splitlines()
    except (OSError, ValueError):  # ValueError: not ours
        return []


def read_entry(key: str) -> bytes | None:
    """Content of a stored object file; None if it is not there as a whole."""
    path = folder() / "objects" / key
    with suppress(OSError):
        content = path.read_bytes() if key not in _objects else b""
        if content[:32] == sha256(content[32:]).digest():
            _objects[key] = content[32:]
            os.utime(path)
    return _objects.get(key)


def write_entry(key: str, content: bytes) -> None:
    """Store an object file, and remove those that were not used for the longest time, if all are too large."""
    _objects[key] = content
    path = folder() / "objects" / key
    part = path.with_name(f".{key}.{secrets.token_hex(4)}")
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_bytes(sha256(content).digest() + content)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        size = 0
        for status, file in sorted(((file.stat(), file) for file in path.parent.iterdir()), key=_newest_first):
            size += status.st_size
            if size > _LARGEST:
                file.unlink(missing_ok=True)


def _newest_first(entry: tuple[os.stat_result, Path]) -> int:
    """Key that sorts files by the time of their last use, the newest first."""
    return -entry[0].st_mtime_ns
