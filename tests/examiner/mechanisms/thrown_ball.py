"""A ball that is thrown in resisting air."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Friction, Gravity, Mechanism, Parameter, Values, closed_form, point


class ThrownBall(Mechanism):
    """Ball in air whose resistance is proportional to its velocity: r'' = -g e_z - η r'.

    Source: J. R. Taylor, Classical Mechanics, 2.2 and 2.3.
    """

    mass = Parameter(0.2, "kg", "mass of the ball", above=0)
    gravity = Gravity()
    friction = Friction()
    x = Coordinate("m", "horizontal distance", start_rate=6.0)
    z = Coordinate("m", "height", start_rate=8.0)

    @point("m", "the ball")
    def ball(self) -> dict[str, ca.SX]:
        return {"x": self.x, "z": self.z}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.ball)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @closed_form("the flight with linear resistance", friction=">= 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        if at.friction == 0:
            return {"x": at.x_0 + at.x_dot_0 * t, "z": at.z_0 + at.z_dot_0 * t - at.gravity / 2 * t**2}
        eta, way = at.friction, -np.expm1(-at.friction * t) / at.friction
        last = at.gravity / eta
        return {"x": at.x_0 + at.x_dot_0 * way, "z": at.z_0 + (at.z_dot_0 + last) * way - last * t}
