"""Steps of a fixed size for all members at once: by compiled code over lanes, or by NumPy.

Members go through all their steps in blocks of as many lanes as keep the stages of a step in the first-level cache.
Within a block every loop is over the lanes and vectorises: sines and exponentials by glibc's vector library (libmvec,
errors below 4 units in the last place) where there is one, fused multiply-add where the processor has it.  Nothing is
reassociated and neither infinities nor not-a-number are assumed away, so no ``-ffast-math``: results are those of the
scalar code up to such roundings.  The library is made for this machine and does not leave it.
"""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.compiler import Target, compile_library, host, system_compiler, zig_compiler
from liaisons.ensembles.equations import Equations
from liaisons.ensembles.methods import METHODS, Tableau
from liaisons.errors import BuildError
from liaisons.expressions import c_statements, program

LANES = 32

Floats = NDArray[np.float64]

Advance = Callable[[float, float, int, Floats, Floats], None]
"""(start time, step size, steps, constants of the lanes, states): moves the states, (blocks, ..., LANES) each."""

_UNUSED = "    (void)t, (void)shared, (void)k;"  # not every component depends on all of them
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


@final
@dataclass(frozen=True, eq=False)
class Kernel:
    """The right-hand side of an ensemble with a method, ready to advance any number of blocks.

    :param advance: moves states in place; may be called from several threads at once, for blocks of their own.
    :param compiled: whether it is machine code; else NumPy.
    """

    advance: Advance
    compiled: bool


def kernel(equations: Equations, method: str, shared: Floats, *, native: bool | None) -> Kernel:
    """Prepare the steps.

    :param shared: values that are given once for all members.
    :param native: compile (True), use NumPy (False), or whichever is possible (None).
    :raises BuildError: if there is no compiler but ``native`` asks for one, or it fails.
    """
    tableau = METHODS[method]
    if native is None:
        native = bool(system_compiler() or zig_compiler())
    if not native:
        return Kernel(_by_numpy(equations, tableau, shared), compiled=False)
    integrate = _library(source(equations, tableau)).integrate
    pointer, long, double = ctypes.POINTER(ctypes.c_double), ctypes.c_long, ctypes.c_double
    integrate.argtypes = [long, long, double, double, pointer, pointer, pointer]
    integrate.restype = None

    def advance(start: float, size: float, steps: int, constants: Floats, states: Floats) -> None:
        addresses = (array.ctypes.data_as(pointer) for array in (shared, constants, states))
        integrate(len(states), steps, start, size, *addresses)

    return Kernel(advance, compiled=True)


def source(equations: Equations, tableau: Tableau) -> str:
    """C99 of an ensemble."""
    t, lanes, shared = equations.constants
    inputs = [(t, "t"), (lanes, "k[{}][i]"), (shared, "shared[{}]"), (equations.y, "y[{}][i]")]
    states = equations.y.numel()
    lines = [
        "#include <math.h>",
        *_declarations(),
        f"typedef double Row[{LANES}];",
        "",
        "static void rates(double t, const double *shared, const Row *k, const Row *restrict y, Row *restrict f)",
        "{",
        _UNUSED,
        *_loop(c_statements(inputs, [(equations.rates, "f[{}][i]")])),
        "}",
        "",
    ]
    if equations.projected is not None:
        lines += [
            "static void project(double t, const double *shared, const Row *k, Row *y)",
            "{",
            _UNUSED,
            *_loop(c_statements(inputs, [(equations.projected, "y[{}][i]")])),
            "}",
            "",
        ]
    then = ["    project(t + h, shared, k, y);"] if equations.projected is not None else []
    lines += [
        "static void step(double t, double h, const double *shared, const Row *k, Row *y)",
        "{",
        f"    Row f[{tableau.stages}][{states}], at[{states}];",
        "    rates(t, shared, k, (const Row *)y, f[0]);",
        *(line for stage in range(1, tableau.stages) for line in _stage(tableau, stage, states)),
        *_combination("y", tableau.weights, states),
        *then,
        "}",
        "",
        "void integrate(long blocks, long steps, double start, double h, const double *shared,",
        "               const double *constants, double *states)",
        "{",
        "    for (long block = 0; block < blocks; ++block) {",
        f"        const Row *k = (const Row *)(constants + block * {lanes.numel() * LANES});",
        f"        Row *y = (Row *)(states + block * {states * LANES});",
        "        for (long n = 0; n < steps; ++n)",
        "            step(start + (double)n * h, h, shared, k, y);",
        "    }",
        "}",
        "",
    ]
    return "\n".join(lines)


def _declarations() -> Iterator[str]:
    """Tell gcc what libmvec has; the system's header does so under -ffast-math only."""
    name, version = platform.libc_ver()
    known = tuple(int(part) for part in version.split(".")[:2]) if name == "glibc" else ()
    yield "#ifdef LIBMVEC"
    for ones, twos, since in _VECTORISED:
        if known >= since:
            for functions, arguments in ((ones, "double"), (twos, "double, double")):
                for function in functions:
                    yield f'__attribute__((const, simd("notinbranch"))) double {function}({arguments});'
    yield "#endif"


def _loop(statements: Sequence[str]) -> Iterator[str]:
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


def _stage(tableau: Tableau, stage: int, states: int) -> Iterator[str]:
    yield from _combination("at", tableau.matrix[stage], states)
    yield f"    rates(t + {tableau.nodes[stage]!r} * h, shared, k, (const Row *)at, f[{stage}]);"


def _by_numpy(equations: Equations, tableau: Tableau, shared: Floats) -> Advance:
    t_symbol, lanes, shared_symbol = equations.constants
    symbols = [t_symbol, lanes, shared_symbol, equations.y]
    right_hand_side = program(symbols, [equations.rates])
    projection = None if equations.projected is None else program(symbols, [equations.projected])
    once = shared[:, None]

    def advance(start: float, size: float, steps: int, constants: Floats, states: Floats) -> None:
        k, y = constants.swapaxes(0, 1).reshape(lanes.numel(), -1), states.swapaxes(0, 1).reshape(states.shape[1], -1)

        def rates(time: float, at: Floats) -> Floats:
            return right_hand_side.evaluate([[time], k, once, at])[0]

        for n in range(steps):
            time = start + n * size
            f = [rates(time, y)]
            for node, row in zip(tableau.nodes[1:], tableau.matrix[1:], strict=True):
                f.append(rates(time + node * size, y + size * _sum(row, f)))
            y = y + size * _sum(tableau.weights, f)
            if projection is not None:
                y = projection.evaluate([[time + size], k, once, y])[0]
        states[:] = y.reshape(states.shape[1], states.shape[0], -1).swapaxes(0, 1)

    return advance


def _sum(weights: Sequence[float], f: Sequence[Floats]) -> Floats:
    total = np.zeros_like(f[0])
    for weight, rate in zip(weights, f, strict=False):
        if weight:
            total += weight * rate
    return total


_folder = TemporaryDirectory(prefix="liaisons-ensemble-", ignore_cleanup_errors=True)  # until the process ends


@lru_cache(maxsize=64)
def _library(code: str) -> ctypes.CDLL:
    """Compile and load; the same code is compiled once a process."""
    target = host()
    binary = _compiled(code, target, _WAYS)
    path = Path(_folder.name, f"{len(list(Path(_folder.name).iterdir()))}{target.extension}")
    path.write_bytes(binary)
    return ctypes.CDLL(str(path))


def _compiled(code: str, target: Target, ways: Sequence[tuple[str, ...]]) -> bytes:
    """By the first of these ways that the compiler takes."""
    way, *others = ways
    try:
        return compile_library({"ensemble.c": code.encode()}, replace(target, flags=(*target.flags, *way)))
    except BuildError:
        if not others:
            raise
        return _compiled(code, target, others)
