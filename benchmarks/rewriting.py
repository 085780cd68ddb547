"""What the passes over expressions buy: the same right-hand sides without one of them, their time and their rounding.

    python benchmarks/rewriting.py [--quick]

A pass is switched off while the code is written; the yardstick is all of them.  In lanes, as ensembles calculate, the
number of operations is the time; within a step of an FMU one right-hand side waits for the one before.
"""

from __future__ import annotations

import ctypes
import importlib
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from unittest.mock import patch

import casadi as ca
import numpy as np
import step_cost
from _measure import Row, command, interleaved
from numpy.typing import NDArray

from liaisons.base.compiler import compile_library, host_target
from liaisons.expressions import OPERATIONS, Program, c_parts
from liaisons.expressions.sum_factoring import Expansions
from liaisons.expressions.value_numbering import Builder
from liaisons.fmu import build
from liaisons.language import Component
from liaisons.mechanics import assemble
from liaisons.models import DoublePendulum, KeplerOrbit, Pendulum, PlanarCat, SpatialCat, Swing

LANES, REPEATS = 256, 100
NAMES = {
    "all passes": nullcontext,
    "no sums of products (sums)": lambda: patch.object(Expansions, "shortened_sum", lambda *_: None),
    "no common factors (factors)": lambda: patch.object(importlib.import_module(Program.__module__), "_PASSES", 0),
    "no shorter forms (rewriting)": lambda: patch.object(Builder, "perform", _as_it_is),
}
ALL, *WITHOUT = NAMES

Without = Callable[[], AbstractContextManager[object]]


def _as_it_is(self: Builder, code: int, arguments: Sequence[tuple[float, int]]) -> tuple[float, int]:
    return 1.0, self._add_operation(code, *map(self.node_number, arguments))


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds = 3 if quick else 25
    rows: list[Row] = []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        for component in (Pendulum, DoublePendulum, Swing, PlanarCat, SpatialCat, KeplerOrbit):
            lanes = {title: _lanes(component, off, Path(name)) for title, off in NAMES.items()}
            rows += _rows("A right-hand side in vector lanes", component, interleaved(lanes, rounds), "ns")
        for component in (Pendulum, DoublePendulum, SpatialCat):
            steps = {title: _steps(component, off, Path(name) / title) for title, off in NAMES.items()}
            rows += _rows("A communication step of 1 s of the FMU", component, interleaved(steps, rounds), "µs")
    for component in (Pendulum, DoublePendulum, Swing, PlanarCat, SpatialCat):
        errors = {title: [_rounding(component, off)] for title, off in NAMES.items()}
        rows += _rows("Rounding errors of a right-hand side", component, errors, "ε (root mean square)")
    return rows


def _rows(topic: str, component: type[Component], values: dict[str, list[float]], unit: str) -> list[Row]:
    return [
        Row.of(topic, f"{component.__name__}, {title}", values[title], unit, yardstick=ALL, beside=values[ALL])
        for title in WITHOUT
    ]


def _rates(component: type[Component]) -> tuple[list[ca.SX], ca.SX, list[NDArray]]:
    """Symbols, the rates of all states, and values at seeded random points."""
    function = assemble(component).derivatives
    symbols = [ca.SX(symbol) for symbol in function.sx_in()]
    random = np.random.default_rng(1)
    values = [random.uniform(0.4, 1.6, (symbol.numel(), LANES)) for symbol in symbols]
    return symbols, ca.SX(function.call(symbols, True, False)[0]), values


def _lanes(component: type[Component], off: Without, folder: Path) -> Callable[[], float]:
    """A function that returns nanoseconds a right-hand side."""
    symbols, rates, values = _rates(component)
    with off():
        [body], _ = c_parts(
            [(symbol, f"in{i}[{{}} * {LANES} + i]") for i, symbol in enumerate(symbols)],
            [(rates, f"out[{{}} * {LANES} + i]")],
        )
    arguments = ", ".join(f"const double *restrict in{i}" for i in range(len(symbols)))
    code = f"""#include <math.h>
__attribute__((visibility("default"))) void run({arguments}, double *restrict out) {{
    for (int k = 0; k < {REPEATS}; ++k) for (int i = 0; i < {LANES}; ++i) {{ {" ".join(body)} }}
}}
"""
    with tempfile.NamedTemporaryFile(dir=folder, suffix=host_target().extension, delete=False) as file:
        file.write(compile_library({"run.c": code.encode()}, host_target()))
    run = ctypes.CDLL(file.name).run
    pointers = [np.ctypeslib.as_ctypes(array.ravel()) for array in (*values, np.empty((rates.numel(), LANES)))]

    def timed() -> float:
        begin = time.thread_time_ns()
        run(*pointers)
        return (time.thread_time_ns() - begin) / (LANES * REPEATS)

    return timed


def _steps(component: type[Component], off: Without, folder: Path) -> Callable[[], float]:
    """A function that returns microseconds a step."""
    with off():
        slave = step_cost.load(build(assemble(component), folder))
    state = {"t": 0.0}

    def timed() -> float:
        begin = time.thread_time_ns()
        for _ in range(25):
            slave.fmi2DoStep(slave.component, state["t"], 1.0, 1)
            state["t"] += 1.0
        return (time.thread_time_ns() - begin) / 25e3

    return timed


def _rounding(component: type[Component], off: Without) -> float:
    """Of doubles against numbers of 64 bits, in units of the largest rate's last place."""
    symbols, rates, values = _rates(component)
    with off():
        found = Program.of(symbols, [rates])
    double, exact = (_evaluated(found, values, kind) for kind in (np.float64, np.longdouble))
    size = np.max(np.abs(exact), axis=1, keepdims=True)
    return float(np.sqrt(np.mean(((double - exact) / np.where(size, size, 1)) ** 2)) / np.finfo(float).eps)


def _evaluated(found: Program, values: Sequence[NDArray], kind: type) -> NDArray:
    arrays, numbers = [array.astype(kind) for array in values], []
    for node in found.nodes:
        if node.operation is not None:
            text = OPERATIONS[node.operation].format(*(f"x[{number}]" for number in node.arguments))
            numbers.append(eval(text, vars(np) | {"x": numbers}))
        elif node.constant is not None:
            numbers.append(kind(node.constant))
        else:
            numbers.append(arrays[node.arguments[0]][node.arguments[1]])
    return np.array([np.broadcast_to(numbers[number], LANES) for number in found.outputs[0]])


if __name__ == "__main__":
    command(measure)
