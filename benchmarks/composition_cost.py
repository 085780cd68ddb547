"""Cost of a communication point: systems beside bare preallocated ctypes calls of the same FMUs.

    python benchmarks/composition_cost.py [--quick]

What a communication point costs over the bare calls (set, doStep, get with arguments prepared once, in a plain loop):
pairs of an operator and a pendulum, with everything recorded, and chains of up to 1000 oscillators.  The plain loop is
Python; a system makes the same calls from compiled code where it can, hence ratios below 1.  Processor time a point and
FMU.  For the chains also the exponent by which the cost of a point grows with the number of FMUs, 1 being
linear, of systems and of bare calls: what both have beyond 1 comes from the memory, since a thousand instances do not
fit into the caches, whoever calls them.  (Bare calls have no counterpart of implicit coupling; its cost counts all
iterations, roll-backs and derivatives.)
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import Array, byref, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import fmpy
import numpy as np
from _measure import Row, command, interleaved
from fmpy.fmi2 import FMU2Slave

from liaisons import System, fmu_path
from liaisons.cosim.description import Fmu, read
from liaisons.cosim.run import Run
from liaisons.cosim.schedule import Coupling

H = 0.001
TRIPLE = ("", "_dot", "_ddot")
COUPLINGS: tuple[Coupling, ...] = ("jacobi", "gauss-seidel", "implicit")
BARE = "bare calls"
POINT = "A communication point, for each FMU"
ASKED, LINEAR = "<= 1.5", "<= 1.1"
SIZES, QUICK = (10, 30, 100, 300, 1000), (10, 30, 100)

Times = Mapping[str, Sequence[float]]
"""Seconds a communication point, round by round, of couplings and of bare calls."""


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, steps = (2, 200) if quick else (7, 2000)
    rows: list[Row] = []
    with _timed_loops() as loops, ExitStack() as stack:
        for pairs in (1, 10):
            rows += _points("pairs", 2 * pairs, _times_of_pairs(pairs, steps // pairs, rounds, loops, stack))
        chains = {
            size: _times_of_chain(size, max(20, 10 * steps // size), rounds, loops, stack)
            for size in (QUICK if quick else SIZES)
        }
    for size, times in chains.items():
        rows += _points("chain", size, times)
    return rows + _growth(chains)


def _times_of_pairs(pairs: int, steps: int, rounds: int, loops: list[float], stack: ExitStack) -> Times:
    bare = _bare_pairs(pairs, stack)
    return interleaved(
        {BARE: lambda: bare(steps), "gauss-seidel": lambda: _run(_pairs(pairs), steps, "gauss-seidel", loops)}, rounds
    )


def _times_of_chain(size: int, steps: int, rounds: int, loops: list[float], stack: ExitStack) -> Times:
    bare = _bare_chain(size, stack)

    def coupled(coupling: Coupling) -> float:
        few = max(20, steps // 10) if coupling == "implicit" else steps
        return _run(_chain(size), few, coupling, loops, record=[])

    return interleaved({BARE: lambda: bare(steps), **{c: lambda c=c: coupled(c) for c in COUPLINGS}}, rounds)


def _points(system: str, fmus: int, times: Times) -> list[Row]:
    costs = {name: [1e6 * t / fmus for t in seconds] for name, seconds in times.items()}
    rows = []
    for coupling in COUPLINGS:
        if coupling in costs:
            case, yardstick = f"{system} of {fmus} FMUs, {coupling}", "" if coupling == "implicit" else BARE
            asked = ASKED if yardstick else ""
            beside = costs.get(yardstick)
            rows.append(Row.of(POINT, case, costs[coupling], "µs", yardstick=yardstick, beside=beside, asked=asked))
    return rows


def _growth(chains: Mapping[int, Times]) -> list[Row]:
    def exponent(name: str) -> float:
        costs = [statistics.median(times[name]) for times in chains.values()]
        return float(np.polyfit(np.log(list(chains)), np.log(costs), 1)[0])

    topic = f"Exponent of the growth of a communication point, {min(chains)} to {max(chains)} FMUs"
    systems = [Row(topic, f"chain, {coupling}", exponent(coupling), "", asked=LINEAR) for coupling in COUPLINGS]
    return [*systems, Row(topic, f"chain, {BARE}", exponent(BARE), "")]


@contextmanager
def _timed_loops() -> Iterator[list[float]]:
    """A list that gets the seconds of every loop over communication points, set-up and release left out."""
    seconds: list[float] = []
    original = vars(Run)["_advance"]

    def timed(self: Run, *arguments: object) -> None:
        begin = time.thread_time()
        original(self, *arguments)
        seconds.append(time.thread_time() - begin)

    setattr(Run, "_advance", timed)  # noqa: B010 - looks into the run on purpose
    try:
        yield seconds
    finally:
        setattr(Run, "_advance", original)  # noqa: B010


def _run(
    system: System, steps: int, coupling: Coupling, loops: list[float], record: Sequence[str] | None = None
) -> float:
    """Seconds a step."""
    system.simulate(steps * H, H, coupling=coupling, record=record)
    return loops.pop() / steps


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
    now, size, calls = c_double(), c_double(H), []
    for _ in range(count):
        motor = _Bare("Sinusoid", stack, offset=1.0, amplitude=0.1)
        swing = _Bare("Pendulum", stack)
        y, y_values = motor.variables([f"y{dots}" for dots in TRIPLE])
        inputs, _ = swing.variables([f"length{dots}" for dots in TRIPLE])
        outputs, values = swing.variables(swing.fmu.reals("output"))
        calls += [
            motor.step(now, size),
            motor.call("fmi2GetReal", y, c_size_t(3), y_values),
            swing.step(now, size),
            swing.call("fmi2SetReal", inputs, c_size_t(3), y_values),
            swing.call("fmi2GetReal", outputs, c_size_t(len(values)), values),
        ]
    return _timed(calls, now)


def _bare_chain(count: int, stack: ExitStack) -> Callable[[int], float]:
    """The same of a chain: each takes the motion of the one before, and the force of the one behind.

    Without the sweep by which a system makes accelerations and forces belong to one instant: some calls less.
    """
    now, size = c_double(), c_double(H)
    masses = [_Bare("Oscillator", stack, stiffness=float(k > 0), x_0=float(np.cos(3 * k))) for k in range(count)]
    motions = [mass.variables([f"x{dots}" for dots in TRIPLE]) for mass in masses]
    forces = [mass.variables(["support_force"]) for mass in masses]
    steps = [mass.step(now, size) for mass in masses]
    gets, sets = [], []
    for k, mass in enumerate(masses):
        (motion, values), (force, pull) = motions[k], forces[k]
        gets += [mass.call("fmi2GetReal", motion, c_size_t(3), values)]
        gets += [mass.call("fmi2GetReal", force, c_size_t(1), pull)]
        if k > 0:
            support, _ = mass.variables([f"support{dots}" for dots in TRIPLE])
            sets.append(mass.call("fmi2SetReal", support, c_size_t(3), motions[k - 1][1]))
        if k + 1 < count:
            load, _ = mass.variables(["x_load"])
            sets.append(mass.call("fmi2SetReal", load, c_size_t(1), forces[k + 1][1]))
    return _timed([*steps, *gets, *sets], now)


Bare = tuple[Callable[..., int], tuple[object, ...]]


def _timed(calls: Sequence[Bare], now: c_double) -> Callable[[int], float]:
    """A function that makes all these calls so many times, and returns seconds a time."""
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


class _Bare:
    """An instance in its loop over communication points, called by ctypes."""

    def __init__(self, name: str, stack: ExitStack, **starts: float) -> None:
        self.fmu, folder = _extracted(name)
        self._slave = slave = FMU2Slave(
            guid=self.fmu.guid, modelIdentifier=self.fmu.identifier, unzipDirectory=folder, instanceName=name
        )
        slave.instantiate()
        stack.callback(slave.freeInstance)
        slave.setupExperiment(startTime=0.0)
        slave.setReal([self.fmu.variables[name].reference for name in starts], list(starts.values()))
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        component: Any = slave.component  # an int, whatever fmpy declares
        self._pointer = c_void_p(component)

    def variables(self, names: Sequence[str]) -> tuple[object, Array[c_double]]:
        """Their value references, and a buffer for their values."""
        references = (c_uint * len(names))(*(self.fmu.variables[name].reference for name in names))
        return byref(references), (c_double * len(names))()

    def call(self, function: str, *arguments: object) -> Bare:
        """A call, to be made as ``function(*arguments)``."""
        return self._slave.dll[function], (self._pointer, *arguments)

    def step(self, now: c_double, size: c_double) -> Bare:
        """The call of a step."""
        return self.call("fmi2DoStep", now, size, c_int(1))


@cache
def _extracted(name: str) -> tuple[Fmu, str]:
    path = fmu_path(name)
    return read(path), str(fmpy.extract(path, mkdtemp(prefix="liaisons-")))


if __name__ == "__main__":
    command(measure)
