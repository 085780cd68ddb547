"""Ensembles beside the scalar step that CasADi generates, interleaved, medians.

    python benchmarks/ensembles.py [--rounds 9] [--steps 500]

Each row: one RK4 step of one member on one core, by CasADi's C (compiled as for an FMU, in a C loop over the members)
and by :mod:`liaisons.ensembles`, in processor time; then the same ensemble on all cores beside one, by the clock on the
wall (so the machine has to be idle).  Both have the same right-hand side, the same constants folded into it, and the
same states.  Ratios are taken round by round.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import platform
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import casadi as ca
import numpy as np

from liaisons.ensembles.equations import Equations, Settable, default_record, equations
from liaisons.ensembles.kernel import LANES, kernel
from liaisons.ensembles.methods import METHODS
from liaisons.fmu.compiler import compile_library, host
from liaisons.mechanics import Component
from liaisons.models import CircularHoop, EllipticHoop, Pendulum, Ramp, Sinusoid

MEMBERS = 64 * LANES
STEP = 0.001
CASES: dict[str, tuple[type[Component], dict[str, type[Component]], dict[str, float]]] = {
    "pendulum": (Pendulum, {}, {"theta_0": 0.1}),
    "pendulum, length moved": (Pendulum, {"length": Sinusoid}, {"length.amplitude": 0.1, "length.offset": 1.0}),
    "circular hoop": (CircularHoop, {"beta": Ramp}, {"beta.rate": 1.0}),
    "elliptic hoop": (EllipticHoop, {"beta": Ramp}, {"beta.rate": 1.0}),
}

Timed = Callable[[], None]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=9)
    options.add_argument("--steps", type=int, default=500)
    arguments = options.parse_args()
    print(f"{_processor()}; {os.cpu_count()} cores, {LANES} lanes a block")
    for title, (component, operators, values) in CASES.items():
        settable = Settable(component, operators)
        found = equations(settable, values, [], default_record(settable.model))
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            scalar = _scalar(found, values, arguments.steps, Path(folder))
            one, all_cores = (
                _ensemble(found, values, arguments.steps, threads) for threads in (1, os.cpu_count() or 1)
            )
            _report(title, [scalar, one, all_cores], arguments.rounds, arguments.steps * MEMBERS)


def _report(title: str, runs: list[Timed], rounds: int, count: int) -> None:
    for run in runs:
        run()  # warm up
    times: list[list[tuple[float, float]]] = []
    for _ in range(rounds):
        times.append([])
        for run in runs:
            begin, begin_processor = time.perf_counter(), time.process_time()
            run()
            times[-1].append((time.perf_counter() - begin, time.process_time() - begin_processor))
    scalar, one = (statistics.median(r[k][1] for r in times) / count * 1e9 for k in (0, 1))
    gains = [scalar_times[1] / one_times[1] for scalar_times, one_times, _ in times]
    threads = statistics.median(one_times[0] / every_times[0] for _, one_times, every_times in times)
    print(
        f"{title:24s} {scalar:6.1f} ns / {one:5.2f} ns = {statistics.median(gains):5.1f}"
        f" (rounds {min(gains):.1f} .. {max(gains):.1f})   all cores: {threads:4.2f} times as fast as one"
    )


def _start(found: Equations, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Constants and states, (rows, MEMBERS), somewhat different for each member."""
    random = np.random.default_rng(0)
    constants = np.array([[value] * MEMBERS for value in values.values()])
    return constants, random.uniform(-1.0, 1.0, (found.y.numel(), MEMBERS))


def _ensemble(found: Equations, values: Mapping[str, float], steps: int, threads: int) -> Timed:
    advance = kernel(found, "rk4", np.zeros(0), native=True).advance
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


def _scalar(found: Equations, values: Mapping[str, float], steps: int, folder: Path) -> Timed:
    """CasADi's C of one step, called for one member after the other."""
    t, lanes, shared = found.constants
    rates = ca.Function("rates", [t, lanes, found.y], [found.rates])
    tableau, h = METHODS["rk4"], STEP
    f = [rates(t, lanes, found.y)]
    for node, row in zip(tableau.nodes[1:], tableau.matrix[1:], strict=True):
        f.append(rates(t + node * h, lanes, found.y + h * sum(a * g for a, g in zip(row, f, strict=True) if a)))
    end = found.y + h * sum(b * g for b, g in zip(tableau.weights, f, strict=True))
    assert not shared.numel()
    step = ca.Function("step", [t, lanes, found.y], ca.cse([end]))
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
                arg[0] = &t; arg[1] = lanes + m * {lanes.numel()}; arg[2] = y + m * {found.y.numel()};
                res[0] = y + m * {found.y.numel()};
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


def _processor() -> str:
    """Its name, and the widest vectors that it has."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    found = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
    vectors = [name for name in ("avx512f", "avx2", "avx") if name in found.get("flags", "").split()]
    return f"{found.get('model name', platform.machine())}, {vectors[0] if vectors else 'no AVX'}"


if __name__ == "__main__":
    main()
