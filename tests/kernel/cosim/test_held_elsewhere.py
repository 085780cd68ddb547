"""Closed loops of ``hold`` in other masters: mechanism, regulators and observer, at steps that divide the period.

Between samples σ moves, and the mechanism reconstructs it from what is handed on at communication points: at rest it
extrapolates σ, σ̇ and σ̈; along a plan quintics interpolate them, where a master lets regulators step first.  So numbers
are those of our own run with the same communication step and order.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from masters import MASTERS, SWEEPS, elsewhere, in_order, jacobi

from liaisons import Controller, Result, System, hold, plan

T, SAMPLES = 0.02, 25
PARTS = (1, 2, 5)
SIGNALS = ("Pendulum.theta", "Pendulum_pivot_x.y", "Pendulum_pivot_x.y_dot", "Pendulum_pivot_x.y_ddot")
UPRIGHT: Any = {"at": {"theta": np.pi, "pivot_x": 0.0}, "moves": "pivot_x", "step_size": T}
MEASURED: Any = {"measured": "theta", "noise": {"theta": 0.01}, "disturbance": {"theta_force": 0.1}}
BEFORE = 4e-6 * T  # clocks may miss a sample by a millionth of a period
AHEAD = {"Pendulum_pivot_x": "Pendulum"}


@cache
def controller(motion: str) -> Controller:
    """A pendulum at rest upside down or along a plan, held with all states or, ``"_measured"``, with an observer."""
    options = MEASURED if motion.endswith("_measured") else {}
    if motion == "force":
        return hold("Pendulum", {"theta": np.pi}, controls="theta_force", step_size=T)
    if motion.startswith("rest"):
        return hold("Pendulum", **UPRIGHT, **options)
    end = {"theta": 0, "theta_dot": 0, "pivot_x": 0.5, "pivot_x_dot": 0}
    goal: Any = {"start": {"theta": 0, "pivot_x": 0}, "end": end, "duration": 2 * SAMPLES * T}
    return hold(plan("Pendulum", "pivot_x", minimize="pivot_x_ddot**2", **goal), step_size=T, **options)


def pushed(motion: str) -> System:
    """The loop, off its motion at first."""
    return controller(motion).system(theta_0=np.pi + 0.1 if motion.startswith(("rest", "force")) else 0.1)


def own_run(motion: str, parts: int) -> Result:
    coupling = "jacobi" if motion.startswith(("rest", "force")) else "gauss-seidel"
    return pushed(motion).simulate(SAMPLES * T, T / parts, coupling=coupling, tolerance=1e-11)


def differences(values: dict[str, float], run: Result) -> list[float]:
    """By how much values differ from those at the end of a run, whose corrections are not small."""
    assert all(abs(run[name][-1]) > 1e-3 for name in SIGNALS)
    return [abs(values[name] - run[name][-1]) for name in SIGNALS]


def slow(cases: list[tuple[Any, ...]], *quick: tuple[Any, ...]) -> list[Any]:
    return [pytest.param(*case, marks=[] if case in quick else pytest.mark.slow) for case in cases]


@pytest.mark.parametrize(
    ("master", "parts"), slow([(m, n) for m in ("libcosimpy", "ecospy") for n in PARTS], ("libcosimpy", 2))
)
def test_a_loop_at_rest_is_our_own(master: str, parts: int, tmp_path: Path) -> None:
    values = elsewhere(master, pushed("rest"), tmp_path, size=T / parts, steps=SAMPLES * parts)
    assert max(differences(values, own_run("rest", parts))) < 1e-9


@pytest.mark.parametrize(
    ("master", "parts"),
    slow([(m, n) for m in ("libcosimpy", "ecospy", "fmpy") for n in PARTS], ("libcosimpy", 2), ("fmpy", 1)),
)
def test_a_force_is_our_own(master: str, parts: int, tmp_path: Path) -> None:
    """It is constant from sample to sample, so that nothing depends on the parts of a period."""
    run = own_run("force", 1)
    signals = ("Pendulum.theta", "Pendulum.p_theta")
    if master == "fmpy":
        values = in_order(pushed("force"), tmp_path, np.arange(SAMPLES * parts + 1) * T / parts)
    else:
        values = elsewhere(master, pushed("force"), tmp_path, size=T / parts, steps=SAMPLES * parts)
    assert max(abs(values[name] - run[name][-1]) for name in signals) < 1e-9
    assert all(abs(run[name][-1]) > 1e-3 for name in signals)


@pytest.mark.parametrize(
    ("motion", "parts"),
    slow(
        [(m, n) for m in ("rest", "rest_measured", "plan", "plan_measured") for n in PARTS],
        ("rest_measured", 1),
        ("plan_measured", 5),
    ),
)
def test_a_loop_in_fmpy_is_our_own(motion: str, parts: int, tmp_path: Path) -> None:
    """Called in the order of the dependencies: estimates are read after what is measured.

    Where an observer announces samples, our runs have a communication point close before each of them, too.
    """
    times: Any = np.arange(SAMPLES * parts + 1) * (T / parts)
    if motion == "rest_measured":
        times = np.sort(np.append(times, times[parts::parts] - BEFORE))
    values = in_order(pushed(motion), tmp_path, times, None if motion.startswith("rest") else AHEAD)
    assert max(differences(values, own_run(motion, parts))) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["rest", "rest_measured", "plan", "plan_measured"])
@pytest.mark.parametrize("parts", PARTS)
@pytest.mark.parametrize("master", MASTERS)
def test_a_loop_whose_parts_step_at_once_is_that_of_its_calls(
    master: str, parts: int, motion: str, tmp_path: Path
) -> None:
    """Outputs are all read before inputs are set, so that estimates arrive after the sample that they are for."""
    system, steps = pushed(motion), SAMPLES * parts
    sweeps, first = SWEEPS[master](len(system.parts)), 0.0 if master == "fmpy" else None
    calls = jacobi(system, tmp_path, size=T / parts, steps=steps, sweeps=sweeps, first=first)
    values = elsewhere(master, system, tmp_path, size=T / parts, steps=steps)
    for name in SIGNALS:
        assert values[name] == pytest.approx(calls[name], rel=0, abs=1e-9)


@pytest.mark.slow
def test_along_a_plan_what_is_extrapolated_is_of_second_order(tmp_path: Path) -> None:
    own = controller("plan").simulate(SAMPLES * T, theta_0=0.1)
    errors = [
        elsewhere("libcosimpy", pushed("plan"), tmp_path, size=T / parts, steps=SAMPLES * parts)["Pendulum_pivot_x.y"]
        - own["Pendulum_pivot_x.y"][-1]
        for parts in (1, 2, 5, 10)
    ]
    sizes = np.abs(errors)
    assert np.log(sizes[:-1] / sizes[1:]) / np.log([2, 2.5, 2]) == pytest.approx(2, abs=0.15)
    assert sizes[0] < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("parts", PARTS)
def test_a_loop_that_is_measured_stands_where_estimates_are_late(parts: int, tmp_path: Path) -> None:
    """By one sample: what is measured is upright after 10 s, all the same."""
    values = elsewhere("libcosimpy", pushed("rest_measured"), tmp_path, size=T / parts, steps=500 * parts)
    assert [values[name] for name in SIGNALS] == pytest.approx([np.pi, 0, 0, 0], abs=1e-3)
