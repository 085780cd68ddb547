"""Jumps of what is prescribed, and contradictions between σ, σ̇ and σ̈.

A jump of σ̇ is an impulse: momenta stay, and the work of the operator is what the energy has gained.  A jump of σ itself
is the limit of an ever faster straight motion, where that has one: for the swing p_θ stays and Δθ = -∫ (J/I) ds.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

sys.path.insert(0, str(Path(__file__).parents[1] / "fmu"))  # the importers on ctypes

from driver import OK, Library
from driver3 import Library3

from liaisons.fmu import build
from liaisons.mechanics import Component
from liaisons.models import Swing

HOLD, EXTRAPOLATE, INTERPOLATE = range(3)
JUMPS, MIXES = 1, 2
SWING = {"theta_0": 0.3, "gravity": 0.0}
ROPE, LEAN = 2.0, np.pi / 2  # start values of the swing


@pytest.fixture(scope="session")
def library(fmu) -> Callable[[type[Component]], Library]:
    return cache(lambda component: Library(fmu(component)))


@pytest.fixture(scope="session")
def swing3(shared_folder: Path) -> Library3:
    return Library3(build(Swing.model(), shared_folder, backend="native", fmi="3"))


def swing_forms(rope: float, lean: float) -> tuple[float, float, float]:
    """I, J_rope and J_lean of M eq. 55 with the default parameters, by hand."""
    m_1, m_2, b = 20.0, 20.0, 0.5
    inertia = m_1 * rope**2 + m_2 * (rope**2 + b**2 + 2 * rope * b * np.cos(lean))
    return inertia, -m_2 * b * np.sin(lean), m_2 * (b**2 + rope * b * np.cos(lean))


def swing_lift(rope: float, lean: float) -> float:
    """Δθ = -∫ (J/I) ds along the straight line from the start values to these."""

    def rate(part: float) -> float:
        inertia, along, about = swing_forms(ROPE + part * (rope - ROPE), LEAN + part * (lean - LEAN))
        return -(along * (rope - ROPE) + about * (lean - LEAN)) / inertia

    return quad(rate, 0, 1, epsabs=1e-13, epsrel=1e-13)[0]


# ---- jumps of σ --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [HOLD, EXTRAPOLATE, INTERPOLATE])
@pytest.mark.parametrize(("rope", "lean"), [(2.0, 0.2), (1.6, LEAN), (1.7, -0.4)])
def test_a_jump_of_the_posture_lifts_the_swing(library, mode: int, rope: float, lean: float) -> None:
    instance = library(Swing).start(input_reconstruction=mode, tolerance=1e-10, **SWING)
    assert instance.step(0.0, 0.1) == OK
    assert instance.set(rope=rope, lean=lean) == OK
    assert instance.step(0.1, 1e-9) == OK
    # In interpolation the motion of 1e-9 s itself; the energy of that is 1e19 J, and its balance means nothing.
    assert instance["theta"] == pytest.approx(0.3 + swing_lift(rope, lean), abs=1e-8)
    if mode != INTERPOLATE:
        assert abs(instance["p_theta"]) + abs(instance["work"]) + abs(instance["energy_balance"]) <= 1e-9


def test_a_jump_while_the_swing_moves_does_the_work_of_the_operator(library) -> None:
    """p_θ stays: with gravity and in motion the energy after the jump is that of the lifted posture."""
    instance = library(Swing).start(tolerance=1e-11, theta_0=0.4, theta_dot_0=0.7)
    assert instance.step(0.0, 0.3) == OK
    theta, momentum, energy, work = instance.get("theta", "p_theta", "energy", "work")
    assert instance.set(lean=0.2) == OK
    assert instance.step(0.3, 1e-9) == OK
    lifted = theta + swing_lift(ROPE, 0.2)
    x, z = (20 * f(lifted) * ROPE + 20 * (ROPE * f(lifted) + 0.5 * f(lifted + 0.2)) for f in (np.sin, np.cos))
    assert np.hypot(x, z) > 0
    expected = momentum**2 / (2 * swing_forms(ROPE, 0.2)[0]) - 9.81 * z
    assert instance["theta"] == pytest.approx(lifted, abs=1e-8)  # 1e-9 s go by at 1 rad/s
    assert instance["p_theta"] == pytest.approx(momentum, abs=1e-6)  # and at 400 N.m
    assert instance["energy"] == pytest.approx(expected, abs=1e-5)
    assert instance["work"] - work == pytest.approx(expected - energy, abs=1e-5)
    assert abs(instance["energy_balance"]) <= 1e-7


@pytest.mark.parametrize("mode", [HOLD, EXTRAPOLATE])
def test_many_small_jumps_are_the_motion(library, mode: int) -> None:
    """Without rates the posture goes in steps; each one lifts the swing, and together they are a fast motion."""
    errors = []
    for steps in (50, 100, 200):
        instance = library(Swing).start(input_reconstruction=mode, tolerance=1e-10, **SWING)
        for i in range(steps):
            assert instance.set(lean=LEAN + (0.2 - LEAN) * (i + 1) / steps) == OK
            assert instance.step(i / steps, 1 / steps) == OK
        errors.append(abs(instance["theta"] - 0.3 - swing_lift(ROPE, 0.2)))
    assert max(errors) <= 1e-8  # p = 0: nothing but the lift moves it


@pytest.mark.parametrize("mode", [HOLD, EXTRAPOLATE])
def test_what_the_rate_has_moved_does_not_jump_again(library, mode: int) -> None:
    """With its rate the posture moves the swing inside the step; only what is left jumps at the end of it."""

    def at(t: float) -> dict[str, float]:
        lean, phase = 0.4 * np.sin(2 * t), 2 * t
        return {"lean": LEAN + lean, "lean_dot": 0.8 * np.cos(phase), "lean_ddot": -1.6 * np.sin(phase)}

    errors = []
    for steps in (20, 40, 80):
        instance = library(Swing).start(input_reconstruction=mode, tolerance=1e-11, **SWING, **at(0.0))
        for i in range(steps):
            assert instance.set(at(i / steps)) == OK
            assert instance.step(i / steps, 1 / steps) == OK
        assert instance.set(at(1.0)) == OK
        assert instance.step(1.0, 1e-9) == OK
        # At the start the swing moves with the posture, so that p_θ ≠ 0 lets θ go on.
        errors.append(abs(instance["theta"] - swing_reference(at)))
    order = np.log2(errors[0] / errors[-1]) / 2
    assert order >= 0.8 if mode == HOLD else order >= 2.8


@cache
def swing_reference(at: Callable[[float], dict[str, float]]) -> float:
    """θ(1) where p_θ is kept: θ' = (p_θ - J ψ')/I, p_θ = J(0) ψ'(0) for a start at rest."""
    _, _, about = swing_forms(ROPE, at(0.0)["lean"])
    momentum = about * at(0.0)["lean_dot"]

    def rate(t: float, _: Any) -> list[float]:
        inertia, _, about = swing_forms(ROPE, at(t)["lean"])
        return [(momentum - about * at(t)["lean_dot"]) / inertia]

    return float(solve_ivp(rate, (0, 1), [0.3], method="DOP853", rtol=1e-12, atol=1e-12).y[0, -1])
