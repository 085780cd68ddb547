"""A block on a wedge that may slide on the floor."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form, point


class SlidingWedge(Mechanism):
    """Block of mass m on a wedge of mass M and slope α, all without friction.

    s is the way of the block down the slope, x the way of the wedge::

        (M + m) x'' + m s'' cos α = 0,    s'' + x'' cos α = g sin α

    Source: D. Morin, Introduction to Classical Mechanics, problem 6.1.
    """

    block = Parameter(1.0, "kg", "mass of the block", above=0, symbol="m")
    wedge = Parameter(4.0, "kg", "mass of the wedge", above=0, symbol="M")
    slope = Parameter(0.5, "rad", "angle of the slope", above=0, below=1.5, symbol="α")
    gravity = Gravity()
    x = Coordinate("m", "way of the wedge")
    s = Coordinate("m", "way of the block down the slope", start_rate=-1.0)

    @point("m", "the block")
    def place(self) -> dict[str, ca.SX]:
        return {"x": self.x + self.s * ca.cos(self.slope), "z": -self.s * ca.sin(self.slope)}

    def kinetic_energy(self) -> ca.SX:
        return self.block / 2 * self.speed_squared(self.place) + self.wedge / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.block * self.gravity * self.place["z"]

    @closed_form("both at constant acceleration")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        sine, cosine, both = np.sin(at.slope), np.cos(at.slope), at.block + at.wedge
        along = both * at.gravity * sine / (at.wedge + at.block * sine**2)
        aside = -at.block * along * cosine / both
        x = at.x_0 + at.x_dot_0 * t + aside / 2 * t**2
        return {"x": x, "s": at.s_0 + at.s_dot_0 * t + along / 2 * t**2}
