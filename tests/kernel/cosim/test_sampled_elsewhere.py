"""Sampled FMUs and their plants in other masters: the same numbers at any communication step that divides the period.

The loop of the PID, which computes for one period, is closed.  Regulators and observers are beside plants that they do
not move; their closed loops, in which motions that plants extrapolate depend on the step, are in test_held_elsewhere.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from masters import MASTERS, SWEEPS, RefusalError, elsewhere, jacobi
from scipy.linalg import expm

from liaisons import Controller, Observer, System, hold, observe, plan

T, SETPOINT, STIFFNESS, START = 0.02, 0.3, 9.0, 0.5
GAIN, INTEGRAL_TIME = 20.0, 1.2
SAMPLES = 25
PARTS = (1, 2, 5)
PUSHED: Any = {"theta_0": 0.0, "theta_force": 2.0}
"""The pendulum starts where all readings are 0, which is what FMPy sets before the first step, and is pushed."""
HANGING: Any = {"at": {"theta": 0.0, "pivot_x": 0.0}, "moves": "pivot_x", "step_size": T}
ESTIMATES = [("Pendulum_observer", name) for name in ("theta", "p_theta", "theta_innovation")]
MOTION = [("regulator", name) for name in ("y", "y_dot", "y_ddot")]
REFUSAL = "each sample has to be a communication point: choose a communication step"


def loop() -> System:
    system = System("sampled loop")
    plant = system.add("plant", "Oscillator", mass=1.0, stiffness=STIFFNESS, x_0=START)
    values: Any = {"setpoint": SETPOINT, "gain": GAIN, "integral_time": INTEGRAL_TIME, "derivative_time": 0.0}
    controller = system.add("controller", "Pid", period=T, delay=T, **values)
    system.connect(plant["x"], controller["reading"])
    system.connect(controller["output"], plant["x_force"])
    return system


def by_hand(first: float) -> float:
    """Position after the samples, whose first one reads another value; a force acts one period after its sample."""
    held = expm(np.array([[0.0, 1, 0], [-STIFFNESS, 0, 1], [0, 0, 0]]) * T)
    x, integral, force = np.array([START, 0.0]), 0.0, 0.0
    for i in range(SAMPLES):
        error = SETPOINT - (x[0] if i else first)
        new = GAIN * error + integral
        integral += T / INTEGRAL_TIME * GAIN * error
        x = (held @ [*x, force])[:2]
        force = new
    return float(x[0])


@pytest.mark.parametrize("master", MASTERS)
@pytest.mark.parametrize("parts", [2, *(pytest.param(parts, marks=pytest.mark.slow) for parts in (1, 5))])
def test_each_step_that_divides_the_period_gives_the_same_numbers(master: str, parts: int, tmp_path: Path) -> None:
    """FMPy sets connected inputs to 0 before the first step."""
    found = elsewhere(master, loop(), tmp_path, size=T / parts, steps=SAMPLES * parts)
    assert found["plant.x"] == pytest.approx(by_hand(0.0 if master == "fmpy" else START), abs=1e-9)


@pytest.mark.parametrize("master", ["libcosimpy", "fmpy"])
def test_a_step_across_a_sample_is_refused(master: str, tmp_path: Path) -> None:
    with pytest.raises(RefusalError, match=REFUSAL):
        elsewhere(master, loop(), tmp_path, size=1.5 * T, steps=SAMPLES)


def test_where_refusals_are_not_heard_the_output_stays(tmp_path: Path) -> None:
    """Ecos goes on without the FMU, whose force is still that of the start: 0."""
    found = elsewhere("ecospy", loop(), tmp_path, size=1.5 * T, steps=2)
    assert found["plant.x"] == pytest.approx(START * np.cos(np.sqrt(STIFFNESS) * 3 * T), rel=1e-8)


def regulated(controller: Controller) -> System:
    """A regulator that reads a pendulum, whose pivot rests, and its own motion."""
    held, system = controller.system(), System("regulator")
    regulator = held.parts["Pendulum_pivot_x"]
    starts: Any = regulator.starts
    parts = {
        "Pendulum": system.add("plant", "Pendulum", **PUSHED),
        "Pendulum_pivot_x": system.add("regulator", regulator.fmu.path, **starts),
    }
    for link in held.connections:
        (owner, output), (reader, reading) = link.source.reference, link.target.reference
        if reader == "Pendulum_pivot_x":
            system.connect(parts[owner][output], parts[reader][reading])
    return system


@cache
def regulated_at_rest() -> System:
    return regulated(hold("Pendulum", **HANGING))


@cache
def regulated_along_a_plan() -> System:
    end = {"theta": 0, "theta_dot": 0, "pivot_x": 0.5, "pivot_x_dot": 0}
    goal: Any = {"start": {"theta": 0, "pivot_x": 0}, "end": end, "duration": 2 * SAMPLES * T}
    return regulated(hold(plan("Pendulum", "pivot_x", minimize="pivot_x_ddot**2", **goal), step_size=T))


@cache
def observer() -> Observer:
    return observe("Pendulum", "theta", {"theta": 0.01}, {"theta_force": 0.1}, **HANGING)


def observed() -> System:
    return observer().system(**PUSHED)


def cases(quick: str) -> list[Any]:
    """Masters and parts of the period; all are slow but one."""
    marks = {(quick, 2): ()}
    return [pytest.param(m, n, marks=marks.get((m, n), pytest.mark.slow)) for m in MASTERS for n in PARTS]


@pytest.mark.parametrize(("master", "parts"), cases("libcosimpy"))
def test_a_regulator_moves_as_in_our_own_run(master: str, parts: int, tmp_path: Path) -> None:
    system = regulated_at_rest()
    own = system.simulate(SAMPLES * T, T)
    values = elsewhere(master, system, tmp_path, size=T / parts, steps=SAMPLES * parts)
    for name in map(".".join, MOTION):
        assert abs(own[name][-1]) > 0.01
        assert values[name] == pytest.approx(own[name][-1], rel=0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("parts", PARTS)
@pytest.mark.parametrize("master", MASTERS)
def test_a_regulator_moves_along_a_plan_and_after_it_as_when_called_each_period(
    master: str, parts: int, tmp_path: Path
) -> None:
    """FMPy sets the readings of the regulator's own motion, which starts with an acceleration, to 0 at first, too."""
    system, first = regulated_along_a_plan(), 0.0 if master == "fmpy" else None
    for samples in (SAMPLES, 3 * SAMPLES):
        calls = jacobi(system, tmp_path, size=T, steps=samples, sweeps=SWEEPS[master](2), first=first)
        values = elsewhere(master, system, tmp_path, size=T / parts, steps=samples * parts)
        for name in map(".".join, MOTION):
            assert values[name] == pytest.approx(calls[name], rel=0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("master", ["libcosimpy", "ecospy"])
def test_a_regulator_moves_along_a_plan_as_in_our_own_run(master: str, tmp_path: Path) -> None:
    own = regulated_along_a_plan().simulate(SAMPLES * T, T)
    values = elsewhere(master, regulated_along_a_plan(), tmp_path, size=T, steps=SAMPLES)
    for name in map(".".join, MOTION):
        assert values[name] == pytest.approx(own[name][-1], rel=0, abs=1e-9)


@pytest.mark.parametrize(("master", "parts"), cases("fmpy"))
def test_an_observer_estimates_as_in_our_own_run(master: str, parts: int, tmp_path: Path) -> None:
    """Ecos reads outputs after inputs are set: the sample at the end is in them; libcosim and FMPy read before."""
    own = observed().simulate(SAMPLES * T, T)
    values = elsewhere(master, observed(), tmp_path, size=T / parts, steps=SAMPLES * parts, also=ESTIMATES)
    last = -1 if master == "ecospy" else -2
    for name in map(".".join, ESTIMATES):
        assert abs(own[name][-1] - own[name][-2]) > 1e-3
        assert values[name] == pytest.approx(own[name][last], rel=0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("master", ["libcosimpy", "fmpy"])
@pytest.mark.parametrize("system", [regulated_at_rest, regulated_along_a_plan, observed])
def test_regulators_and_observers_refuse_a_step_across_a_sample(master: str, system: Any, tmp_path: Path) -> None:
    with pytest.raises(RefusalError, match=REFUSAL):
        elsewhere(master, system(), tmp_path, size=1.5 * T, steps=SAMPLES)


@pytest.mark.slow
def test_where_refusals_are_not_heard_a_regulator_rests(tmp_path: Path) -> None:
    values = elsewhere("ecospy", regulated_at_rest(), tmp_path, size=1.5 * T, steps=2)
    assert [values[name] for name in map(".".join, MOTION)] == [0.0, 0.0, 0.0]
    assert values["plant.theta"] > 1e-3


@pytest.mark.slow
def test_where_refusals_are_not_heard_an_observer_stays_at_its_first_sample(tmp_path: Path) -> None:
    """Ecos goes on without the FMU, whose only sample, the first, uses the last reading."""
    values = elsewhere("ecospy", observed(), tmp_path, size=1.5 * T, steps=2, also=ESTIMATES)
    estimates = [values[name] for name in map(".".join, ESTIMATES[:2])]
    assert estimates == pytest.approx(observer().gain[:, 0] * values["Pendulum.theta"], rel=1e-9)
