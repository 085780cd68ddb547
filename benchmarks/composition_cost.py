"""Cost of a communication point: systems beside bare preallocated ctypes calls of the same FMUs, interleaved, medians.

    python benchmarks/composition_cost.py [--rounds 7] [--steps 2000]

First table: what a system costs over the bare calls (set, doStep, get with arguments prepared once, in a plain loop),
explicit coupling, everything recorded.  Ratios are taken round by round, of processor time, which other programs on the
machine disturb least.  Second table: chains of up to 1000 FMUs, microseconds of processor time a step and FMU, and the
slope of log(cost of a step) over log(number of FMUs): 1 is linear.  (The bare calls have no counterpart of implicit
coupling; its cost counts all iterations, roll-backs and derivatives.)
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import Array, byref, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from liaisons import System, fmu_path
from liaisons.cosim.description import Fmu, read
from liaisons.cosim.execution import Execution
from liaisons.cosim.schedule import Coupling

H = 0.001
TRIPLE = ("", "_dot", "_ddot")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=7)
    options.add_argument("--steps", type=int, default=2000)
    options.add_argument("--sizes", type=int, nargs="+", default=[10, 30, 100, 300, 1000])
    arguments = options.parse_args()
    with _timed_loops() as loops, ExitStack() as stack:
        for pairs in (1, 10):
            bare = _bare_pairs(pairs, stack)
            ratios, costs = [], []
            for _ in range(arguments.rounds):
                ours, yardstick = _run(_pairs(pairs), arguments.steps // pairs, "gauss-seidel", loops), 0.0
                yardstick = bare(arguments.steps // pairs)
                ratios.append(ours / yardstick)
                costs.append(ours / (2 * pairs))
            print(
                f"{pairs:3d} x (operator -> pendulum): {statistics.median(costs) * 1e6:6.2f} us a point and FMU = "
                f"{statistics.median(ratios):.2f} x bare calls   (rounds {min(ratios):.2f} .. {max(ratios):.2f})"
            )
        for coupling in ("jacobi", "gauss-seidel", "implicit"):
            costs = [_median_cost(n, coupling, arguments.rounds // 2 + 1, loops) for n in arguments.sizes]
            slope = np.polyfit(np.log(arguments.sizes), np.log(costs), 1)[0]
            each = ", ".join(f"{n}: {c / n * 1e6:.2f}" for n, c in zip(arguments.sizes, costs, strict=True))
            print(f"chain of oscillators, {coupling:12s} us a step and FMU: {each};  slope {slope:.2f}")


@contextmanager
def _timed_loops() -> Iterator[list[float]]:
    """A list that gets the seconds of every loop over communication points, set-up and release left out."""
    seconds: list[float] = []
    original = vars(Execution)["_advance"]

    def timed(self: Execution, *arguments: object) -> None:
        begin = time.thread_time()
        original(self, *arguments)
        seconds.append(time.thread_time() - begin)

    setattr(Execution, "_advance", timed)  # noqa: B010 - looks into the run on purpose
    try:
        yield seconds
    finally:
        setattr(Execution, "_advance", original)  # noqa: B010


def _run(
    system: System, steps: int, coupling: Coupling, loops: list[float], record: Sequence[str] | None = None
) -> float:
    """Seconds a step."""
    system.simulate(steps * H, H, coupling=coupling, record=record)
    return loops.pop() / steps


def _median_cost(count: int, coupling: Coupling, rounds: int, loops: list[float]) -> float:
    steps = max(20, 20000 // count // (10 if coupling == "implicit" else 1))
    return statistics.median(_run(_chain(count), steps, coupling, loops, record=[]) for _ in range(rounds))


def _pairs(count: int) -> System:
    system, motor_fmu, swing_fmu = System("pairs"), fmu_path("Sinusoid"), fmu_path("Pendulum")
    for k in range(count):
        motor = system.add(f"motor_{k}", motor_fmu, offset=1.0, amplitude=0.1)
        swing = system.add(f"swing_{k}", swing_fmu)
        system.connect(motor["y"], swing["length"])
    return system


def _chain(count: int) -> System:
    system, fmu = System("chain"), fmu_path("Oscillator")  # asking for the path checks that the FMU is up to date
    before = system.add("mass_0", fmu, stiffness=0.0, x_0=1.0)
    for k in range(1, count):
        mass = system.add(f"mass_{k}", fmu, x_0=float(np.cos(3 * k)))
        system.connect(before["x"], mass["support"])
        before = mass
    return system


def _bare_pairs(count: int, stack: ExitStack) -> Callable[[int], float]:
    """A function that makes n steps of so many pairs by bare calls, and returns seconds a step."""
    now, size, yes = c_double(), c_double(H), c_int(1)
    calls = []
    for _ in range(count):
        motor, motor_fmu = _slave("Sinusoid", stack, offset=1.0, amplitude=0.1)
        swing, swing_fmu = _slave("Pendulum", stack)
        y, y_values = _variables(motor_fmu, [f"y{dots}" for dots in TRIPLE])
        inputs, _ = _variables(swing_fmu, [f"length{dots}" for dots in TRIPLE])
        outputs, values = _variables(swing_fmu, swing_fmu.reals("output"))
        step, get = motor.dll["fmi2DoStep"], motor.dll["fmi2GetReal"]
        one, other = (c_void_p(_address(slave)) for slave in (motor, swing))
        calls += [
            (step, (one, now, size, yes)),
            (get, (one, y, c_size_t(3), y_values)),
            (swing.dll["fmi2DoStep"], (other, now, size, yes)),
            (swing.dll["fmi2SetReal"], (other, inputs, c_size_t(3), y_values)),
            (swing.dll["fmi2GetReal"], (other, outputs, c_size_t(len(values)), values)),
        ]
    progress = {"i": 0}

    def run(steps: int) -> float:
        first = progress["i"]
        begin = time.thread_time()
        for i in range(first, first + steps):
            now.value = i * H
            for function, arguments in calls:
                if function(*arguments):
                    raise RuntimeError("a call has failed")
        progress["i"] = first + steps
        return (time.thread_time() - begin) / steps

    return run


def _address(slave: FMU2Slave) -> int:
    component: Any = slave.component  # an int, whatever fmpy declares
    return component


def _variables(fmu: Fmu, names: Sequence[str]) -> tuple[object, Array[c_double]]:
    references = (c_uint * len(names))(*(fmu.variables[name].reference for name in names))
    return byref(references), (c_double * len(names))()


def _slave(name: str, stack: ExitStack, **starts: float) -> tuple[FMU2Slave, Fmu]:
    path = fmu_path(name)
    fmu = read(path)
    folder = Path(stack.enter_context(TemporaryDirectory()))
    fmpy.extract(path, folder)
    slave = FMU2Slave(guid=fmu.guid, modelIdentifier=fmu.identifier, unzipDirectory=str(folder), instanceName=name)
    slave.instantiate()
    stack.callback(slave.freeInstance)
    slave.setupExperiment(startTime=0.0)
    slave.setReal([fmu.variables[name].reference for name in starts], list(starts.values()))
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    return slave, fmu


if __name__ == "__main__":
    main()
