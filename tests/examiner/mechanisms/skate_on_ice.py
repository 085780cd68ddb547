"""A skate on an inclined plane."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form, non_holonomic


class SkateOnIce(Mechanism):
    """Knife edge on a plane of slope α, x downhill: it may move along its edge and turn, not slip aside.

    x' sin φ = y' cos φ;  with φ = ω t from rest x = g sin α sin² ωt/(2 ω²), and it never goes down for good.
    Source: Ju. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems, 2.4.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    inertia = Parameter(0.1, "kg.m2", "moment of inertia about the normal of the plane", above=0, symbol="J")
    slope = Parameter(0.2, "rad", "angle of the plane", symbol="α")
    gravity = Gravity()
    x = Coordinate("m", "position downhill")
    y = Coordinate("m", "position across")
    phi = Coordinate("rad", "direction of the edge from downhill", start_rate=1.5)

    @non_holonomic("m/s", "velocity across the edge")
    def edge(self) -> ca.SX:
        return self.dot(self.x) * ca.sin(self.phi) - self.dot(self.y) * ca.cos(self.phi)

    def kinetic_energy(self) -> ca.SX:
        slide = self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.y) ** 2)
        return slide + self.inertia / 2 * self.dot(self.phi) ** 2

    def potential_energy(self) -> ca.SX:
        return -self.mass * self.gravity * ca.sin(self.slope) * self.x

    @closed_form("the cycloid from rest", phi_0="== 0", x_dot_0="== 0", y_dot_0="== 0", phi_dot_0="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega, pull = at.phi_dot_0, at.gravity * np.sin(at.slope)
        x = at.x_0 + pull / (2 * omega**2) * np.sin(omega * t) ** 2
        y = at.y_0 + pull / (2 * omega**2) * (omega * t - np.sin(2 * omega * t) / 2)
        return {"x": x, "y": y, "phi": omega * t}
