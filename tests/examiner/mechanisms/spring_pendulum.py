"""A pendulum whose rod is a spring."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form, point


class SpringPendulum(Mechanism):
    """Mass on a spring that may swing: its vertical oscillation is a solution.

    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 5; J. R. Taylor, Classical Mechanics, problem 7.35.
    """

    mass = Parameter(1.0, "kg", "mass of the bob", above=0)
    stiffness = Parameter(40.0, "N/m", "stiffness of the spring", above=0, symbol="k")
    natural = Parameter(0.7, "m", "natural length of the spring", above=0, symbol="l_0")
    gravity = Gravity()
    r = Coordinate("m", "length of the spring", start=1.1, above=0)
    theta = Coordinate("rad", "angle from the downward vertical")

    @point("m", "the bob")
    def bob(self) -> dict[str, ca.SX]:
        return {"x": self.r * ca.sin(self.theta), "z": -self.r * ca.cos(self.theta)}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.r - self.natural) ** 2 + self.mass * self.gravity * self.bob["z"]

    @closed_form("the oscillation along the vertical", theta_0="== 0", theta_dot_0="== 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega = np.sqrt(at.stiffness / at.mass)
        rest = at.natural + at.mass * at.gravity / at.stiffness
        r = rest + (at.r_0 - rest) * np.cos(omega * t) + at.r_dot_0 / omega * np.sin(omega * t)
        return {"r": r, "theta": 0 * t}
