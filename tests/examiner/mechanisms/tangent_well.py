"""A particle in the well tan²."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class TangentWell(Mechanism):
    """Particle in the potential U tan² αx: sin αx swings harmonically.

    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 11, problem 2c.
    """

    mass = Parameter(0.5, "kg", "mass", above=0)
    height = Parameter(1.0, "J", "scale of the potential", above=0, symbol="U")
    alpha = Parameter(2.0, "1/m", "inverse width of the well", above=0)
    x = Coordinate("m", "position", start=0.2, start_rate=1.0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.height * ca.tan(self.alpha * self.x) ** 2

    @closed_form("the oscillation of any energy")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        energy = at.mass / 2 * at.x_dot_0**2 + at.height * np.tan(at.alpha * at.x_0) ** 2
        omega = at.alpha * np.sqrt(2 * (energy + at.height) / at.mass)
        start, rate = np.sin(at.alpha * at.x_0), at.alpha * np.cos(at.alpha * at.x_0) * at.x_dot_0
        return {"x": np.arcsin(start * np.cos(omega * t) + rate / omega * np.sin(omega * t)) / at.alpha}
