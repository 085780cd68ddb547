"""Files that appear when they are complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from liaisons.errors import SimulationError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file to write in place of another; takes its place at the end, if nothing went wrong.

    :raises SimulationError: if it cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise SimulationError(f"{path}: cannot be written: {error.strerror}; choose another path") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
