"""Two carts on three springs."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class CoupledCarts(Mechanism):
    """Two equal carts between walls, on springs k, k_2, k: modes at k/m and (k + 2 k_2)/m.

    Source: J. R. Taylor, Classical Mechanics, 11.2 and 11.3.
    """

    mass = Parameter(1.0, "kg", "mass of each cart", above=0)
    stiffness = Parameter(4.0, "N/m", "stiffness of the outer springs", above=0, symbol="k")
    coupling = Parameter(1.5, "N/m", "stiffness of the spring between the carts", minimum=0, symbol="k_2")
    x_1 = Coordinate("m", "displacement of the first cart", start=0.3)
    x_2 = Coordinate("m", "displacement of the second cart", start_rate=0.2)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x_1) ** 2 + self.dot(self.x_2) ** 2)

    def potential_energy(self) -> ca.SX:
        outer = self.stiffness / 2 * (self.x_1**2 + self.x_2**2)
        return outer + self.coupling / 2 * (self.x_2 - self.x_1) ** 2

    @closed_form("the sum of two modes")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        slow, fast = np.sqrt(at.stiffness / at.mass), np.sqrt((at.stiffness + 2 * at.coupling) / at.mass)
        sums = (at.x_1_0 + at.x_2_0) * np.cos(slow * t) + (at.x_1_dot_0 + at.x_2_dot_0) / slow * np.sin(slow * t)
        differences = (at.x_1_0 - at.x_2_0) * np.cos(fast * t)
        differences = differences + (at.x_1_dot_0 - at.x_2_dot_0) / fast * np.sin(fast * t)
        return {"x_1": (sums + differences) / 2, "x_2": (sums - differences) / 2}
