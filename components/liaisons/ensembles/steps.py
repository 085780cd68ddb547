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
from typing import Any, Literal

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
"""(start time, step size, steps, values of the lanes, states): moves the states, (blocks, ..., LANES) each, in place;
may be called from several threads at once, for blocks of their own."""

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


def compiled(equations: RightHandSide, tableau: Tableau, shared: Floats) -> Advance:
    """Function that takes steps of all cases, in machine code.

    :param shared: values that all cases share.
    :raises BuildError: if there is no compiler, or it fails.
    """
    code = library(source(equations, tableau))

    def advance(start: float, size: float, steps: int, lanes: Floats, states: Floats) -> None:
        """Advance the states of blocks by steps of one size."""
        call(code, "integrate", len(states), steps, start, size, shared, lanes, states)

    return advance


def packs(rows: Floats, width: int = LANES, fill: Literal["constant", "edge"] = "constant") -> Floats:
    """(rows, columns) as (blocks, rows, width); the last block is filled up with zeros, or with the last column."""
    blocks = -(-rows.shape[1] // width)
    padded = np.pad(rows, ((0, 0), (0, blocks * width - rows.shape[1])), mode=fill)
    return np.ascontiguousarray(padded.reshape(len(rows), blocks, width).swapaxes(0, 1))


def unpacked(blocks: Floats, count: int) -> Floats:
    """(..., blocks, rows, width) as (..., rows, columns), of which there are ``count``."""
    rows = blocks.swapaxes(-3, -2)
    return rows.reshape(*rows.shape[:-2], blocks.shape[-3] * blocks.shape[-1])[..., :count]


def source(equations: RightHandSide, tableau: Tableau) -> str:
    """C99 code of an ensemble."""
    return step_code(equations, tableau, LANES) + _INTEGRATE


def call(code: ctypes.CDLL, name: str, *arguments: Any) -> int:
    """Call a C function of a library; arrays must be contiguous and have the type that it takes."""
    called = getattr(code, name)
    called.restype = ctypes.c_long
    return called(*map(_c_argument, arguments))


def _c_argument(argument: Any) -> Any:
    """The argument as ctypes object."""
    if isinstance(argument, np.ndarray):
        assert argument.flags.c_contiguous
        return ctypes.c_void_p(argument.ctypes.data)
    return ctypes.c_double(argument) if isinstance(argument, float) else ctypes.c_long(argument)


@lru_cache(maxsize=64)
def library(code: str, *options: str) -> ctypes.CDLL:
    """Compile C code and load the library; the same code is compiled once a process.

    :param options: of the compiler, beside those for packs.
    :raises BuildError: if there is no compiler, or it fails.
    """
    return loaded(_library_bytes(code.encode(), [(*best, *options) for best in _OPTIONS]))


def loaded(content: bytes) -> ctypes.CDLL:
    """Load a library from its bytes."""
    with TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True) as folder:  # Windows keeps what is loaded
        path = Path(folder, f"ensemble{host_target().extension}")
        path.write_bytes(content)
        return ctypes.CDLL(str(path))


def _library_bytes(code: bytes, option_sets: Sequence[tuple[str, ...]]) -> bytes:
    """Compile C code by the first set of options that the compiler takes."""
    options, *further = option_sets
    target = host_target()
    try:
        return compile_library({"ensemble.c": code}, replace(target, flags=(*target.flags, *options)))
    except BuildError:
        if not further:
            raise
        return _library_bytes(code, further)
