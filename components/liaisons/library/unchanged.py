"""FMUs of the catalogue that need no derivation: neither they nor any source has changed since they were built."""

from __future__ import annotations

import os
import sys
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

from liaisons.base.cache import read_entry, write_entry
from liaisons.base.compiler import system_compiler

_PACKAGES = Path(__file__).resolve().parents[2]
_VARIABLES = ("CPATH", "C_INCLUDE_PATH", "SOURCE_DATE_EPOCH")


def is_unchanged(fmu: Path) -> bool:
    """Whether this file was noted, and all of our sources, libraries and the compiler are those of then."""
    return fmu.is_file() and read_entry(_key(fmu)) is not None


def note_unchanged(fmu: Path) -> None:
    """Note that this file is up to date."""
    write_entry(_key(fmu), b"")


def _key(fmu: Path) -> str:
    return sha256(f"{_state(fmu.resolve())} {_sources()} {[*map(os.environ.get, _VARIABLES)]}".encode()).hexdigest()


def _state(path: Path) -> tuple[str, int, int, int]:
    status = path.stat()
    return str(path), status.st_mtime_ns, status.st_size, status.st_ino


@cache
def _sources() -> str:
    """Digest of names, times and sizes of the files that an FMU is made from, and by."""
    files = [_PACKAGES.parent / "pyproject.toml", Path(sys.executable)]
    files += [Path(spec.origin) for name in ("casadi", "numpy") if (spec := find_spec(name)) and spec.origin]
    files += [Path(word) for word in (system_compiler() or [])[:1]]
    for package in sorted(_PACKAGES.glob("liaisons*")):
        for folder, below, names in os.walk(package):
            below[:] = sorted(name for name in below if name != "__pycache__")
            files += [Path(folder) / name for name in sorted(names)]
    return sha256(repr([_state(file) for file in files if file.is_file()]).encode()).hexdigest()
