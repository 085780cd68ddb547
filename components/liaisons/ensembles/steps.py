"""Steps of a fixed size for all cases at once: by compiled code over lanes, or by NumPy.

Cases go through all their steps in blocks of as many lanes as keep the stages of a step in the first-level cache.
Within a block every loop is over the lanes and vectorises: sines and exponentials by glibc's vector library (libmvec,
errors below 4 units in the last place) where there is one, fused multiply-add where the processor has it.  Nothing is
reassociated and neither infinities nor not-a-number are assumed away, so no ``-ffast-math``: results are those of the
scalar code up to such roundings.  The library is made for this machine and does not leave it.
"""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.compiler import compile_library, host
from liaisons.ensembles.methods import Tableau
from liaisons.ensembles.right_hand_sides import RightHandSide
from liaisons.errors import BuildError
from liaisons.expressions import c_statements, program

LANES = 32

Floats = NDArray[np.float64]

Advance = Callable[[float, float, int, Floats, Floats], None]
"""(start time, step size, steps, values of the lanes, states): moves the states, (blocks, ..., LANES) each, in place;
may be called from several threads at once, for blocks of their own."""

_VECTORISED = (
    (("sin", "cos", "exp", "log"), ("pow",), (2, 22)),
    (
        ("acos", "acosh", "asin", "asinh", "atan", "atanh", "cosh", "erf", "expm1", "log1p", "sinh", "tan", "tanh"),
        ("atan2",),
        (2, 35),
    ),
)
"""Functions of one and of two arguments in libmvec, and since which glibc."""

_PRECISE = (
    *("-O3", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast"),
    *("-fopenmp-simd", "-fvisibility=default"),
)
# Without -fno-builtin gcc makes one sincos of sin and cos, of which there is no vector.
_GCC = ("-mprefer-vector-width=512", "-fno-builtin-sin", "-fno-builtin-cos", "-DLIBMVEC", "-lmvec", "-lm")
_CLANG = ("-fveclib=libmvec", "-lmvec", "-lm")  # gcc knows no such option
_HERE = "-march=native"
_WAYS = ((*_PRECISE, _HERE, *_CLANG), (*_PRECISE, _HERE, *_GCC), (*_PRECISE, _HERE), _PRECISE)
"""Options, the best ones first; the first that a compiler takes are used."""

_SOURCE = """\
#include <math.h>
{declarations}
typedef double Row[{lanes}];

static void rates(double t, const double *shared, const Row *k, const Row *restrict y, Row *restrict f)
{{
    (void)t, (void)shared, (void)k;
{rates}
}}

static void project(double t, const double *shared, const Row *k, Row *y)
{{
    (void)t, (void)shared, (void)k;
{projection}
}}

static void step(double t, double h, const double *shared, const Row *k, Row *y)
{{
    Row f[{count}][{states}], at[{states}];
{stages}
    project(t + h, shared, k, y);
}}

void integrate(long blocks, long steps, double start, double h, const double *shared,
               const double *constants, double *states)
{{
    for (long block = 0; block < blocks; ++block) {{
        const Row *k = (const Row *)(constants + block * {constants} * {lanes});
        Row *y = (Row *)(states + block * {states} * {lanes});
        for (long n = 0; n < steps; ++n)
            step(start + (double)n * h, h, shared, k, y);
    }}
}}
"""
"""Not every component depends on all that its functions are given."""


def compiled(equations: RightHandSide, tableau: Tableau, shared: Floats) -> Advance:
    """Steps in machine code.

    :param shared: values that all cases share.
    :raises BuildError: if there is no compiler, or it fails.
    """
    integrate = library(source(equations, tableau)).integrate
    pointer, long, double = ctypes.POINTER(ctypes.c_double), ctypes.c_long, ctypes.c_double
    integrate.argtypes = [long, long, double, double, pointer, pointer, pointer]
    integrate.restype = None

    def advance(start: float, size: float, steps: int, lanes: Floats, states: Floats) -> None:
        addresses = (array.ctypes.data_as(pointer) for array in (shared, lanes, states))
        integrate(len(states), steps, start, size, *addresses)

    return advance


def by_numpy(equations: RightHandSide, tableau: Tableau, shared: Floats) -> Advance:
    """The same steps by NumPy."""
    right_hand_side = program(equations.symbols, [equations.rates])
    projection = None if equations.projected is None else program(equations.symbols, [equations.projected])

    def advance(start: float, size: float, steps: int, lanes: Floats, states: Floats) -> None:
        k, y = (array.swapaxes(0, 1).reshape(array.shape[1], -1) for array in (lanes, states))

        def rates(time: float, at: Floats) -> Floats:
            return right_hand_side.evaluate([[time], k, shared[:, None], at])[0]

        for n in range(steps):
            time = start + n * size
            f = [rates(time, y)]
            for node, row in zip(tableau.nodes[1:], tableau.matrix[1:], strict=True):
                f.append(rates(time + node * size, y + size * _sum(row, f)))
            y = y + size * _sum(tableau.weights, f)
            if projection is not None:
                y = projection.evaluate([[time + size], k, shared[:, None], y])[0]
        states[:] = y.reshape(states.shape[1], states.shape[0], -1).swapaxes(0, 1)

    return advance


def _sum(weights: Sequence[float], f: Sequence[Floats]) -> Floats:
    total = np.zeros_like(f[0])
    for weight, rate in zip(weights, f, strict=False):
        if weight:
            total += weight * rate
    return total


def source(equations: RightHandSide, tableau: Tableau) -> str:
    """C99 of an ensemble."""
    states, projected = equations.start.numel(), equations.projected
    stages = ["    rates(t, shared, k, (const Row *)y, f[0]);"]
    for stage in range(1, tableau.stages):
        stages += _combination("at", tableau.matrix[stage], states)
        stages.append(f"    rates(t + {tableau.nodes[stage]!r} * h, shared, k, (const Row *)at, f[{stage}]);")
    stages += _combination("y", tableau.weights, states)
    return _SOURCE.format(
        declarations="\n".join(declarations()),
        rates="\n".join(_loop(equations, equations.rates, "f[{}][i]")),
        projection="    (void)y;" if projected is None else "\n".join(_loop(equations, projected, "y[{}][i]")),
        stages="\n".join(stages),
        lanes=LANES,
        count=tableau.stages,
        constants=equations.symbols[1].numel(),
        states=states,
    )


def declarations() -> Iterator[str]:
    """Tell gcc what libmvec has; the system's header does so under -ffast-math only."""
    name, version = platform.libc_ver()
    glibc = tuple(int(part) for part in version.split(".")[:2]) if name == "glibc" else ()
    yield "#ifdef LIBMVEC"
    for ones, twos, since in _VECTORISED:
        if glibc >= since:
            for functions, arguments in ((ones, "double"), (twos, "double, double")):
                for function in functions:
                    yield f'__attribute__((const, simd("notinbranch"))) double {function}({arguments});'
    yield "#endif"


def _loop(equations: RightHandSide, expressions: ca.SX, target: str) -> Iterator[str]:
    """Calculates expressions for all lanes."""
    columns = ("t", "k[{}][i]", "shared[{}]", "y[{}][i]")
    statements = c_statements(list(zip(equations.symbols, columns, strict=True)), [(expressions, target)])
    yield "#pragma omp simd"
    yield f"    for (int i = 0; i < {LANES}; ++i) {{"
    yield from (f"        {statement}" for statement in statements)
    yield "    }"


def _combination(target: str, weights: Sequence[float], states: int) -> Iterator[str]:
    terms = " + ".join(f"{weight!r} * f[{stage}][j][i]" for stage, weight in enumerate(weights) if weight)
    yield f"    for (int j = 0; j < {states}; ++j) {{"
    yield "#pragma omp simd"
    yield f"        for (int i = 0; i < {LANES}; ++i)"
    yield f"            {target}[j][i] = y[j][i] + h * ({terms});"
    yield "    }"


@lru_cache(maxsize=64)
def library(code: str) -> ctypes.CDLL:
    """Compile and load; the same code is compiled once a process."""
    with TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True) as folder:  # Windows keeps what is loaded
        path = Path(folder, f"ensemble{host().extension}")
        path.write_bytes(_compiled(code.encode(), _WAYS))
        return ctypes.CDLL(str(path))


def _compiled(code: bytes, option_sets: Sequence[tuple[str, ...]]) -> bytes:
    """The library, by the first of these sets of options that the compiler takes."""
    options, *further = option_sets
    target = host()
    try:
        return compile_library({"ensemble.c": code}, replace(target, flags=(*target.flags, *options)))
    except BuildError:
        if not further:
            raise
        return _compiled(code, further)
