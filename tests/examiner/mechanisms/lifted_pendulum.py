"""A pendulum in a lift."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj, ellipk

from liaisons import ActiveCoordinate, Coordinate, Experiment, Gravity, Mechanism, Parameter, Values, closed_form, point


class LiftedPendulum(Mechanism):
    """Pendulum whose pivot an operator lifts to the height h: l θ'' = -(g + h'') sin θ.

    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 5, problem 3; the lift moves evenly.
    """

    mass = Parameter(0.4, "kg", "mass of the bob", above=0)
    length = Parameter(0.9, "m", "length of the rod", above=0, symbol="l")
    gravity = Gravity()
    theta = Coordinate("rad", "angle from the downward vertical", start=0.8)
    lift = ActiveCoordinate("m", "height of the pivot", symbol="h")
    experiment = Experiment(reference={"lift_dot": 1.5})

    @point("m", "the bob")
    def bob(self) -> dict[str, ca.SX]:
        return {"x": self.length * ca.sin(self.theta), "z": self.lift - self.length * ca.cos(self.theta)}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bob["z"]

    @closed_form("the swing from rest in a lift that moves evenly", theta_dot_0="== 0", gravity="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega, k = np.sqrt(at.gravity / at.length), np.sin(at.theta_0 / 2)
        sn, cn, _, _ = ellipj(ellipk(k**2) + omega * t, k**2)
        theta = 2 * np.arcsin(k * sn)
        rate_squared = (2 * omega * k * cn) ** 2
        pull = at.mass * (at.gravity * np.cos(theta) + at.length * rate_squared)
        return {"theta": theta, "lift_force": pull * np.cos(theta) + 0 * at.lift_dot}
