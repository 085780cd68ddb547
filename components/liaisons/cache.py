"""The user's cache: what can be made again, and which FMUs need not be tried before they are run."""

from __future__ import annotations

import os
import secrets
import sys
from contextlib import suppress
from hashlib import file_digest
from pathlib import Path

_MOST = 1000  # digests that are kept, the newest
_known: set[str] = set()  # what this process has added, also where nothing can be written


def folder() -> Path:
    """Where this system wants what can be made again."""
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


def knows(key: str) -> bool:
    """Whether an FMU of this digest was built by us, or tried with success."""
    return key in _known or key in _kept()


def remember(key: str) -> None:
    """Add a digest; where the cache cannot be written, for this process only."""
    _known.add(key)
    path = _file()
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    lines = [line for line in _kept() if line != key][1 - _MOST :]
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_text("\n".join([*lines, key]), encoding="ascii")
            part.replace(path)  # of two at once one is lost, which is tried again then
        finally:
            part.unlink(missing_ok=True)


def _file() -> Path:
    return folder() / "fmus-that-run"


def _kept() -> list[str]:
    try:
        return _file().read_text(encoding="ascii").splitlines()
    except (OSError, ValueError):  # ValueError: not ours
        return []
