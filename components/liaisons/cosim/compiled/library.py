"""Libraries of our own C code, each compiled once per user and kept in the cache."""

from __future__ import annotations

from ctypes import CDLL
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from liaisons.base import cache
from liaisons.base.compiler import FLAGS, compile_library, host_target
from liaisons.base.files import atomic_replacement
from liaisons.base.folders import process_folder
from liaisons.base.logs import logger
from liaisons.errors import BuildError

_FOLDER = Path(__file__).parent
STEPS = _FOLDER / "loop.c", _FOLDER / "calls.h"
"""Sources of communication steps; Python, too, can make those of explicit coupling, to the same bits."""

_COUPLED_STEPS = _FOLDER / "coupling.c", _FOLDER / "calls.h"


@lru_cache
def cached_library(sources: tuple[Path, ...], consequence: str) -> CDLL | None:
    """The loaded library of C files; None if they cannot be compiled.

    :param consequence: what happens then, for the log.
    """
    contents = {source.name: source.read_bytes() for source in sources}
    try:
        target = host_target()
        key = sha256(repr((contents, target, FLAGS)).encode()).hexdigest()
        if (library := cache.read_entry(key)) is None:
            library = compile_library(contents, target)
            cache.write_entry(key, library)
        path = cache.folder() / f"{sources[0].stem}-{key[:16]}{target.extension}"
        return CDLL(str(_file_with_content(path, library)))
    except (BuildError, OSError) as error:
        logger.info("%s: %s", consequence, error)
        return None


def _file_with_content(path: Path, content: bytes) -> Path:
    """Write a file unless it has this content; return its path, or that of a temporary file if it cannot be written."""
    try:
        if not path.is_file() or path.read_bytes() != content:  # a part of a library would end this process
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_replacement(path) as part:
                part.write_bytes(content)
    except OSError:
        path = process_folder() / path.name
        path.write_bytes(content)
    return path


def step_library(*, coupled: bool = False) -> CDLL | None:
    """Compiled library of communication steps, or of what couples them; None if it cannot be compiled or loaded.

    Coupling takes five times as long to compile, and one FMU alone does not need it.
    """
    sources, makers = (_COUPLED_STEPS, "explicit ones are made") if coupled else (STEPS, "communication steps are made")
    return cached_library(sources, f"{makers} by Python")
