"""A rigid body that swings about a fixed horizontal axis."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj, ellipk

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form, point


class PhysicalPendulum(Mechanism):
    """Rigid body on a horizontal axis: (J + m h²) θ'' = -m g h sin θ.

    J is the moment of inertia about the centre of mass, h the distance of the axis from it.
    Source: D. Morin, Introduction to Classical Mechanics, 8.4.
    """

    mass = Parameter(3.0, "kg", "mass of the body", above=0)
    inertia = Parameter(0.2, "kg.m2", "moment of inertia about the centre of mass", above=0, symbol="J")
    arm = Parameter(0.4, "m", "distance from the axis to the centre of mass", above=0, symbol="h")
    gravity = Gravity()
    theta = Coordinate("rad", "angle from the position of rest", start=1.2)

    @point("m", "the centre of mass")
    def centre(self) -> dict[str, ca.SX]:
        return {"x": self.arm * ca.sin(self.theta), "z": -self.arm * ca.cos(self.theta)}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.centre) + self.inertia / 2 * self.dot(self.theta) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.centre["z"]

    @closed_form("the swing from rest: Jacobi's elliptic functions", theta_dot_0="== 0", gravity="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega = np.sqrt(at.mass * at.gravity * at.arm / (at.inertia + at.mass * at.arm**2))
        k = np.sin(at.theta_0 / 2)
        sn = ellipj(ellipk(k**2) + omega * t, k**2)[0]
        return {"theta": 2 * np.arcsin(k * sn)}
