"""Stationary action and least constraint against closed forms."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import simpson

from liaisons import analysis
from liaisons.check import slope
from liaisons.models import CartesianPendulum, Oscillator, Pendulum

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


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("duration", [1.0, 2.0, 4.0])
def test_action_of_the_oscillator_is_stationary_but_not_always_least(duration: float, n: int) -> None:
    """δS = 0, δ²S = ½ m T ((nπ/T)² - ω²), negative for n < ω T/π: K eq. 76 says "Min" (KC7)."""
    t = np.linspace(0, duration, 401)
    x = Oscillator.exact(t, x_0=1.0, x_dot_0=0.7, **BODY)
    S = analysis.action(Oscillator, t, x, sine(t, n), **BODY)
    # Interpolation: (k h)⁴/720 with k h = 0.03·π/... <= 0.03, times derivatives of order 10
    assert S.first == pytest.approx(0.0, abs=1e-7)
    second = MASS * duration / 2 * ((n * np.pi / duration) ** 2 - OMEGA**2)
    assert S.second == pytest.approx(second, rel=1e-7)
    assert (S.second < 0) == (n < OMEGA * duration / np.pi)


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


@pytest.mark.parametrize(("phase", "index"), [(0.9, 0), (1.1, 1), (1.9, 1), (2.1, 2), (3.5, 3)])
def test_index_counts_the_conjugate_points(phase: float, index: int) -> None:
    """ω T = phase·π: the action has as many maximal directions as there are conjugate points before T (Morse)."""
    t = np.linspace(0, phase * np.pi / OMEGA, 41)
    guess = {"x": 1 - t / t[-1], "x_dot": 0 * t - 1 / t[-1]}
    assert analysis.stationary_path(Oscillator, t, guess, **BODY).index == index


def test_path_of_the_pendulum_against_elliptic_functions() -> None:
    t = np.linspace(0, 1.2, 49)
    motion = Pendulum.exact(t, theta_0=2.0, theta_dot_0=-1.0)
    exact = {name: motion[name] for name in ("theta", "theta_dot")}
    theta = exact["theta"]
    slope_of_guess = (theta[-1] - theta[0]) / t[-1]
    guess = {"theta": theta[0] + slope_of_guess * t, "theta_dot": 0 * t + slope_of_guess}
    found = analysis.stationary_path(Pendulum, t, guess)
    np.testing.assert_allclose(found.path["theta"], theta, atol=1e-6)  # (Ω h)⁴/384 = 1e-7 times κ < 10
    assert found.action == pytest.approx(analysis.action(Pendulum, t, exact).action, rel=1e-9)


def test_gauss_function_is_least_on_the_motion() -> None:
    """On the motion ½ Z²/m with Z the tension (K eq. 109); more for any other acceleration the rod allows."""
    angle, rate = 0.6, 1.4
    e, n = np.array([np.sin(angle), 0, -np.cos(angle)]), np.array([np.cos(angle), 0, np.sin(angle)])
    r, v = np.array([0, 0, 1]) + e, rate * n
    state = dict(zip(("x", "y", "z", "x_dot", "y_dot", "z_dot"), [*r, *v], strict=True)) | {"mass": 0.5}
    Q = analysis.gauss_function(CartesianPendulum)

    def value(along: float) -> float:
        a = -(rate**2) * e + along * n
        return float(Q.evaluate(x_ddot=a[0], y_ddot=a[1], z_ddot=a[2], **state))

    tension, free = 0.5 * (rate**2 + 9.81 * np.cos(angle)), -9.81 * np.sin(angle)
    assert value(free) == pytest.approx(tension**2 / (2 * 0.5), rel=1e-13)
    for other in (-1.0, 0.5, 3.0):
        assert value(free + other) == pytest.approx(value(free) + 0.5 * other**2 / 2, rel=1e-13)
    assert Q.evaluate(x_ddot=0, y_ddot=0, z_ddot=-9.81, **state) == pytest.approx(0.0, abs=1e-14)


def test_holders_principle_in_coordinates_with_constraints() -> None:
    """M eq. 15: ⟨δI, w⟩ = 0 for w across the rod; for w along it -∫ λ w dt with the force λ = 2 l λ_1 of the rod."""
    t = np.linspace(0, 2.0, 801)
    motion = CartesianPendulum.exact(t, theta_0=2.0, theta_dot_0=-1.0)
    theta, rate = (Pendulum.exact(t, theta_0=2.0, theta_dot_0=-1.0)[name] for name in ("theta", "theta_dot"))
    e, n = np.exp(1j * (theta - np.pi / 2)), np.exp(1j * theta)  # along and across the rod, in x + iz
    velocity = rate * n
    path = {
        "x": motion["x"],
        "z": motion["z"],
        "x_dot": np.real(velocity),
        "z_dot": np.imag(velocity),
        "y": 0 * t,
        "y_dot": 0 * t,
    }
    bump = sine(t, 2)

    def first(direction: np.ndarray, turned: np.ndarray) -> float:
        w = bump["x"] * direction
        w_dot = bump["x_dot"] * direction + bump["x"] * rate * turned
        varied = {"x": np.real(w), "z": np.imag(w), "x_dot": np.real(w_dot), "z_dot": np.imag(w_dot)}
        return analysis.action(CartesianPendulum, t, path, varied).first

    # (k h)⁴/384 = 1e-9 at k = 6 /s, times forces of 20 N
    assert first(n, -e) == pytest.approx(0.0, abs=1e-7)
    work = -simpson(2 * motion["lambda_1"] * bump["x"], x=t)
    assert abs(work) > 1
    assert first(e, n) == pytest.approx(work, abs=1e-7)


def test_vakonomic_equations_of_a_geometric_constraint_are_dalemberts() -> None:
    """Accelerations of the CartesianPendulum, v(q, p) differentiated along the field, at a state on the rod."""
    vakonomic = analysis.vakonomic_equations(CartesianPendulum)
    equations, field = vakonomic.equations, vakonomic.expression
    free = equations.mechanism.free
    state = dict(zip(("x", "z", "x_dot", "z_dot"), (0.6, 1 - 0.8, 1.2 * 0.8, 1.2 * 0.6), strict=True))
    acceleration = ca.jtimes(field[:3], ca.vertcat(free.q, free.p), field)
    found = analysis.Quantity(equations, acceleration).evaluate(**state)
    np.testing.assert_allclose(found, equations.evaluate("accelerations", **state), rtol=1e-11, atol=1e-11)
