"""Runs step by step with a controller in Python: a step, and a thousand episodes, beside FMPy's loop.

    python benchmarks/stepping.py [--quick]

A pendulum is kept upside down by a torque that a function of Python sets from its angle and rate, fifty times a second.
FMPy's loop is what one writes with it: ``setReal``, ``doStep``, ``getReal`` of an instance of the same FMU, and
``reset`` with new start values before each episode.  A sampled PID and the same function as ``sampled(...)`` stand in
systems, where ``run.step()`` does it all.  All is processor time of the thread.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from _measure import Row, command, interleaved
from fmpy.simulation import instantiate_fmu

from liaisons import System, sampled, start
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Pendulum

STEP, STEPS = 0.02, 250
INPUT, OUTPUTS = "theta_force", ("theta", "theta_dot")
TOPIC = "Episodes of 250 steps, a controller in Python"


def torque(theta: float, theta_dot: float) -> float:
    return -20 * (theta - np.pi) - 5 * theta_dot


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, episodes = (3, 5) if quick else (10, 100)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, ExitStack() as stack:
        path = build(assemble(Pendulum), Path(name), backend="native")
        loops = {
            "FMPy": by_fmpy(path),
            "run.step": by_step(stack.enter_context(start(path, step_size=STEP, record=OUTPUTS))),
            "run.stepper": by_stepper(stack.enter_context(start(path, step_size=STEP, record=OUTPUTS))),
            "sampled(function) in a System": alone(stack.enter_context(with_function(path).start(step_size=STEP))),
            "Pid in a System": alone(stack.enter_context(with_pid(path).start(step_size=STEP))),
        }
        ends = {title: loop(np.pi - 0.3) for title, loop in loops.items() if title != "Pid in a System"}
        assert np.ptp(list(ends.values())) < 1e-9, ends  # they do the same
        runs = {title: lambda loop=loop: microseconds(loop, episodes) for title, loop in loops.items()}
        times = interleaved(runs, rounds)
        changing = implicit(stack)
        steps = interleaved({"changing": lambda: changing(1.0), "constant": lambda: changing(0.0)}, rounds)
    rows = [
        Row.of(TOPIC, title, times[title], "µs a step", yardstick="FMPy's loop", beside=times["FMPy"], better="less")
        for title in loops
        if title != "FMPy"
    ]
    whole = [1000 * STEPS * t / 1e6 for t in times["run.step"]]
    rows.append(Row.of(TOPIC, "1000 episodes by run.step", whole, "s"))
    rows.append(
        Row.of(
            "Two pendulums, coupled implicitly", "an input that changes at each step", steps["changing"], "µs a step",
            yardstick="one that stays", beside=steps["constant"], better="less",
        )
    )  # fmt: skip
    return rows


def by_fmpy(path: Path) -> Callable[[float], float]:
    """An episode from a start angle by FMPy; returns the last angle."""
    description = fmpy.read_model_description(path, validate=False)
    slave: Any = instantiate_fmu(fmpy.extract(path), description, fmi_type="CoSimulation")
    number = {v.name: v.valueReference for v in description.modelVariables}
    put, read, first = [number[INPUT]], [number[name] for name in OUTPUTS], [number["theta_0"]]

    def episode(theta_0: float) -> float:
        slave.reset()
        slave.setupExperiment(startTime=0.0)
        slave.setReal(first, [theta_0])
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        theta, theta_dot = slave.getReal(read)
        for i in range(STEPS):
            slave.setReal(put, [torque(theta, theta_dot)])
            slave.doStep(i * STEP, STEP)
            theta, theta_dot = slave.getReal(read)
        return theta

    return episode


def by_step(run: Any) -> Callable[[float], float]:
    """The same by names."""

    def episode(theta_0: float) -> float:
        run.reset(theta_0=theta_0)
        for _ in range(STEPS):
            run.step(theta_force=torque(run["theta"], run["theta_dot"]))
        return run["theta"]

    return episode


def by_stepper(run: Any) -> Callable[[float], float]:
    """The same by arrays."""
    step = run.stepper([INPUT], OUTPUTS)

    def episode(theta_0: float) -> float:
        run.reset(theta_0=theta_0)
        theta, theta_dot = theta_0, 0.0
        for _ in range(STEPS):
            theta, theta_dot = step([torque(theta, theta_dot)]).tolist()
        return theta

    return episode


def alone(run: Any) -> Callable[[float], float]:
    """The same, where the system has its controller."""

    def episode(theta_0: float) -> float:
        run.reset({"plant.theta_0": theta_0})
        for _ in range(STEPS):
            run.step()
        return run["plant.theta"]

    return episode


def with_function(path: Path) -> System:
    system = System("function")
    system.add("plant", path)
    reads = [f"plant.{name}" for name in OUTPUTS]
    system.add("controller", sampled(torque, period=STEP, reads=reads, writes=[f"plant.{INPUT}"]))
    return system


def with_pid(path: Path) -> System:
    system = System("PID")
    plant = system.add("plant", path)
    gains: Any = {"gain": 20.0, "derivative_time": 0.25, "integral_time": 1e30, "setpoint": np.pi}
    controller = system.add("controller", "Pid", period=STEP, **gains)
    system.connect(plant["theta"], controller["reading"])
    system.connect(controller["output"], plant[INPUT])
    return system


def implicit(stack: ExitStack) -> Callable[[float], float]:
    """Processor time of a step [µs] of two pendulums under a torque of so many N m every other step."""
    system = System("two pendulums")
    upper, lower = system.add("upper", "Pendulum", theta_0=0.4), system.add("lower", "Pendulum", theta_0=-0.2)
    system.connect(upper["bob"], lower["pivot"])
    run = stack.enter_context(system.start(step_size=0.01))
    step = run.stepper(["upper.theta_force"], ["upper.theta", "lower.theta"])

    def microseconds(size: float) -> float:
        run.reset()
        begin = time.thread_time()
        for i in range(STEPS):
            step([size * (i % 2)])
        return (time.thread_time() - begin) / STEPS * 1e6

    return microseconds


def microseconds(episode: Callable[[float], float], count: int) -> float:
    """Processor time of a step [µs], resets included."""
    begin = time.thread_time()
    for i in range(count):
        episode(np.pi - 0.3 + 0.6 * i / count)
    return (time.thread_time() - begin) / (count * STEPS) * 1e6


if __name__ == "__main__":
    command(measure)
