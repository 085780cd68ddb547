"""A PID that computes for one period, and its plant, in other masters: the same numbers at any step that divides it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from masters import MASTERS, RefusalError, elsewhere
from scipy.linalg import expm

from liaisons import System

T, SETPOINT, STIFFNESS, START = 0.02, 0.3, 9.0, 0.5
GAIN, INTEGRAL_TIME = 20.0, 1.2
SAMPLES = 25


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
    with pytest.raises(RefusalError, match="each sample has to be a communication point: choose a communication step"):
        elsewhere(master, loop(), tmp_path, size=1.5 * T, steps=SAMPLES)


def test_where_refusals_are_not_heard_the_output_stays(tmp_path: Path) -> None:
    """Ecos goes on without the FMU, whose force is still that of the start: 0."""
    found = elsewhere("ecospy", loop(), tmp_path, size=1.5 * T, steps=2)
    assert found["plant.x"] == pytest.approx(START * np.cos(np.sqrt(STIFFNESS) * 3 * T), rel=1e-8)
