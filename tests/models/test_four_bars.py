"""FourBars: parallelograms that pass through singular configurations, where the constraints lose rank."""

from __future__ import annotations

import numpy as np
import pytest
from on_paper import State, equations_of

from liaisons.models import four_bars

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
