"""Cost of a communication point: systems of up to ten thousand FMUs beside bare calls and beside one flattened FMU.

    python benchmarks/composition_cost.py [--quick]

What a communication point costs over the bare calls (set, doStep, get with arguments prepared once, in a plain loop):
pairs of an operator and a pendulum, with everything recorded, and chains of oscillators.  The plain loop is Python; a
system makes the same calls from compiled code, hence ratios below 1.  Implicit coupling counts all iterations,
roll-backs and derivatives; its yardstick is the flattened FMU, the same chain as one FMU, which has nothing to couple.
Processor time a point and FMU, of the same number of points for every size.  Beside it the exponents by which the cost
of a point grows with the number of FMUs, 1 being linear; and what ten thousand FMUs take to be made, connected,
initialized and released, in a process of their own.
"""

from __future__ import annotations

import gc
import multiprocessing
import resource
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from ctypes import Array, byref, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import cache, partial
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import fmpy
import numpy as np
from _measure import Row, command, interleaved
from step_cost import instantiate

from liaisons import System, fmu_path
from liaisons.cosim.running.run import Run
from liaisons.cosim.structure.schedule import Coupling
from liaisons.cosim.structure.simulation import checked_simulation
from liaisons.fmu_files import Fmu, read

H = 0.001
TRIPLE = ("", "_dot", "_ddot")
COUPLINGS: tuple[Coupling, ...] = ("jacobi", "gauss-seidel", "implicit")
BARE, FLAT = "bare calls", "flattened"
POINT = "A communication point, for each FMU"
ASKED, LINEAR, IMPLICIT = "<= 1.5", "<= 1.1", "<= 4"
SIZES, QUICK = (10, 30, 100, 300, 1000, 3000, 10_000), (10, 30, 100)
LARGEST_BARE, LARGEST_FLAT = 1000, 30
"""Beyond them nothing is to be learnt: bare calls are linear, and a C compiler takes minutes for a larger chain."""

Times = Mapping[str, Sequence[float]]
"""Seconds a communication point, round by round, of couplings and of what stands beside them."""
Seconds = Callable[[], float]


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, steps = 5 if quick else 7, 100  # as many steps, quick or not: a run has costs of its own
    rows: list[Row] = []
    for pairs in (1, 10):
        with ExitStack() as stack:
            bare = _bare_pairs(pairs, stack)
            runs = {BARE: partial(bare, steps), "gauss-seidel": _loop(_pairs(pairs), steps, "gauss-seidel", stack)}
            rows += _points("pairs", 2 * pairs, interleaved(runs, rounds))
    chains = {size: _times_of_chain(size, steps, rounds) for size in (QUICK if quick else SIZES)}
    for size, times in chains.items():
        rows += _points("chain", size, times)
    return rows + _growth(chains) + [row for c in ("gauss-seidel", "implicit") for row in _making(max(chains), c)]


def _times_of_chain(size: int, steps: int, rounds: int) -> Times:
    with ExitStack() as stack:
        system = _chain(size)
        runs = {c: _loop(system, steps, c, stack, record=[]) for c in COUPLINGS}
        if size <= LARGEST_BARE:
            bare = _bare_chain(size, stack)
            runs[BARE] = partial(bare, steps)
        if size <= LARGEST_FLAT:
            whole = System("whole")
            whole.add("chain", system.flatten(Path(mkdtemp(prefix="liaisons-"))))
            runs[FLAT] = _loop(whole, steps, "gauss-seidel", stack, record=[])
        return interleaved(runs, rounds)


def _loop(
    system: System, steps: int, coupling: Coupling, stack: ExitStack, record: Sequence[str] | None = None
) -> Seconds:
    """A function that runs a system from its start, and returns seconds a step: of the loop alone."""
    simulation = checked_simulation(system.document, steps * H, H, coupling=coupling, record=record)
    run = stack.enter_context(Run(simulation, again=True))

    def seconds() -> float:
        run.start()
        begin = time.thread_time()
        run.finish()
        return (time.thread_time() - begin) / steps

    return seconds


def _points(system: str, fmus: int, times: Times) -> list[Row]:
    costs = {name: [1e6 * t / fmus for t in seconds] for name, seconds in times.items()}
    rows = []
    for name in (*COUPLINGS, FLAT):
        if name in costs:
            yardsticks = {"implicit": FLAT}.get(name, BARE if name in COUPLINGS else "")
            yardstick = yardsticks if yardsticks in costs else ""
            case, beside = f"{system} of {fmus} FMUs, {name}", costs.get(yardstick)
            if name == "implicit":
                rows.append(Row.of(POINT, case, costs[name], "µs", asked=IMPLICIT))
            if name != "implicit" or yardstick:
                asked = ASKED if yardstick == BARE else ""
                rows.append(Row.of(POINT, case, costs[name], "µs", yardstick=yardstick, beside=beside, asked=asked))
    return rows


def _growth(chains: Mapping[int, Times]) -> list[Row]:
    rows = []
    for most in sorted({min(1000, max(chains)), max(chains)}):
        topic = f"Exponent of the growth of a communication point, {min(chains)} to {most} FMUs"
        for name in (*COUPLINGS, BARE):
            costs = {n: statistics.median(times[name]) for n, times in chains.items() if n <= most and name in times}
            if max(costs) == most:
                exponent = float(np.polyfit(np.log(list(costs)), np.log(list(costs.values())), 1)[0])
                asked = LINEAR if name in COUPLINGS else ""
                rows.append(Row(topic, f"chain, {name}", exponent, "", asked=asked))
    return rows


def _making(size: int, coupling: Coupling) -> list[Row]:
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        parts = pool.submit(_made, size, coupling).result()
    topic = f"A chain of {size} FMUs, from nothing to its end"
    return [Row(topic, f"{coupling}, {part}", value, unit) for part, (value, unit) in parts.items()]


def _made(size: int, coupling: Coupling) -> dict[str, tuple[float, str]]:
    """What it takes: seconds, and memory beyond that of the same for a few."""
    steps, marks, taken = 100, [], []

    def go(count: int) -> None:
        marks[:] = [time.process_time()]
        system = _chain(count)
        marks.append(time.process_time())
        with ExitStack() as stack:
            seconds = _loop(system, steps, coupling, stack, record=[])
            gc.collect()  # of what was made; else it may fall into the start, which is a tenth of it
            marks.append(time.process_time())
            moving = seconds() * steps
            marks.append(time.process_time() - moving)
            taken.append(_resident())
        marks.append(time.process_time() - moving)

    for count in (10, size):
        go(count)
    made, prepared, started, released = np.diff(marks).tolist()
    found = {"added and connected": made, "instantiated and prepared": prepared, "initialized": started}
    seconds = {part: (value, "s") for part, value in (found | {"released": released}).items()}
    return seconds | {"memory, an FMU": ((taken[1] - taken[0]) / size / 1024, "KiB")}


def _resident() -> float:
    """Memory that this process has in RAM [B]."""
    return float(int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize())


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
        references = {self.fmu.variables[name].reference: value for name, value in starts.items()}
        self._slave = slave = instantiate(folder, self.fmu.identifier, self.fmu.guid, references)
        stack.callback(slave.freeInstance)
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
def _extracted(name: str) -> tuple[Fmu, Path]:
    path = fmu_path(name)
    return read(path), Path(fmpy.extract(path, mkdtemp(prefix="liaisons-")))


if __name__ == "__main__":
    command(measure)
