"""The plane pendulum with movable pivot and variable length."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.mechanics import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, output, point
from liaisons.models import _elliptic
from liaisons.models._bessel import lengthening_pendulum
from liaisons.models._linear import oscillation
from liaisons.models._validity import require, require_not_negative, require_positive


class Pendulum(Mechanism):
    """Point mass on a rigid massless rod whose pivot and length an operator may move.

    With the pivot at (x_p, z_p) and the bob at r = (x_p + l sin θ, z_p - l cos θ)::

        T = m |r'|²/2,    V = m g z_bob
        p_θ = ∂L/∂θ' = m l² θ' + m l (x_p' cos θ + z_p' sin θ)
        fixed pivot:      d/dt (l² θ') = -g l sin θ - η l² θ'

    θ [rad] angle from the downward vertical, l [m] length, m [kg] mass, g [m/s2] gravity, η [1/s] friction on the
    absolute velocity.  p_θ stays continuous when the operator makes l' jump.

    Source: K Ex. 3, Ex. 6 (friction, the intermediate sign corrected), Ex. 8; M 8.1 with one point mass.
    """

    mass = Parameter(1.0, "kg", "mass of the bob", above=0)
    gravity = Parameter(9.81, "m/s2", "gravitational acceleration")
    friction = Parameter(0.0, "1/s", "friction coefficient eta of K eq. 61", minimum=0, tunable=True)
    theta = Coordinate("rad", "angle of the rod from the downward vertical", start=0.1)
    length = ActiveCoordinate("m", "distance from the pivot to the bob", start=1.0, above=0)
    pivot_x = ActiveCoordinate("m", "horizontal position of the pivot")
    pivot_z = ActiveCoordinate("m", "height of the pivot")
    experiment = Experiment(stop_time=10.0, step_size=0.01)

    @point("m", "the bob")
    def bob(self) -> dict[str, ca.SX]:
        sine, cosine = ca.sin(self.theta), ca.cos(self.theta)
        return {"x": self.pivot_x + self.length * sine, "z": self.pivot_z - self.length * cosine}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bob["z"]

    def friction_coefficient(self) -> ca.SX:
        return self.friction

    @output("N", "tension of the rod, positive when it pulls the bob towards the pivot")
    def tension(self) -> ca.SX:
        return -self.operator_force(self.length)

    @staticmethod
    def exact(
        t: ArrayLike,
        *,
        theta_0: float = 0.1,
        theta_dot_0: float = 0.0,
        length: float = 1.0,
        mass: float = 1.0,
        gravity: float = 9.81,
        friction: float = 0.0,
    ) -> dict[str, NDArray]:
        """Motion with fixed pivot and length and without friction: Jacobi's elliptic functions.

        :param t: times since the start [s], any shape.
        :returns: ``theta`` [rad], ``theta_dot`` [rad/s], ``tension`` [N].
        :raises ValidityError: for friction, or mass, length or gravity that are not positive.
        """
        require_positive("Pendulum.exact", length=length, mass=mass, gravity=gravity)
        require(friction == 0, f"Pendulum.exact: friction = {friction} must be 0; see Pendulum.small_angle")
        theta, theta_dot = _elliptic.pendulum(t, theta_0, theta_dot_0, np.sqrt(gravity / length))
        tension = mass * (length * theta_dot**2 + gravity * np.cos(theta))
        return {"theta": theta, "theta_dot": theta_dot, "tension": tension}

    @staticmethod
    def period(*, theta_0: float = 0.1, theta_dot_0: float = 0.0, length: float = 1.0, gravity: float = 9.81) -> float:
        """Period of a swing, 4 K(k)/Ω, or time of a full turn, 2 K(1/k)/kΩ; infinite on the separatrix [s].

        :raises ValidityError: for length or gravity that are not positive.
        """
        require_positive("Pendulum.period", length=length, gravity=gravity)
        return _elliptic.period(theta_0, theta_dot_0, np.sqrt(gravity / length))

    @staticmethod
    def small_angle(
        t: ArrayLike,
        *,
        theta_0: float = 0.1,
        theta_dot_0: float = 0.0,
        length: float = 1.0,
        gravity: float = 9.81,
        friction: float = 0.0,
    ) -> dict[str, NDArray]:
        """Motion for sin θ ≈ θ with friction: θ'' + η θ' + Ω² θ = 0 (K Ex. 3, 6); relative period error θ²/16.

        :returns: ``theta`` [rad], ``theta_dot`` [rad/s].
        :raises ValidityError: for length or gravity not positive, or negative friction.
        """
        require_positive("Pendulum.small_angle", length=length, gravity=gravity)
        require_not_negative("Pendulum.small_angle", friction=friction)
        omega_squared = gravity / length
        theta, theta_dot = oscillation(t, theta_0, theta_dot_0, omega_squared=omega_squared, gamma=friction)
        return {"theta": theta, "theta_dot": theta_dot}

    @staticmethod
    def lengthening(
        t: ArrayLike,
        *,
        length_dot: float,
        theta_0: float = 0.1,
        theta_dot_0: float = 0.0,
        length: float = 1.0,
        gravity: float = 9.81,
    ) -> dict[str, NDArray]:
        """Motion for sin θ ≈ θ while l = length + length_dot · t: Bessel functions of order 1.

        :returns: ``theta`` [rad], ``theta_dot`` [rad/s].
        :raises ValidityError: for length_dot = 0, or when length or gravity is not positive at any of the times.
        """
        require_positive("Pendulum.lengthening", length=length, gravity=gravity)
        require(length_dot != 0, "Pendulum.lengthening: length_dot = 0 is Pendulum.small_angle")
        shortest = float(np.min(length + length_dot * np.asarray(t)))
        require(shortest > 0, f"Pendulum.lengthening: the length falls to {shortest} m; end before it reaches 0")

        theta, theta_dot = lengthening_pendulum(
            t, theta_0, theta_dot_0, length=length, speed=length_dot, gravity=gravity
        )
        return {"theta": theta, "theta_dot": theta_dot}

    @staticmethod
    def crouch_growth(*, length_low: float, length_high: float) -> float:
        """Factor by which 1 - cos θ_max grows in each half swing pumped by instantaneous crouches, (l_low/l_high)³.

        The swinger stands up (l_low → l_high) where θ = 0 and p_θ is kept, and crouches again at the turning point.

        :param length_low: length with the centre of mass low (crouched) [m]; ``length_high`` standing.
        :raises ValidityError: for lengths that are not positive.
        """
        require_positive("Pendulum.crouch_growth", length_low=length_low, length_high=length_high)
        return (length_low / length_high) ** 3
