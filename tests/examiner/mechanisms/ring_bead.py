"""A bead on a ring, by a constraint."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form, constraint, output


class RingBead(Mechanism):
    """Bead in the plane, held at the distance R from the origin; it goes round evenly, and the ring pulls m v²/R."""

    mass = Parameter(0.2, "kg", "mass of the bead", above=0)
    radius = Parameter(0.5, "m", "radius of the ring", above=0, symbol="R")
    x = Coordinate("m", "position", start=0.5)
    y = Coordinate("m", "position, across", start_rate=1.0)

    @constraint("m", "distance from the ring")
    def ring(self) -> ca.SX:
        return ca.sqrt(self.x**2 + self.y**2) - self.radius

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.y) ** 2)

    @output("N", "pull of the ring towards the centre")
    def pull(self) -> ca.SX:
        return -self.constraint_force("ring")

    @closed_form("the even round", y_0="== 0", x_0="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        at.require(at.x_0 == at.radius and at.x_dot_0 == 0, "it must begin on the ring, along it")
        rate = at.y_dot_0 / at.radius
        x, y = at.radius * np.cos(rate * t), at.radius * np.sin(rate * t)
        return {"x": x, "y": y, "pull": at.mass * at.y_dot_0**2 / at.radius + 0 * t}
