"""Every coupling against one FMU of the whole system, which solves all equations at once: the oracle of them all."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, coupling_errors, exchange_only, wired

from liaisons import Result, System, flatten, simulate

STOP, H = 0.6, 0.03
Paths = Callable[..., Path]
LINK = "upper.bob -> lower.pivot"
WAVE = {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 3.0}


def two(upper: Path, lower: Path, **options: Any) -> System:
    return wired(LINK, upper=(upper, {"theta_0": 0.4, **options}), lower=(lower, {"theta_0": -0.2, "mass": 0.5}))


def row(path: Paths) -> System:
    """Masses on springs, each of which moves the support of the next."""
    parts = {name: (path("Oscillator"), {"x_0": x}) for name, x in (("first", 0.3), ("second", 0.1), ("third", -0.2))}
    return wired("first.x -> second.support", "second.x -> third.support", **parts)


def moved(path: Paths) -> System:
    """An operator moves the lower of two pendulums along its rod."""
    parts = {"upper": (path("Pendulum"), {"theta_0": 0.4}), "lower": path("fmi3/Pendulum")}
    return wired(LINK, "wave.y -> lower.length", wave=(path("Sinusoid"), WAVE), **parts)


# How the parts depend on each other, and as which FMUs: loops of force and motion, one way, of both versions.
SYSTEMS: dict[str, Callable[[Paths], System]] = {
    "one way": lambda path: wired(
        "wave.y -> swing.length", wave=(path("Sinusoid"), WAVE), swing=(path("Pendulum"), {"theta_0": 0.8})
    ),
    "loop": lambda path: two(path("Pendulum"), path("Pendulum")),
    "loop of FMI 2.0 and 3.0": lambda path: two(path("Pendulum"), path("fmi3/Pendulum")),
    "loop of equations": lambda path: two(path("Pendulum", only=True), path("fmi3/Pendulum", only=True)),
    "loop of equations and a process": lambda path: two(path("Pendulum"), path("Pendulum", only=True), isolated=True),
    "chain of loops": row,
    "loop that is moved": moved,
}
ORDERS = {"default": 4, "implicit": 4, "waveform": 4, "jacobi": 1, "gauss-seidel": 1}
"""Order of the error in the step size, where force and motion go round."""


@pytest.fixture(scope="module")
def path(component: FmuPaths, tmp_path_factory: pytest.TempPathFactory) -> Paths:
    """FMU of a component; with ``only`` for Model Exchange alone."""

    @cache
    def found(name: str, *, only: bool = False) -> Path:
        return exchange_only(component(name), tmp_path_factory.mktemp("only")) if only else component(name)

    return found


@pytest.fixture(scope="module")
def whole(path: Paths, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Result]:
    """The motion of the one FMU of a system."""

    @cache
    def run(name: str) -> Result:
        one = flatten(SYSTEMS[name](path), tmp_path_factory.mktemp("whole"))
        return simulate(one, stop_time=STOP, step_size=H, tolerance=1e-12)

    return run


def distance(result: Result, whole: Result) -> float:
    """Largest difference of coordinates and rates at the points of both."""
    names = [name for name in whole.names if name.rpartition(".")[2] in {"theta", "theta_dot", "x", "x_dot"}]
    every = (len(result.time) - 1) // (len(whole.time) - 1)
    assert len(names) == 2 * len({name.partition(".")[0] for name in names}) > 0
    return max(float(np.max(np.abs(result[name][::every] - whole[name]))) for name in names)


@pytest.mark.parametrize("coupling", ORDERS)
@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.variants(quick=None, core=10)
def test_a_coupled_system_moves_as_one_fmu(
    path: Paths, whole: Callable[[str], Result], caplog: pytest.LogCaptureFixture, name: str, coupling: Any
) -> None:
    """The difference falls by the order of the coupling, and is of the size of the error that the run says."""
    caplog.set_level(logging.ERROR, "liaisons")  # it warns of the errors that are looked at here
    system, order = SYSTEMS[name](path), ORDERS[coupling]
    options: dict[str, Any] = {"tolerance": 1e-12, "coupling": None if coupling == "default" else coupling}
    coarse, fine = (system.simulate(STOP, step, **options) for step in (H / 2, H / 4))
    errors = [distance(run, whole(name)) for run in (coarse, fine)]
    said = coupling_errors(fine).sum()
    assert errors[1] < errors[0] / 2 ** (order - 0.5)
    assert said / 100 < errors[1] < 10 * said  # what a step adds grows or shrinks in those that follow


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.variants(quick=None, core=2)
def test_an_error_that_is_asked_for_is_kept(path: Paths, whole: Callable[[str], Result], name: str) -> None:
    """What all steps add, each no more than is asked for."""
    run, asked = SYSTEMS[name](path).simulate(STOP, H, error_tolerance=1e-7, tolerance=1e-12), 1e-7
    assert len(run.time) > 5
    names = [name for name in run.names if name.rpartition(".")[2] in {"theta", "x"}]
    assert names
    for variable in names:
        assert run[variable][-1] == pytest.approx(whole(name)[variable][-1], rel=0, abs=len(run.time) * asked)
