"""Ensembles beside the scalar step that CasADi generates.

    python benchmarks/ensembles.py [--quick]

One RK4 step of one member on one core, by CasADi's C (compiled as for an FMU, in a C loop over the members) and by
:mod:`liaisons_motion.ensembles`, in processor time.  Both have the same right-hand side, the same constants folded into
it, and the same states.

Then what a user calls, :func:`liaisons.ensemble`, for 200 000 members and 1000 steps, on all cores beside one, by the
clock on the wall: the machine has to be idle.  What it does before and after its steps (derivation, arrays) is part
of it; the compiler is not, since the code lies there from the first call on.  Ratios are taken round by round.
"""

from __future__ import annotations

import ctypes
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np
from _measure import Row, command, interleaved

from liaisons.base.compiler import compile_library, host_target
from liaisons.language import Component
from liaisons.models import CircularHoop, EllipticHoop, Pendulum, Ramp, Sinusoid
from liaisons_motion.ensembles import ensemble
from liaisons_motion.right_hand_sides import LANES, METHODS, RightHandSide, compiled_advance, continuous_model

MEMBERS = 64 * LANES
STEPS = 500  # on one core, quick or not: the ratio of two programs depends on where the motion has come
STEP = 0.001
CASES: dict[str, tuple[type[Component], dict[str, type[Component]], dict[str, float]]] = {
    "pendulum": (Pendulum, {}, {"theta_0": 0.1}),
    "pendulum, length moved": (Pendulum, {"length": Sinusoid}, {"length.amplitude": 0.1, "length.offset": 1.0}),
    "circular hoop": (CircularHoop, {"beta": Ramp}, {"beta.rate": 1.0}),
    "elliptic hoop": (EllipticHoop, {"beta": Ramp}, {"beta.rate": 1.0}),
}
ASKED = {"pendulum": ">= 8", "circular hoop": ">= 3"}
ALL_ASKED = ">= 1.8" if (os.cpu_count() or 1) == 2 else ""
CORES = os.cpu_count() or 1

Timed = Callable[[], None]


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, steps, members = (3, 200, 20_000) if quick else (9, 1000, 200_000)
    rows = [row for title in CASES for row in _measured(title, rounds)]
    return rows + [row for title in CASES for row in _cores(title, rounds, steps, members)]


def _measured(title: str, rounds: int) -> list[Row]:
    component, operators, values = CASES[title]
    moved = continuous_model(component, "a benchmark", "").moved_by(operators)
    found = moved.right_hand_side(lanes=values, shared=[], record=moved.coordinates_and_momenta)
    count = STEPS * MEMBERS
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        runs = {"one": _ensemble(found, values, STEPS), "scalar": _scalar(found, values, STEPS, Path(folder))}
        one, scalar = _rates(runs, count, rounds, time.process_time)
    return [
        Row.of(
            "One core, processor time", title, one, "steps/s",
            yardstick="CasADi's C in a loop", beside=scalar, asked=ASKED.get(title, ""),
        ),
    ]  # fmt: skip


def _cores(title: str, rounds: int, steps: int, members: int) -> list[Row]:
    component, operators, values = CASES[title]
    each = {name: value * np.linspace(0.9, 1.1, members) for name, value in values.items()}

    def run(threads: int) -> None:
        span = {"stop_time": steps * STEP, "step_size": STEP, "method": "rk4", "estimate": False}
        ensemble(component, each, operators=operators, threads=threads, **span)

    runs = {"all": partial(run, CORES), "one": partial(run, 1)}
    every, one = _rates(runs, steps * members, rounds, time.perf_counter)
    topic = f"What a user calls, {members} members and {steps} steps: {CORES} cores, by the clock"
    return [Row.of(topic, title, every, "steps/s", yardstick="one core", beside=one, asked=ALL_ASKED)]


def _rates(runs: Mapping[str, Timed], count: int, rounds: int, clock: Callable[[], float]) -> list[list[float]]:
    """Steps a second of each in each round, so many having been made."""

    def rate(run: Timed) -> float:
        begin = clock()
        run()
        return count / (clock() - begin)

    return [*interleaved({name: partial(rate, run) for name, run in runs.items()}, rounds).values()]


def _start(found: RightHandSide, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Constants and states, (rows, MEMBERS), somewhat different for each member."""
    random = np.random.default_rng(0)
    constants = np.array([[value] * MEMBERS for value in values.values()])
    return constants, random.uniform(-1.0, 1.0, (found.start.numel(), MEMBERS))


def _ensemble(found: RightHandSide, values: Mapping[str, float], steps: int) -> Timed:
    advance = compiled_advance(found, METHODS["rk4"], np.zeros(0))
    constants, states = (
        np.ascontiguousarray(rows.reshape(len(rows), -1, LANES).swapaxes(0, 1)) for rows in _start(found, values)
    )
    return partial(advance, 0.0, STEP, steps, constants, states)


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
    path = folder / f"scalar{host_target().extension}"
    path.write_bytes(compile_library({"step.c": (generator.dump() + loop).encode()}, host_target()))
    integrate = ctypes.CDLL(str(path)).integrate
    pointer, long = ctypes.POINTER(ctypes.c_double), ctypes.c_long
    integrate.argtypes = [long, long, pointer, pointer]
    constants, states = (np.ascontiguousarray(rows.T) for rows in _start(found, values))

    def run() -> None:
        integrate(MEMBERS, steps, *(array.ctypes.data_as(pointer) for array in (constants, states)))

    return run


if __name__ == "__main__":
    command(measure)
