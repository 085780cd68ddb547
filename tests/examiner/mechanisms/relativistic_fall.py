"""A relativistic particle under a constant force."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class RelativisticFall(Mechanism):
    """Particle of high speed: L = -m c² √(1 - x'²/c²) + F x, p = m x'/√(1 - x'²/c²), p' = F.

    Source: L. D. Landau, E. M. Lifshitz, The Classical Theory of Fields, 20.
    """

    mass = Parameter(1.0, "kg", "rest mass", above=0)
    light = Parameter(3.0, "m/s", "speed of light, of another world", above=0, symbol="c")
    force = Parameter(1.5, "N", "constant force", symbol="F")
    x = Coordinate("m", "position", start_rate=0.5)

    def lagrangian(self) -> ca.SX:
        root = ca.sqrt(1 - (self.dot(self.x) / self.light) ** 2)
        return -self.mass * self.light**2 * root + self.force * self.x

    @closed_form("the hyperbolic motion")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        at.require(at.force != 0, "force must not be 0")
        start = at.mass * at.x_dot_0 / np.sqrt(1 - (at.x_dot_0 / at.light) ** 2)
        energies = [at.light * np.hypot(at.mass * at.light, p) for p in (start + at.force * t, start)]
        return {"x": at.x_0 + (energies[0] - energies[1]) / at.force}
