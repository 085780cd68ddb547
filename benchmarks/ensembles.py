"""Ensembles beside the scalar step that CasADi generates.

    python benchmarks/ensembles.py [--quick]

One RK4 step of one member on one core, by CasADi's C (compiled as for an FMU, in a C loop over the members) and by
:mod:`liaisons.ensembles`, in processor time; then the same ensemble on all cores beside one, by the clock on the wall
(so the machine has to be idle).  Both have the same right-hand side, the same constants folded into it, and the
same states.  Ratios are taken round by round.
"""

from __future__ import annotations

import ctypes
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import casadi as ca
import numpy as np
from _measure import Row, command

from liaisons.compiler import compile_library, host
from liaisons.ensembles.methods import METHODS
from liaisons.ensembles.right_hand_sides import INTEGRALS, RightHandSide, flat_model, operator_model, right_hand_side
from liaisons.ensembles.steps import LANES, compiled
from liaisons.language import Component
from liaisons.models import CircularHoop, EllipticHoop, Pendulum, Ramp, Sinusoid

MEMBERS = 64 * LANES
STEP = 0.001
CASES: dict[str, tuple[type[Component], dict[str, type[Component]], dict[str, float]]] = {
    "pendulum": (Pendulum, {}, {"theta_0": 0.1}),
    "pendulum, length moved": (Pendulum, {"length": Sinusoid}, {"length.amplitude": 0.1, "length.offset": 1.0}),
    "circular hoop": (CircularHoop, {"beta": Ramp}, {"beta.rate": 1.0}),
    "elliptic hoop": (EllipticHoop, {"beta": Ramp}, {"beta.rate": 1.0}),
}
ASKED = {"pendulum": ">= 8", "circular hoop": ">= 3"}
CORES = os.cpu_count() or 1

Timed = Callable[[], None]


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, steps = (3, 100) if quick else (9, 500)
    return [row for title in CASES for row in _measured(title, rounds, steps)]


def _measured(title: str, rounds: int, steps: int) -> list[Row]:
    component, operators, values = CASES[title]
    model = flat_model(component)
    moving = {name: operator_model(model, name, operator) for name, operator in operators.items()}
    moved = [state.name for state in model.states if state.name not in INTEGRALS]
    found = right_hand_side(model, moving, lanes=values, shared=[], record=moved)
    count = steps * MEMBERS
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        runs = {"scalar": _scalar(found, values, steps, Path(folder))}
        runs |= {cores: _ensemble(found, values, steps, threads) for cores, threads in (("one", 1), ("all", CORES))}
        for run in runs.values():
            run()  # to warm up
        times = [{name: _timed(run) for name, run in runs.items()} for _ in range(rounds)]
    wall, processor = ({name: [t[name][k] for t in times] for name in runs} for k in (0, 1))
    scalar, one = ([count / seconds for seconds in processor[name]] for name in ("scalar", "one"))
    one_wall, every_wall = ([count / seconds for seconds in wall[name]] for name in ("one", "all"))
    return [
        Row.of(
            "One core, processor time", title, one, "steps/s",
            yardstick="CasADi's C in a loop", beside=scalar, asked=ASKED.get(title, ""),
        ),
        Row.of(f"{CORES} cores, by the clock", title, every_wall, "steps/s", yardstick="one core", beside=one_wall),
    ]  # fmt: skip


def _timed(run: Timed) -> tuple[float, float]:
    """Seconds by the clock on the wall, and of processor time."""
    begin, begin_processor = time.perf_counter(), time.process_time()
    run()
    return time.perf_counter() - begin, time.process_time() - begin_processor


def _start(found: RightHandSide, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Constants and states, (rows, MEMBERS), somewhat different for each member."""
    random = np.random.default_rng(0)
    constants = np.array([[value] * MEMBERS for value in values.values()])
    return constants, random.uniform(-1.0, 1.0, (found.start.numel(), MEMBERS))


def _ensemble(found: RightHandSide, values: Mapping[str, float], steps: int, threads: int) -> Timed:
    advance = compiled(found, METHODS["rk4"], np.zeros(0))
    constants, states = (
        np.ascontiguousarray(rows.reshape(len(rows), -1, LANES).swapaxes(0, 1)) for rows in _start(found, values)
    )
    chunk = max(1, len(states) // (4 * threads))
    pool = ThreadPoolExecutor(threads)

    def part(first: int) -> None:
        advance(0.0, STEP, steps, constants[first : first + chunk], states[first : first + chunk])

    def run() -> None:
        firsts = range(0, len(states), chunk)
        list(pool.map(part, firsts) if threads > 1 else map(part, firsts))

    return run


def _scalar(found: RightHandSide, values: Mapping[str, float], steps: int, folder: Path) -> Timed:
    """CasADi's C of one step, called for one member after the other."""
    t, lanes, shared, y = found.symbols
    rates = ca.Function("rates", [t, lanes, y], [found.rates])
    tableau, h = METHODS["rk4"], STEP
    f = [rates(t, lanes, y)]
    for node, row in zip(tableau.nodes[1:], tableau.matrix[1:], strict=True):
        f.append(rates(t + node * h, lanes, y + h * sum(a * g for a, g in zip(row, f, strict=True) if a)))
    end = y + h * sum(b * g for b, g in zip(tableau.weights, f, strict=True))
    assert not shared.numel()
    step = ca.Function("step", [t, lanes, y], ca.cse([end]))
    generator = ca.CodeGenerator("step", {"with_header": False, "with_export": False})
    generator.add(step)
    loop = f"""
    __attribute__((visibility("default"))) void integrate(long members, long steps, const double *lanes, double *y)
    {{
        double w[{step.sz_w() + 1}]; casadi_int iw[{step.sz_iw() + 1}];
        const double *arg[{step.sz_arg()}]; double *res[{step.sz_res()}];
        for (long m = 0; m < members; ++m)
            for (long n = 0; n < steps; ++n) {{
                double t = n * {h};
                arg[0] = &t; arg[1] = lanes + m * {lanes.numel()}; arg[2] = y + m * {found.start.numel()};
                res[0] = y + m * {found.start.numel()};
                step(arg, res, iw, w, 0);
            }}
    }}
    """
    path = folder / f"scalar{host().extension}"
    path.write_bytes(compile_library({"step.c": (generator.dump() + loop).encode()}, host()))
    integrate = ctypes.CDLL(str(path)).integrate
    pointer, long = ctypes.POINTER(ctypes.c_double), ctypes.c_long
    integrate.argtypes = [long, long, pointer, pointer]
    constants, states = (np.ascontiguousarray(rows.T) for rows in _start(found, values))

    def run() -> None:
        integrate(MEMBERS, steps, *(array.ctypes.data_as(pointer) for array in (constants, states)))

    return run


if __name__ == "__main__":
    command(measure)
