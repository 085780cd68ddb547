"""A bead on a cycloid: Huygens' pendulum."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form, output, point


class CycloidBead(Mechanism):
    """Bead on the cycloid x = R (u + sin u), z = R (1 - cos u): its arc length 4 R sin(u/2) swings harmonically.

    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 21, problem 1 and 11; E. T. Whittaker, Analytical Dynamics, 47.
    """

    mass = Parameter(0.2, "kg", "mass of the bead", above=0)
    radius = Parameter(0.6, "m", "radius of the rolling circle", above=0, symbol="R")
    gravity = Gravity()
    u = Coordinate("rad", "angle by which the circle has rolled", start=1.5)

    @point("m", "the bead")
    def bead(self) -> dict[str, ca.SX]:
        return {"x": self.radius * (self.u + ca.sin(self.u)), "z": self.radius * (1 - ca.cos(self.u))}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bead)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bead["z"]

    @output("m", "arc length from the lowest point")
    def arc(self) -> ca.SX:
        return 4 * self.radius * ca.sin(self.u / 2)

    @closed_form("the arc length: a harmonic oscillation of any amplitude", gravity="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega = np.sqrt(at.gravity / (4 * at.radius))
        start, rate = 4 * at.radius * np.sin(at.u_0 / 2), 2 * at.radius * np.cos(at.u_0 / 2) * at.u_dot_0
        return {"arc": start * np.cos(omega * t) + rate / omega * np.sin(omega * t)}
