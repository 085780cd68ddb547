"""A spherical pendulum on a cone."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form, point


class ConicalPendulum(Mechanism):
    """Point mass on a rod that may swing in all directions: l θ'' = l φ'² sin θ cos θ - g sin θ.

    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 14, problem 1; the motion with θ constant.
    """

    mass = Parameter(0.5, "kg", "mass of the bob", above=0)
    length = Parameter(1.0, "m", "length of the rod", above=0, symbol="l")
    gravity = Gravity()
    theta = Coordinate("rad", "angle from the downward vertical", start=0.7)
    phi = Coordinate("rad", "azimuth", start_rate=float(np.sqrt(9.81 / np.cos(0.7))))

    @point("m", "the bob")
    def bob(self) -> dict[str, ca.SX]:
        across, down = self.length * ca.sin(self.theta), self.length * ca.cos(self.theta)
        return {"x": across * ca.cos(self.phi), "y": across * ca.sin(self.phi), "z": -down}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bob["z"]

    @closed_form("the cone, at the rate that belongs to its angle", theta_dot_0="== 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rate = np.sqrt(at.gravity / (at.length * np.cos(at.theta_0)))
        at.require(abs(abs(at.phi_dot_0) - rate) < 1e-12 * rate, "phi_dot_0 must be the rate on the cone")
        return {"theta": at.theta_0 + 0 * t, "phi": at.phi_0 + at.phi_dot_0 * t}
