"""A bead on a helix."""

from __future__ import annotations

import casadi as ca
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form, point


class HelixBead(Mechanism):
    """Bead on the helix x = R cos φ, y = R sin φ, z = h φ: (R² + h²) φ'' = -g h.

    Source: J. R. Taylor, Classical Mechanics, problem 7.20.
    """

    mass = Parameter(0.1, "kg", "mass of the bead", above=0)
    radius = Parameter(0.3, "m", "radius of the helix", above=0, symbol="R")
    pitch = Parameter(0.1, "m", "rise for each radian", symbol="h")
    gravity = Gravity()
    phi = Coordinate("rad", "azimuth", start_rate=5.0)

    @point("m", "the bead")
    def bead(self) -> dict[str, ca.SX]:
        return {
            "x": self.radius * ca.cos(self.phi),
            "y": self.radius * ca.sin(self.phi),
            "z": self.pitch * self.phi,
        }

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bead)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bead["z"]

    @closed_form("the azimuth at constant acceleration")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        acceleration = -at.gravity * at.pitch / (at.radius**2 + at.pitch**2)
        return {"phi": at.phi_0 + at.phi_dot_0 * t + acceleration / 2 * t**2}
