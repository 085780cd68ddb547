"""Hand-written C for benchmarks: compiled with the flags that FMUs are compiled with, called through ctypes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from liaisons.base.compiler import FLAGS
from liaisons.fmu.building import source_files
from liaisons.mechanics.model import Model

BY_HAND = Path(__file__).parent / "by_hand"


def compile_library(folder: Path, name: str, sources: Iterable[Path], *flags: str) -> ctypes.CDLL:
    """Compile C sources with the host's compiler and load the result; they may include headers that the folder has."""
    compiler = shutil.which("cc")
    if compiler is None:
        sys.exit("this benchmark needs a C compiler called cc")
    library = folder / f"{name}.so"
    common = [flag for flag in FLAGS if flag != "-fvisibility=hidden"]
    common += ["-D_POSIX_C_SOURCE=200809L", f"-I{folder}", f"-I{BY_HAND}"]  # clock_gettime is not in C99
    subprocess.run([compiler, *common, *flags, *map(str, sources), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def component_library(model: Model, folder: Path, *by_hand: str) -> ctypes.CDLL:
    """The sources of a native FMU without what is FMI's of them, by_hand/component.c, and more files from by_hand."""
    for name, content in source_files(model, "{}", "2").items():
        (folder / name).write_bytes(content)
    sources = [path for path in sorted(folder.glob("*.c")) if not path.name.startswith("fmi")]
    library = compile_library(folder, "component", [*sources, *(BY_HAND / name for name in ("component.c", *by_hand))])
    library.component_open.restype = ctypes.c_void_p
    library.component_advance.restype = library.component_rates.restype = ctypes.c_double
    library.component_evaluations.restype = ctypes.c_long
    return library


def open_component(
    library: ctypes.CDLL, tolerance: float, *, symplectic_steps: int = 0, stiff: bool = False, counting: bool = False
) -> ctypes.c_void_p:
    """An initialized instance, with the values that were given to the library's ``begin``."""
    tolerant = ctypes.c_double(tolerance)
    return ctypes.c_void_p(library.component_open(tolerant, symplectic_steps, int(stiff), int(counting)))


def doubles(values: Iterable[float]) -> ctypes.Array[ctypes.c_double]:
    """A C array."""
    listed = list(values)
    return (ctypes.c_double * len(listed))(*listed)
