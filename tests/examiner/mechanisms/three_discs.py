"""Three discs on a shaft."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class ThreeDiscs(Mechanism):
    """Three equal discs on an elastic shaft: modes at 0, k/J and 3 k/J.

    Source: J. P. Den Hartog, Mechanical Vibrations, 4.3 and 5.1.
    """

    inertia = Parameter(0.5, "kg.m2", "moment of inertia of each disc", above=0, symbol="J")
    stiffness = Parameter(20.0, "N.m/rad", "stiffness of each piece of the shaft", above=0, symbol="k")
    phi_1 = Coordinate("rad", "angle of the first disc", start=0.2)
    phi_2 = Coordinate("rad", "angle of the disc in the middle", start_rate=1.0)
    phi_3 = Coordinate("rad", "angle of the last disc", start=-0.1)

    def kinetic_energy(self) -> ca.SX:
        squares = self.dot(self.phi_1) ** 2 + self.dot(self.phi_2) ** 2 + self.dot(self.phi_3) ** 2
        return self.inertia / 2 * squares

    def potential_energy(self) -> ca.SX:
        twists = (self.phi_2 - self.phi_1) ** 2 + (self.phi_3 - self.phi_2) ** 2
        return self.stiffness / 2 * twists

    @closed_form("the sum of three modes")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        modes = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])
        angles = modes @ np.array([at.phi_1_0, at.phi_2_0, at.phi_3_0])
        rates = modes @ np.array([at.phi_1_dot_0, at.phi_2_dot_0, at.phi_3_dot_0])
        slow = np.sqrt(at.stiffness / at.inertia)
        fast = np.sqrt(3) * slow
        parts = np.array(
            [
                angles[0] + rates[0] * t,
                angles[1] * np.cos(slow * t) + rates[1] / slow * np.sin(slow * t),
                angles[2] * np.cos(fast * t) + rates[2] / fast * np.sin(fast * t),
            ]
        )
        phi_1, phi_2, phi_3 = modes.T @ parts
        return {"phi_1": phi_1, "phi_2": phi_2, "phi_3": phi_3}
