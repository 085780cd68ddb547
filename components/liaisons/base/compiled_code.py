"""C code that is compiled for one process, and calls of its functions.

A library is made for this machine and does not leave it.  Loops in it vectorise: sines and exponentials by glibc's
vector library (libmvec, errors below 4 units in the last place) where there is one, fused multiply-add where the
processor has it.  Nothing is reassociated and neither infinities nor not-a-number are assumed away, so no
``-ffast-math``: results are those of the scalar code up to such roundings.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import CDLL, c_double, c_long, c_void_p
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from liaisons.base.compiler import compile_library, host_target
from liaisons.errors import BuildError

_PRECISE = (
    *("-O3", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast"),
    *("-fopenmp-simd", "-fvisibility=default"),
)
# Without -fno-builtin gcc makes one sincos of sin and cos, of which there is no vector.
_GCC = ("-mprefer-vector-width=512", "-fno-builtin-sin", "-fno-builtin-cos", "-DLIBMVEC", "-lmvec", "-lm")
_CLANG = ("-fveclib=libmvec", "-lmvec", "-lm")  # gcc knows no such option
_THIS_MACHINE = "-march=native"
_OPTIONS = (
    (*_PRECISE, _THIS_MACHINE, *_CLANG),
    (*_PRECISE, _THIS_MACHINE, *_GCC),
    (*_PRECISE, _THIS_MACHINE),
    _PRECISE,
)
"""Options, the best ones first; the first that a compiler takes are used."""


def call_c_function(library: CDLL, name: str, *arguments: Any) -> int:
    """Call a C function of a library, with contiguous arrays of the types that it takes."""
    called = getattr(library, name)
    called.restype = c_long
    return called(*map(_c_argument, arguments))


def _c_argument(argument: Any) -> Any:
    """Argument of a C function as a ctypes object."""
    if isinstance(argument, np.ndarray):
        assert argument.flags.c_contiguous
        return c_void_p(argument.ctypes.data)
    return c_double(argument) if isinstance(argument, float) else c_long(argument)


@lru_cache(maxsize=64)
def compiled_library(code: str, *options: str) -> CDLL:
    """Loaded library of C code, compiled once per process.

    :param options: of the compiler, beside those for lanes.
    :raises BuildError: if there is no compiler, or it fails.
    """
    return loaded_library(_library_bytes(code.encode(), [(*best, *options) for best in _OPTIONS]))


def loaded_library(content: bytes) -> CDLL:
    """Library loaded from the content of its file."""
    with TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True) as folder:  # Windows keeps what is loaded
        path = Path(folder, f"ensemble{host_target().extension}")
        path.write_bytes(content)
        return CDLL(str(path))


def _library_bytes(code: bytes, option_sets: Sequence[tuple[str, ...]]) -> bytes:
    """Content of the library that C code compiles to with the first option set that the compiler takes."""
    options, *further = option_sets
    target = host_target()
    try:
        return compile_library({"ensemble.c": code}, replace(target, flags=(*target.flags, *options)))
    except BuildError:
        if not further:
            raise
        return _library_bytes(code, further)
