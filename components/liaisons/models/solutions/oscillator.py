"""Oscillators: the driven one on its support, its resonance, and the plane one in polar coordinates."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.language import Values, closed_form
from liaisons.models.solutions.linear import oscillation
from liaisons.models.solutions.validity import require


@closed_form("transient and stationary motion (K eq. 129), for any damping, at and off resonance", t=">= 0")
def driven(
    t: NDArray,
    at: Values,
    *,
    driven: Literal["support", "x_force"] = "support",
    amplitude: float = 0.0,
    angular_frequency: float = 1.0,
    phase: float = 0.0,
) -> dict[str, NDArray]:
    """``driven`` is the input to which amplitude · sin(angular_frequency t + phase) is added, as by a Sinusoid."""
    require(driven in ("support", "x_force"), f"Oscillator.exact: driven = {driven!r}; use 'support' or 'x_force'")
    omega_squared, per_newton = at.stiffness / at.mass, 1 / at.mass
    constant = omega_squared * at.support + per_newton * at.x_force
    size = amplitude * (omega_squared if driven == "support" else per_newton)
    forces = [(constant, 0.0), (size * -1j * np.exp(1j * phase), angular_frequency)]  # sin α = Re(-i e^iα)
    motion = oscillation(t, at.x_0, at.x_dot_0, omega_squared=omega_squared, gamma=at.damping, forces=forces)
    return dict(zip(("x", "x_dot"), motion, strict=True))


@closed_form(
    "the stationary motion amplitude · cos(ωt + φ) under 1 N · cos ωt (K eq. 121, 123)", angular_frequency="> 0"
)
def response(angular_frequency: ArrayLike, at: Values) -> tuple[NDArray, NDArray]:
    """Amplitude [m/N] and phase φ in [-π, 0] [rad]; a support that moves by 1 m acts as ``stiffness`` newton."""
    omega = np.asarray(angular_frequency, dtype=float)
    real, imaginary = at.stiffness / at.mass - omega**2, at.damping * omega
    size = np.hypot(real, imaginary)
    require(bool(np.all(size > 0)), "Oscillator.response: no stationary motion at the undamped resonance")
    return 1 / (at.mass * size), -np.arctan2(imaginary, real)


@closed_form("the angular frequency of the largest stationary amplitude, √(ω_0² - γ²/2) [rad/s] (K eq. 122)")
def resonance(at: Values) -> float:
    square = at.stiffness / at.mass - at.damping**2 / 2
    limit = np.sqrt(2 * at.stiffness / at.mass)
    require(square > 0, f"Oscillator.resonance: damping = {at.damping} must be < {limit:g} = √2 ω_0")
    return float(np.sqrt(square))


@closed_form("the ellipse of PlanarOscillator in polar coordinates, not through r = 0", phi_dot_0="!= 0")
def polar(t: NDArray, at: Values) -> dict[str, NDArray]:
    omega = np.sqrt(at.stiffness / at.mass)
    phase = omega * t
    half_turns = np.round(phase / np.pi)
    rest = phase - np.pi * half_turns  # in [-π/2, π/2], where the angle passed through is below π
    lag = t if omega == 0 else rest / omega
    cosine, sine = np.cos(rest), lag * np.sinc(rest / np.pi)  # sine is sin(rest)/Ω
    velocity = at.r_dot_0 + 1j * at.r_0 * at.phi_dot_0
    position = at.r_0 * cosine + velocity * sine  # x + i y, x along the radius at the start, but for its sign
    rate = -(omega**2) * at.r_0 * sine + velocity * cosine
    r = np.abs(position)
    return {
        "r": r,
        "phi": at.phi_0 + np.copysign(np.pi, at.phi_dot_0) * half_turns + np.angle(position),
        "r_dot": (position.conjugate() * rate).real / r,
        "phi_dot": at.phi_dot_0 * (at.r_0 / r) ** 2,
    }
