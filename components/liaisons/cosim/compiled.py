"""Libraries of our own C code, each compiled once; from then on it lies in the user's cache."""

from __future__ import annotations

import atexit
from contextlib import ExitStack
from ctypes import CDLL
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from liaisons import cache
from liaisons.compiler import FLAGS, compile_library, host
from liaisons.cosim.messages import logger
from liaisons.errors import BuildError, SimulationError
from liaisons.files import replacing
from liaisons.folders import passing_folder


@lru_cache
def loaded(source: Path, without: str) -> CDLL | None:
    """The library of a C file; None where it cannot be had.

    :param without: what happens then, for the log.
    """
    content = source.read_bytes()
    try:
        target = host()
        key = sha256(repr((content, target, FLAGS)).encode()).hexdigest()[:16]
        path = cache.folder() / f"{source.stem}-{key}{target.extension}"
        if not path.exists():
            path = _written(path, compile_library({source.name: content}, target))
        return CDLL(str(path))
    except (BuildError, OSError) as error:
        logger.info("%s: %s", without, error)
        return None


def _written(path: Path, content: bytes) -> Path:
    """A file of this content: here, or where this cannot be written, in a folder that lasts as long as the process."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            part.write_bytes(content)
    except (OSError, SimulationError):
        path = _passing() / path.name
        path.write_bytes(content)
    return path


@lru_cache(maxsize=1)
def _passing() -> Path:
    stack = ExitStack()
    atexit.register(stack.close)
    return stack.enter_context(passing_folder())
