"""The damped linear oscillator on a movable support."""

from __future__ import annotations

from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.language import ActiveCoordinate, Coordinate, Experiment, Friction, Mechanism, Parameter, output
from liaisons.language.closed_forms import Values, closed_form
from liaisons.models.solutions.linear import oscillation
from liaisons.models.solutions.validity import require


class Oscillator(Mechanism):
    """Mass on a spring whose other end, the support, an operator may move.

    ::

        m x'' = -K (x - x_0) - m γ x' + F(t)                              K eq. 114
        u'' + γ u' + ω_0² u = F/m,    ω_0² = K/m                          K eq. 115

    x_0 is the support, F the force on the port of x.  Under F = |F_0| cos ωt the stationary motion is
    |u_0| cos(ωt + φ) with

        |u_0| = (|F_0|/m) / √((ω² - ω_0²)² + γ²ω²)                        K eq. 121
        φ = -atan2(γω, ω_0² - ω²) in (-π, 0)                              K eq. 123, its branch corrected
        ω_res = √(ω_0² - γ²/2)  if  γ < √2 ω_0                            K eq. 122, corrected

    Source: K 5.1.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of the spring; 0 is a free mass", minimum=0, symbol="K")
    damping = Friction("damping gamma of K eq. 114, on the absolute velocity", "γ")
    x = Coordinate("m", "position of the mass", start=1.0)
    support = ActiveCoordinate("m", "position of the support, the x_0 of K eq. 114")
    experiment = Experiment(stop_time=20.0)

    @output("m", "elongation of the spring, x - support")
    def elongation(self) -> ca.SX:
        return self.x - self.support

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.elongation**2

    @closed_form("transient and stationary motion (K eq. 129), for any damping, at and off resonance", t=">= 0")
    @staticmethod
    def exact(
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
        x, x_dot = oscillation(t, at.x_0, at.x_dot_0, omega_squared=omega_squared, gamma=at.damping, forces=forces)
        return {"x": x, "x_dot": x_dot}

    @closed_form(
        "the stationary motion amplitude · cos(ωt + φ) under 1 N · cos ωt (K eq. 121, 123)", angular_frequency="> 0"
    )
    @staticmethod
    def response(angular_frequency: ArrayLike, at: Values) -> tuple[NDArray, NDArray]:
        """Amplitude [m/N] and phase φ in [-π, 0] [rad]; a support that moves by 1 m acts as ``stiffness`` newton."""
        omega = np.asarray(angular_frequency, dtype=float)
        real, imaginary = at.stiffness / at.mass - omega**2, at.damping * omega
        size = np.hypot(real, imaginary)
        require(bool(np.all(size > 0)), "Oscillator.response: no stationary motion at the undamped resonance")
        return 1 / (at.mass * size), -np.arctan2(imaginary, real)

    @closed_form("the angular frequency of the largest stationary amplitude, √(ω_0² - γ²/2) [rad/s] (K eq. 122)")
    @staticmethod
    def resonance(at: Values) -> float:
        square = at.stiffness / at.mass - at.damping**2 / 2
        limit = np.sqrt(2 * at.stiffness / at.mass)
        require(square > 0, f"Oscillator.resonance: damping = {at.damping} must be < {limit:g} = √2 ω_0")
        return float(np.sqrt(square))
