"""Steps of a fixed size for all cases at once, by compiled code over lanes.

Cases go through all their steps in blocks of as many lanes as keep the stages of a step in the first-level cache.
Within a block every loop is over the lanes and vectorises: sines and exponentials by glibc's vector library (libmvec,
errors below 4 units in the last place) where there is one, fused multiply-add where the processor has it.  Nothing is
reassociated and neither infinities nor not-a-number are assumed away, so no ``-ffast-math``: results are those of the
scalar code up to such roundings.  The library is made for this machine and does not leave it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons.base.compiler import compile_library, host_target
from liaisons.ensembles.kernel import step_code
from liaisons.ensembles.methods import Tableau
from liaisons.ensembles.right_hand_sides import RightHandSide
from liaisons.errors import BuildError

LANES = 32

Floats = NDArray[np.float64]

Advance = Callable[[float, float, int, Floats, Floats], None]
"""(start time, step size, steps, values of the lanes, states): advances states in place; arrays (blocks, ..., LANES).

Several threads may call it at once, each for blocks of its own."""

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

_INTEGRATE = """\
void integrate(long blocks, long steps, double start, double h, const double *shared,
               const double *constants, double *states)
{
    static const double limits[] = {-INFINITY, INFINITY};
    for (long block = 0; block < blocks; ++block)
        for (long n = 0; n < steps; ++n)
            step(start + (double)n * h, h, limits, constants + block * K * D, shared, states + block * N * D);
}
"""


def compiled_advance(equations: RightHandSide, tableau: Tableau, shared: Floats) -> Advance:
    """Compiled function that advances the states of all cases in place by steps of one size.

    :param shared: values that all cases share.
    :raises BuildError: if there is no compiler, or it fails.
    """
    code = compiled_library(ensemble_code(equations, tableau))

    def advance(start: float, size: float, steps: int, lanes: Floats, states: Floats) -> None:
        call_c_function(code, "integrate", len(states), steps, start, size, shared, lanes, states)

    return advance


def lane_blocks(rows: Floats, width: int = LANES) -> Floats:
    """Blocks of ``width`` columns each, (blocks, rows, width), the last one padded with the last column."""
    blocks = -(-rows.shape[1] // width)
    padded = np.pad(rows, ((0, 0), (0, blocks * width - rows.shape[1])), mode="edge")
    return np.ascontiguousarray(padded.reshape(len(rows), blocks, width).swapaxes(0, 1))


def rows_of_blocks(blocks: Floats, count: int) -> Floats:
    """Array (..., rows, count) of the first ``count`` columns in blocks (..., blocks, rows, width)."""
    rows = blocks.swapaxes(-3, -2)
    return rows.reshape(*rows.shape[:-2], blocks.shape[-3] * blocks.shape[-1])[..., :count]


def ensemble_code(equations: RightHandSide, tableau: Tableau) -> str:
    """C99 code that integrates blocks of lanes."""
    return step_code(equations, tableau, LANES) + _INTEGRATE


def call_c_function(library: ctypes.CDLL, name: str, *arguments: Any) -> int:
    """Call a C function of a library, with contiguous arrays of the types that it takes."""
    called = getattr(library, name)
    called.restype = ctypes.c_long
    return called(*map(_c_argument, arguments))


def _c_argument(argument: Any) -> Any:
    """Argument of a C function as a ctypes object."""
    if isinstance(argument, np.ndarray):
        assert argument.flags.c_contiguous
        return ctypes.c_void_p(argument.ctypes.data)
    return ctypes.c_double(argument) if isinstance(argument, float) else ctypes.c_long(argument)


@lru_cache(maxsize=64)
def compiled_library(code: str, *options: str) -> ctypes.CDLL:
    """Loaded library of C code, compiled once a process.

    :param options: of the compiler, beside those for lanes.
    :raises BuildError: if there is no compiler, or it fails.
    """
    return loaded_library(_library_bytes(code.encode(), [(*best, *options) for best in _OPTIONS]))


def loaded_library(content: bytes) -> ctypes.CDLL:
    """Library loaded from the content of its file."""
    with TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True) as folder:  # Windows keeps what is loaded
        path = Path(folder, f"ensemble{host_target().extension}")
        path.write_bytes(content)
        return ctypes.CDLL(str(path))


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
