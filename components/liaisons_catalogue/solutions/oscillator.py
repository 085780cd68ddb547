"""The oscillator under a sine of its support or of a force: its motion, its stationary motion, its resonance."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.linear import coordinate_motion


@closed_form("transient and stationary motion (K eq. 129), for any damping, at and off resonance", t=">= 0")
def exact(
    t: NDArray,
    at: Values,
    *,
    driven: Literal["support", "x_force"] = "support",
    amplitude: float = 0.0,
    angular_frequency: float = 1.0,
    phase: float = 0.0,
) -> dict[str, NDArray]:
    """Return x and its rate; amplitude · sin(angular_frequency t + phase) is added to the input ``driven``."""
    at.require(driven in ("support", "x_force"), f"driven = {driven!r}; use 'support' or 'x_force'")
    omega_squared, per_newton = at.stiffness / at.mass, 1 / at.mass
    constant = omega_squared * at.support + per_newton * at.x_force
    size = amplitude * (omega_squared if driven == "support" else per_newton)
    forces = [(constant, 0.0), (size * -1j * np.exp(1j * phase), angular_frequency)]  # sin α = Re(-i e^iα)
    return coordinate_motion(t, at, "x", omega_squared=omega_squared, gamma=at.damping, forces=forces)


@closed_form(
    "the stationary motion amplitude · cos(ωt + φ) under 1 N · cos ωt (K eq. 121, 123)", angular_frequency="> 0"
)
def response(angular_frequency: ArrayLike, at: Values) -> tuple[NDArray, NDArray]:
    """Return amplitude [m/N] and phase φ in [-π, 0] [rad]; a support moved by 1 m acts as ``stiffness`` newton."""
    omega = np.asarray(angular_frequency, dtype=float)
    real, imaginary = at.stiffness / at.mass - omega**2, at.damping * omega
    size = np.hypot(real, imaginary)
    at.require(np.all(size > 0), "no stationary motion at the undamped resonance")
    return 1 / (at.mass * size), -np.arctan2(imaginary, real)


@closed_form("the angular frequency of the largest stationary amplitude, √(ω_0² - γ²/2) [rad/s] (K eq. 122)")
def resonance(at: Values) -> float:
    square = at.stiffness / at.mass - at.damping**2 / 2
    limit = np.sqrt(2 * at.stiffness / at.mass)
    at.require(square > 0, f"damping = {at.damping} must be < {limit:g} = √2 ω_0")
    return float(np.sqrt(square))
