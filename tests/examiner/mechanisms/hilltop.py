"""A particle that leaves the top of a parabolic hill."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class Hilltop(Mechanism):
    """Particle in the potential -k x²/2 and a uniform force F: x'' = (k x + F)/m."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    curvature = Parameter(2.0, "N/m", "curvature of the hill", above=0, symbol="k")
    force = Parameter(0.3, "N", "uniform force", symbol="F")
    x = Coordinate("m", "position", start=-0.5, start_rate=0.4)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return -self.curvature / 2 * self.x**2 - self.force * self.x

    @closed_form("the hyperbolic motion about the point where nothing pulls")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rate, rest = np.sqrt(at.curvature / at.mass), -at.force / at.curvature
        x = rest + (at.x_0 - rest) * np.cosh(rate * t) + at.x_dot_0 / rate * np.sinh(rate * t)
        return {"x": x}
