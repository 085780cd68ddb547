"""The damped linear oscillator on a movable support."""

from __future__ import annotations

from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.mechanics import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, output
from liaisons.models._linear import oscillation
from liaisons.models._validity import require, require_not_negative, require_positive


class Oscillator(Mechanism):
    """Mass on a spring whose other end, the support, an operator may move.

    ::

        m x'' = -K (x - x_0) - m γ x' + F(t)                              K eq. 114
        u'' + γ u' + ω_0² u = F/m,    ω_0² = K/m                          K eq. 115

    x [m] position, x_0 [m] the support, K [N/m] stiffness, γ [1/s] damping on the absolute velocity (friction of
    K eq. 61), F [N] the force on the port of x.  The stationary motion under F = |F_0| cos ωt is
    |u_0| cos(ωt + φ) with

        |u_0| = (|F_0|/m) / √((ω² - ω_0²)² + γ²ω²)                        K eq. 121
        φ = -atan2(γω, ω_0² - ω²) in (-π, 0)                              K eq. 123, its branch corrected
        ω_res = √(ω_0² - γ²/2)  if  γ < √2 ω_0                            K eq. 122, corrected

    Source: K 5.1.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of the spring; 0 is a free mass", minimum=0)
    damping = Parameter(0.0, "1/s", "damping gamma of K eq. 114, on the absolute velocity", minimum=0, tunable=True)
    x = Coordinate("m", "position of the mass", start=1.0)
    support = ActiveCoordinate("m", "position of the support, the x_0 of K eq. 114")
    experiment = Experiment(stop_time=20.0, step_size=0.01)

    @output("m", "elongation of the spring, x - support")
    def elongation(self) -> ca.SX:
        return self.x - self.support

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.elongation**2

    def friction_coefficient(self) -> ca.SX:
        return self.damping

    @staticmethod
    def exact(
        t: ArrayLike,
        *,
        x_0: float = 1.0,
        x_dot_0: float = 0.0,
        mass: float = 1.0,
        stiffness: float = 1.0,
        damping: float = 0.0,
        support: float = 0.0,
        x_force: float = 0.0,
        amplitude: float = 0.0,
        angular_frequency: float = 1.0,
        phase: float = 0.0,
        driven: Literal["support", "x_force"] = "support",
    ) -> dict[str, NDArray]:
        """Transient and stationary motion (K eq. 129), for any damping, at and off resonance.

        :param t: times since the start [s], any shape, >= 0.
        :param support: constant part of the support's position [m]; ``x_force`` constant part of the force [N].
        :param driven: the input to which amplitude · sin(angular_frequency t + phase) is added, as by a ``Sinusoid``.
        :returns: ``x`` [m], ``x_dot`` [m/s].
        :raises ValidityError: for mass <= 0, negative stiffness, damping or times, or an unknown input.
        """
        require_positive("Oscillator.exact", mass=mass)
        require_not_negative("Oscillator.exact", stiffness=stiffness, damping=damping, t=float(np.min(t)))
        require(driven in ("support", "x_force"), f"Oscillator.exact: driven = {driven!r}; use 'support' or 'x_force'")
        per_unit = {"support": stiffness / mass, "x_force": 1 / mass}
        constant = per_unit["support"] * support + per_unit["x_force"] * x_force
        sinusoid = per_unit[driven] * amplitude * -1j * np.exp(1j * phase)  # sin α = Re(-i e^iα)
        x, x_dot = oscillation(
            t,
            x_0,
            x_dot_0,
            omega_squared=stiffness / mass,
            gamma=damping,
            forces=[(constant, 0.0), (sinusoid, angular_frequency)],
        )
        return {"x": x, "x_dot": x_dot}

    @staticmethod
    def response(
        angular_frequency: ArrayLike, *, mass: float = 1.0, stiffness: float = 1.0, damping: float = 0.0
    ) -> tuple[NDArray, NDArray]:
        """Stationary motion under a force cos ωt (K eq. 121, and eq. 123 on its right branch).

        :param angular_frequency: ω [rad/s], any shape, > 0.
        :returns: amplitude per newton [m/N] and phase φ in [-π, 0] [rad]: a motion amplitude · cos(ωt + φ).  A
            support that moves by 1 m acts as a force of ``stiffness`` newton.
        :raises ValidityError: for mass <= 0, negative stiffness or damping, or the undamped resonance.
        """
        omega = np.asarray(angular_frequency, dtype=float)
        require_positive("Oscillator.response", mass=mass, angular_frequency=float(np.min(omega)))
        require_not_negative("Oscillator.response", stiffness=stiffness, damping=damping)
        real, imaginary = stiffness / mass - omega**2, damping * omega
        size = np.hypot(real, imaginary)
        require(bool(np.all(size > 0)), "Oscillator.response: no stationary motion at the undamped resonance")
        return 1 / (mass * size), -np.arctan2(imaginary, real)

    @staticmethod
    def resonance(*, mass: float = 1.0, stiffness: float = 1.0, damping: float = 0.0) -> float:
        """Angular frequency of the largest stationary amplitude, √(ω_0² - γ²/2) [rad/s] (K eq. 122, corrected).

        :raises ValidityError: for γ >= √2 ω_0, where the amplitude falls from the start and there is no resonance.
        """
        require_positive("Oscillator.resonance", mass=mass)
        square = stiffness / mass - damping**2 / 2
        require(
            square > 0,
            f"Oscillator.resonance: damping = {damping} must be < {np.sqrt(2 * stiffness / mass):g} = √2 ω_0",
        )
        return float(np.sqrt(square))
