"""Stationary action and least constraint against closed forms."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons.check import slope
from liaisons.models import CartesianPendulum, Oscillator
from liaisons_motion import analysis

MASS, STIFFNESS = 0.5, 2.0  # ω = 2 rad/s: conjugate points every π/2 s
BODY: dict[str, Any] = {"mass": MASS, "stiffness": STIFFNESS}
OMEGA = 2.0


def sine(t: np.ndarray, n: int) -> dict[str, np.ndarray]:
    """δx = sin(nπt/T)."""
    k = n * np.pi / t[-1]
    return {"x": np.sin(k * t), "x_dot": k * np.cos(k * t)}


def joined(t: np.ndarray) -> np.ndarray:
    """The oscillation from x = 1 to x = 0 in the time t[-1]."""
    return np.cos(OMEGA * t) - np.sin(OMEGA * t) / np.tan(OMEGA * t[-1])


def test_first_variation_off_the_motion() -> None:
    """x = 0 under a constant force has δS = ∫ K x_0 δx dt: the support is moved by 0.3 m."""
    t = np.linspace(0, 1.0, 101)
    still = {"x": 0 * t, "x_dot": 0 * t}
    S = analysis.action(Oscillator, t, still, sine(t, 1), support=0.3, **BODY)
    assert S.first == pytest.approx(STIFFNESS * 0.3 * 2 / np.pi, rel=1e-8)  # interpolated sine: h⁴π⁴/720


def test_paths_between_two_points_are_motions_of_fourth_order() -> None:
    errors, counts = [], np.array([9, 17, 33])
    for count in counts:
        t = np.linspace(0, 2.0, count)
        found = analysis.stationary_path(Oscillator, t, {"x": 1 - t / 2, "x_dot": 0 * t - 0.5}, **BODY)
        errors.append(np.max(np.abs(found.path["x"] - joined(t))))
    assert slope(2.0 / (counts - 1), errors) > 3.9
    assert errors[-1] < 1e-4


def test_vakonomic_equations_of_a_geometric_constraint_are_dalemberts() -> None:
    """Accelerations of the CartesianPendulum, v(q, p) differentiated along the field, at a state on the rod."""
    vakonomic = analysis.vakonomic_equations(CartesianPendulum)
    equations, field = vakonomic.equations, vakonomic.expression
    free = equations.mechanism.free
    state = dict(zip(("x", "z", "x_dot", "z_dot"), (0.6, 1 - 0.8, 1.2 * 0.8, 1.2 * 0.6), strict=True))
    acceleration = ca.jtimes(field[:3], ca.vertcat(free.q, free.p), field)
    found = analysis.Quantity(equations, acceleration).evaluate(**state)
    np.testing.assert_allclose(found, equations.evaluate("accelerations", **state), rtol=1e-11, atol=1e-11)
