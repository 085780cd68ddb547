"""Libraries of our own C code, each compiled once a user, and kept in the cache."""

from __future__ import annotations

from contextlib import suppress
from ctypes import CDLL
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from liaisons.base import cache
from liaisons.base.compiler import FLAGS, compile_library, host_target
from liaisons.base.files import replacement_path
from liaisons.base.folders import process_folder
from liaisons.base.logs import logger
from liaisons.errors import BuildError, SimulationError


@lru_cache
def compiled_library(sources: tuple[Path, ...], without: str) -> CDLL | None:
    """The library of C files; None if it cannot be compiled or loaded.

    :param without: what happens then, for the log.
    """
    contents = {source.name: source.read_bytes() for source in sources}
    try:
        target = host_target()
        key = sha256(repr((contents, target, FLAGS)).encode()).hexdigest()[:16]
        path = cache.folder() / f"{sources[0].stem}-{key}{target.extension}"
        if not _is_complete(path):
            path = _write_file(path, compile_library(contents, target))
        return CDLL(str(path))
    except (BuildError, OSError) as error:
        logger.info("%s: %s", without, error)
        return None


def _is_complete(path: Path) -> bool:
    """Whether a library file agrees with its stored digest: loading a part would end this process."""
    with suppress(OSError):
        return _digest_path(path).read_text(encoding="ascii", errors="replace") == cache.digest(path)
    return False


def _digest_path(path: Path) -> Path:
    """Path of the file with the digest of a library."""
    return path.with_suffix(".sha256")


def _write_file(path: Path, content: bytes) -> Path:
    """Write a file, in a passing folder of the process if its own path cannot be written, and return its path."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacement_path(path) as part:
            part.write_bytes(content)
        with replacement_path(_digest_path(path)) as part:
            part.write_text(sha256(content).hexdigest(), encoding="ascii")
    except (OSError, SimulationError):
        path = process_folder() / path.name
        path.write_bytes(content)
    return path
