"""Two masses that hang on springs."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form


class HangingSprings(Mechanism):
    """Two equal masses one below the other on equal springs: modes at (3 ∓ √5)/2 k/m about the position of rest.

    z_1, z_2 are stretches of the upper spring and of both together.
    Source: J. R. Taylor, Classical Mechanics, problem 11.5, gravity added.
    """

    mass = Parameter(0.5, "kg", "each mass", above=0)
    stiffness = Parameter(30.0, "N/m", "stiffness of each spring", above=0, symbol="k")
    gravity = Gravity()
    z_1 = Coordinate("m", "way of the upper mass downwards")
    z_2 = Coordinate("m", "way of the lower mass downwards", start=0.1)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.z_1) ** 2 + self.dot(self.z_2) ** 2)

    def potential_energy(self) -> ca.SX:
        springs = self.stiffness / 2 * (self.z_1**2 + (self.z_2 - self.z_1) ** 2)
        return springs - self.mass * self.gravity * (self.z_1 + self.z_2)

    @closed_form("the sum of two modes about the position of rest")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rest = at.mass * at.gravity / at.stiffness * np.array([2.0, 3.0])
        start = np.array([at.z_1_0, at.z_2_0]) - rest
        rates = np.array([at.z_1_dot_0, at.z_2_dot_0])
        z = np.zeros((2, len(t))) + rest[:, None]
        for sign in (-1, 1):
            square = (3 + sign * np.sqrt(5)) / 2
            mode = np.array([1.0, 2.0 - square])
            mode /= np.linalg.norm(mode)
            omega = np.sqrt(square * at.stiffness / at.mass)
            motion = mode @ start * np.cos(omega * t) + mode @ rates / omega * np.sin(omega * t)
            z += mode[:, None] * motion
        return {"z_1": z[0], "z_2": z[1]}
