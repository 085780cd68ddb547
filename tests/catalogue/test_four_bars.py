"""Parallelograms that pass through singular configurations, where the constraints lose rank."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from on_paper import State, equations_of

from liaisons import ensemble, operator, simulate
from liaisons.models import FourBar, SmoothStep, four_bars

TWO = four_bars(2)
WEIGHT, INERTIA = 9.81 * 3.5, 3.0  # G and J of two windows


def parallel(theta: float, **body: float) -> State:
    angles = {f"theta_{i}": theta for i in range(3)} | {f"theta_{i}_dot": -5.0 for i in range(3)}
    return State(TWO, angles | body)


@pytest.mark.parametrize("theta", [1.2, -0.3, 0.01, np.pi - 1e-3])
def test_rods_turn_as_one_near_singular_configurations(theta: float) -> None:
    """J θ'' = -G cos θ."""
    found = parallel(theta)("accelerations")
    sine = abs(np.sin(theta))
    # The constraints divide their rounding, 1e-15 times squares of rates of 25, by sin θ; of what they demand,
    # accelerations of order 10, the share (S/σ²)² is lost, S = 1e-9 at most and σ = sin θ.
    bound = 1e-13 / sine + 10 * (1e-9 / sine**2) ** 2
    np.testing.assert_allclose(found, -WEIGHT / INERTIA * np.cos(theta), rtol=0, atol=bound)


@pytest.mark.parametrize("theta", [0.0, np.pi])
def test_in_line_the_rods_are_free_and_every_number_is_finite(theta: float) -> None:
    """All gradients of the constraints vanish: A θ'' = -weights, half of each lying rod at either end of it."""
    found, A = (parallel(theta)(quantity) for quantity in ("accelerations", "mass_matrix"))
    weights = 9.81 * np.array([1.0, 1.5, 1.0]) * np.cos(theta)
    # sin π is 1e-16, its square 1e-22 far below what is regarded as lost: the forces of the rods are below 1e-6.
    np.testing.assert_allclose(A @ found, -weights, rtol=0, atol=1e-6)


@pytest.mark.parametrize("theta", [1.0, 0.1, -0.01])
def test_force_of_a_rod_has_a_pole(theta: float) -> None:
    """The multiplier of the derived equations for any mass and length."""
    body = {"mass": 1.3, "length": 0.8, "gravity": 9.0}
    force = parallel(theta, **body)(equations_of(TWO).multipliers)
    # Rounding over sin² θ, 1e-15 · 25 · 1e4, and what is lost, (1e-9 / 1e-4)².
    assert force[0] == pytest.approx(float(TWO.pull(theta, **body)) / np.sin(theta), rel=1e-9)


def test_closed_form_obeys_the_equation_of_one_pendulum() -> None:
    t, h = np.linspace(0.0, 3.0, 301), 1e-4
    before, here, after = (TWO.exact(t + shift) for shift in (-h, 0.0, h))
    rate = (after["theta"] - before["theta"]) / (2 * h)
    acceleration = (after["theta_dot"] - before["theta_dot"]) / (2 * h)
    # Central differences: h²/6 = 2e-9 times third derivatives of at most 200 and 2000.
    np.testing.assert_allclose(rate, here["theta_dot"], rtol=0, atol=1e-6)
    np.testing.assert_allclose(acceleration, -WEIGHT / INERTIA * np.cos(here["theta"]), rtol=0, atol=1e-5)
    assert here["theta"][0] == pytest.approx(np.pi / 2)
    assert here["theta_dot"][0] == pytest.approx(-1.0)


# ---- a parallelogram that is driven through flat ---------------------------------------------------------------------

CRANK, RATE, ACCELERATION = 0.5, 2.0, 0.7
MOMENT = (
    0.02 + 0.25**2 + 2 * CRANK**2 + 0.2 + 1.5 * 0.6**2
)  # of crank and rocker, and of the coupler, which does not turn
WEIGHTS = 9.81 * (0.25 + 2 * CRANK + 1.5 * 0.6)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
@pytest.mark.parametrize("after", [0.0, 1e-8, -1e-6, 1e-5, -1e-4, 1e-3, 0.02])
def test_torque_of_a_driven_parallelogram_has_its_limit_at_flat(fmu, after: float, tolerance: float) -> None:
    """M = J φ'' + G cos φ, at communication points so many seconds after flat; the account closes."""
    flat = 0.25 - after

    def turn(t: float) -> tuple[float, float, float]:
        s = t - flat
        return RATE * s + ACCELERATION / 2 * s**2, RATE + ACCELERATION * s, ACCELERATION

    angle, rate, _ = turn(0.0)
    start = {"elbow_0": -angle, "swing_0": angle, "elbow_dot_0": -rate, "swing_dot_0": rate}
    lengths: dict[str, Any] = {"pin_at_x": 1.5, "pin_at_child_x": CRANK}
    run = simulate(
        fmu(FourBar),
        stop_time=0.5,
        step_size=0.05,
        tolerance=tolerance,
        inputs={"turn": turn},
        start_values=lengths | start,
    )
    phi = np.array([turn(t)[0] for t in run.time])
    expected = MOMENT * ACCELERATION + WEIGHTS * np.cos(phi)
    # Constraints are regularised by 1e-10 where they are independent by 1e-5 at least: (1e-5)² of 22 N m, in each of
    # some terms; position and rate are kept to rounding, which is divided by the angle to flat, 2e-3 beside the limit.
    np.testing.assert_allclose(run["turn_force"], expected, rtol=0, atol=2e-6)
    np.testing.assert_allclose(run["elbow_ddot"], -ACCELERATION, rtol=0, atol=2e-6)
    np.testing.assert_allclose(run["elbow"], -phi, rtol=0, atol=1e-9)  # on its branch
    np.testing.assert_allclose(run["energy_balance"], 0, rtol=0, atol=10 * tolerance + 5e-7)
    names_it = any("is infinite near t = 0.25" in text for text in run.warnings)
    assert names_it == (abs(after) <= 1e-4)  # the force along the bars


@pytest.mark.parametrize(
    "settings", [{}, {"stiff_solver": 1}, {"symplectic_steps": 8}], ids=["dop853", "radau", "gauss"]
)
@pytest.mark.parametrize("step_size", [0.02, 0.1])
def test_a_parallelogram_that_comes_to_rest_just_behind_flat_keeps_its_branch(
    fmu, settings: dict[str, int], step_size: float
) -> None:
    """There is little room behind flat for limits from both sides."""
    begin, end = -1.406, -np.pi - 1.1e-3
    lengths: dict[str, Any] = {"elbow_at_x": 0.4, "pin_at_child_x": 0.4, "swing_at_x": 1.8, "pin_at_x": 1.8}
    moved = operator("SmoothStep", start_values={"start_value": begin, "end_value": end, "duration": 2.0})
    starts = {**lengths, "elbow_0": -begin, "swing_0": begin, "turn": moved}
    run = simulate(fmu(FourBar), stop_time=2.0, step_size=step_size, tolerance=1e-8, start_values=starts | settings)
    expected = SmoothStep.exact(run.time, start_value=begin, end_value=end, duration=2.0)["y"]
    np.testing.assert_allclose(run["swing"], expected, rtol=0, atol=1e-9)
    assert not any("account" in text for text in run.warnings)


@pytest.mark.parametrize("step_size", [0.005, 0.02])
def test_an_ensemble_of_parallelograms_goes_through_flat_by_the_steps_of_its_fmu(step_size: float) -> None:
    begin, end = np.append(np.linspace(0.3, 1.3, 12), 1.3), np.append(np.linspace(-0.4, -1.4, 12), 0.9)  # not the last
    lengths = {"elbow_at_x": 0.5, "pin_at_child_x": 0.5, "swing_at_x": 1.5, "pin_at_x": 1.5}
    moved = {"turn.start_value": begin, "turn.end_value": end, "turn.duration": 2.0}
    values = {"elbow_0": -begin, "swing_0": begin, **lengths, **moved}
    run = ensemble(FourBar, values, operators={"turn": "SmoothStep"}, stop_time=2, step_size=step_size,
                   samples=20, record=["swing", "elbow", "turn_force"])  # fmt: skip
    assert not run.failures
    np.testing.assert_allclose(run["swing"][-1], end, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run["elbow"], -run["swing"], rtol=0, atol=1e-9)
    errors = run.error("swing")
    assert errors[-1] < 1e-9
    assert np.all(errors < 1e-6)  # a tolerance of 1e-8, but never none


def test_forces_of_rods_that_pass_flat_by_themselves_are_those_beside_it(fmu) -> None:
    """With communication points anywhere the motion goes on as one pendulum."""
    run = simulate(fmu(TWO), stop_time=3.0, step_size=0.013, tolerance=1e-8)
    np.testing.assert_allclose(run["theta_2"], TWO.exact(run.time)["theta"], rtol=0, atol=1e-6)
