"""Feedback: gains against closed forms, multipliers against those of the FMUs, refusals in one line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from liaisons import hold
from liaisons.operators import PlanError
from liaisons.operators.holding import reachable, riccati

STEP = 0.02
HELD: dict[str, dict[str, Any]] = {
    "Pendulum": {"at": {"theta": np.pi, "pivot_x": 0}, "moves": "pivot_x", "step_size": STEP},
    "CircularHoop": {"at": {"xi": np.pi, "beta_dot": 2.0}, "moves": "beta", "step_size": STEP},
    "Satellite": {
        "at": {"attitude": (1, 0.1, 0.2, -0.3)},
        "moves": ["wheel_1", "wheel_2", "wheel_3"],
        "step_size": 0.5,
    },
}
CONSERVED = {"Pendulum": (), "CircularHoop": (), "Satellite": ("H_x", "H_y", "H_z")}


def test_gains_of_the_oscillator_tend_to_the_closed_form() -> None:
    """x'' = -ω² x + u, least ∫ x² + r u²: k_1 = √(ω⁴ + 1/r) - ω², k_2 = √(2 k_1)."""
    omega, r = 1.5, 0.3
    k_1 = np.sqrt(omega**4 + 1 / r) - omega**2
    errors = []
    for h in (1e-3, 5e-4):
        step: Any = expm(np.array([[0, 1, 0], [-(omega**2), 0, 1], [0, 0, 0]]) * h)
        gains = riccati(step[:2, :2], step[:2, 2:], np.diag([h, 0]), np.array([[r * h]]))
        errors.append(np.max(np.abs(gains - [k_1, np.sqrt(2 * k_1)])))
    assert errors[0] < 2e-3  # of first order in h
    assert errors[1] == pytest.approx(errors[0] / 2, rel=1e-2)


def test_the_staircase_ends_where_control_does() -> None:
    A = np.array([[0.0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]])
    V, U = reachable(A, np.array([[0.0], [1], [0], [0]]))
    assert V.shape == U.shape == (4, 2)
    np.testing.assert_allclose(V[2:], 0, atol=1e-15)
    np.testing.assert_allclose(np.hstack([V, U]) @ np.hstack([V, U]).T, np.eye(4), atol=1e-15)


@pytest.mark.parametrize("name", HELD)
def test_the_fmus_have_the_multipliers_that_were_predicted(name: str) -> None:
    regulator = hold(name, **HELD[name])
    verdicts = regulator.verify()
    assert all(verdict.passed for verdict in verdicts), "\n".join(map(str, verdicts))
    assert regulator.conserved == CONSERVED[name]
    assert regulator.reached == regulator.multipliers.size - len(regulator.conserved)
    np.testing.assert_allclose(regulator.multipliers[: len(regulator.conserved)], 1, atol=1e-9)
    # Solver tolerance 1e-11 over a difference of 1e-5.
    np.testing.assert_allclose(regulator.measured(), regulator.loop, rtol=0, atol=2e-6 * np.abs(regulator.loop).max())


def test_multipliers_of_the_pendulum_lie_on_the_root_locus() -> None:
    """What Σ x'Qx + r w² leaves satisfies r + G(1/μ)' Q G(μ) = 0, G of w → x: Riccati's equation is not needed."""
    regulator = hold("Pendulum", **HELD["Pendulum"])
    assert regulator.states[:3] == ("theta", "p_theta", "pivot_x")
    decay, n = np.exp(-1.0), 5
    B = np.array([0, 0, *(STEP ** np.array([2, 1, 0]) * [0.5 - decay, decay, 1 - decay])])[:, None]
    A = regulator.loop + B @ regulator.gains
    for mu in regulator.controlled:
        out, back = (np.linalg.solve(z * np.eye(n) - A, B)[[0, 2], 0] for z in (mu, 1 / mu))
        assert abs(0.01 + back @ out) < 1e-6 * 0.01 * (1 + np.abs(back) @ np.abs(out) / 0.01)


def test_a_pendulum_comes_back_within_bounds_and_survives_a_push() -> None:
    regulator = hold("Pendulum", **HELD["Pendulum"], bounds={"pivot_x_ddot": (-6, 6)})
    run = regulator.simulate(8.0, theta_0=np.pi + 0.2)
    usual = regulator.system(theta_0=np.pi + 0.2).simulate(8.0, STEP, tolerance=1e-11)
    np.testing.assert_array_equal(usual["Pendulum.theta"], run["Pendulum.theta"])  # whatever the coupling
    assert np.abs(regulator.deviation(run)[:, -1]).max() < 1e-6
    acceleration = run["Pendulum.pivot_x_ddot"]
    assert np.abs(acceleration).max() <= 6 + 1e-9
    assert np.abs(acceleration).max() > 5.5
    free = hold("Pendulum", **HELD["Pendulum"])
    pushed, kept = (r.survives("theta_force", 0.2, stop_time=8.0, first=1.0) for r in (free, regulator))
    assert 1.0 < kept < pushed


def test_wheels_take_the_momentum_that_a_torque_leaves() -> None:
    upright: dict[str, Any] = HELD["Satellite"] | {"at": {"attitude": (1, 0, 0, 0)}}
    regulator = hold("Satellite", **upright)
    run = regulator.simulate(150.0, omega_x_0=0.001)
    off = regulator.deviation(run)[:, -1]
    assert abs(off[4] - 0.01) < 1e-3  # H_x stays
    assert np.abs(off[:4]).max() < 1e-5
    assert off[regulator.states.index("wheel_1_dot")] == pytest.approx(0.01 / 0.1, rel=0.05)


@pytest.mark.parametrize(
    ("name", "changed", "message"),
    [
        ("PlanarCat", {"at": {"psi_1": 0.5}}, "cannot be held there: .* phi .* psi_1"),
        ("Satellite", {"at": {"wheel_1": 0.0}}, "cannot be held there: to first order wheel_1, .* cannot change q_x"),
        ("Pendulum", {"at": {"theta": 1.0}}, "no equilibrium: the rate of p_theta is -8.2"),
        ("Pendulum", {"bounds": {"pivot_x": (-1, 1)}}, "a regulator bounds accelerations, pivot_x_ddot"),
        ("Pendulum", {"bounds": {"pivot_x_ddot": 3}}, r"bounds of pivot_x_ddot = 3: give \(low, high\)"),
        ("Pendulum", {"at": {"theta": np.pi}, "moves": "pivot_z"}, "first order pivot_z cannot change theta"),
        ("CartesianPendulum", {"at": {}, "moves": "rod"}, "has constraints"),
        ("Pendulum", {"weights": {"thetta": 1}}, "weights of 'thetta': the states are theta, p_theta"),
        ("Pendulum", {"step_size": 0.0}, "must be > 0"),
        ("Pendulum", {"at": None}, "hold keeps an equilibrium: give a mechanism and at="),
        ("Pendulum", {"moves": "theta"}, "is no active coordinate"),
    ],
)
def test_what_cannot_be_held_is_refused_in_one_line(name: str, changed: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"step_size": STEP} | HELD.get(name, {}) | changed
    with pytest.raises(PlanError, match=message) as refused:
        hold(name, **arguments)
    assert "\n" not in str(refused.value)
