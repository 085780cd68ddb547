"""A cylinder that rolls down a slope."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form


class RollingCylinder(Mechanism):
    """Full cylinder that rolls without slip: 3/2 m s'' = m g sin α.

    Source: J. R. Taylor, Classical Mechanics, problem 7.14, on a slope.
    """

    mass = Parameter(2.0, "kg", "mass of the cylinder", above=0)
    radius = Parameter(0.1, "m", "radius of the cylinder", above=0)
    slope = Parameter(0.3, "rad", "angle of the slope", symbol="α")
    gravity = Gravity()
    s = Coordinate("m", "way down the slope")

    def kinetic_energy(self) -> ca.SX:
        inertia = self.mass * self.radius**2 / 2
        return self.mass / 2 * self.dot(self.s) ** 2 + inertia / 2 * (self.dot(self.s) / self.radius) ** 2

    def potential_energy(self) -> ca.SX:
        return -self.mass * self.gravity * self.s * ca.sin(self.slope)

    @closed_form("the way at constant acceleration")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        return {"s": at.s_0 + at.s_dot_0 * t + at.gravity * np.sin(at.slope) / 3 * t**2}
