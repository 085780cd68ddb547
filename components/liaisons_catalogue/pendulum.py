"""The plane pendulum with movable pivot and variable length."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons.language import (
    ActiveCoordinate,
    Ball,
    Coordinate,
    Friction,
    Gravity,
    Mechanism,
    Parameter,
    Rod,
    Shapes,
    Trail,
    output,
    point,
)
from liaisons_catalogue.solutions import elliptic


class Pendulum(Mechanism):
    """Point mass on a rigid massless rod whose pivot and length an operator may move.

    With the pivot at (x_p, z_p) and the bob at r = (x_p + l sin θ, z_p - l cos θ)::

        p_θ = ∂L/∂θ' = m l² θ' + m l (x_p' cos θ + z_p' sin θ)
        fixed pivot:      d/dt (l² θ') = -g l sin θ - η l² θ'

    Friction η acts on the absolute velocity.  p_θ stays continuous when the operator makes l' jump.

    Source: K Ex. 3, Ex. 6 (friction, the intermediate sign corrected), Ex. 8; M 8.1 with one point mass.
    """

    mass = Parameter(1.0, "kg", "mass of the bob", above=0)
    gravity = Gravity()
    friction = Friction()
    theta = Coordinate("rad", "angle of the rod from the downward vertical", start=0.1)
    length = ActiveCoordinate("m", "distance from the pivot to the bob", start=1.0, above=0)
    pivot_x = ActiveCoordinate("m", "horizontal position of the pivot", symbol="x_p")
    pivot_z = ActiveCoordinate("m", "height of the pivot", symbol="z_p")

    @point("m", "the bob")
    def bob(self) -> dict[str, ca.SX]:
        sine, cosine = ca.sin(self.theta), ca.cos(self.theta)
        return {"x": self.pivot_x + self.length * sine, "z": self.pivot_z - self.length * cosine}

    def picture(self) -> Shapes:
        pivot = {"x": self.pivot_x, "z": self.pivot_z}
        return [Trail(self.bob), Rod(pivot, self.bob), Ball(self.bob)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bob["z"]

    @output("N", "tension of the rod, positive when it pulls the bob towards the pivot")
    def tension(self) -> ca.SX:
        return -self.operator_force(self.length)

    @closed_form("the motion with fixed pivot and length: Jacobi's elliptic functions", gravity="> 0", friction="== 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        theta, theta_dot = elliptic.pendulum(t, at.theta_0, at.theta_dot_0, np.sqrt(at.gravity / at.length))
        tension = at.mass * (at.length * theta_dot**2 + at.gravity * np.cos(theta))
        return {"theta": theta, "theta_dot": theta_dot, "tension": tension}

    from liaisons_catalogue.solutions.pendulum import action, lengthening, period, small_angle
    from liaisons_catalogue.solutions.pumping import crouch_growth, crouch_schedule, pumped, pumping_rate
    from liaisons_catalogue.solutions.shaking import (
        shaken_edges,
        shaken_is_bounded,
        shaken_trace,
        upright_from,
        upright_well,
    )
