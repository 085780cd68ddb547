"""A charge in a magnetic and an electric field."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class CrossedFields(Mechanism):
    """Charge q in a magnetic field B along z and an electric field E along y.

    L = m/2 (x'² + y'²) + q B/2 (x y' - y x') + q E y::

        m x'' = q B y',    m y'' = q E - q B x'

    Source: L. D. Landau, E. M. Lifshitz, The Classical Theory of Fields, 22.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    charge = Parameter(0.5, "C", "charge", symbol="q")
    magnetic = Parameter(4.0, "T", "magnetic field along z", symbol="B")
    electric = Parameter(2.0, "V/m", "electric field along y", symbol="E")
    x = Coordinate("m", "position across the electric field")
    y = Coordinate("m", "position along the electric field", start_rate=0.4)

    def lagrangian(self) -> ca.SX:
        x, y, x_dot, y_dot = self.x, self.y, self.dot(self.x), self.dot(self.y)
        free = self.mass / 2 * (x_dot**2 + y_dot**2)
        return free + self.charge * self.magnetic / 2 * (x * y_dot - y * x_dot) + self.charge * self.electric * y

    @closed_form("the trochoid: a circle that drifts at E/B")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega, drift = at.charge * at.magnetic / at.mass, at.electric / at.magnetic
        u, v = at.x_dot_0 - drift, at.y_dot_0
        sine, cosine = np.sin(omega * t), np.cos(omega * t)
        x = at.x_0 + drift * t + (u * sine + v * (1 - cosine)) / omega
        y = at.y_0 + (v * sine - u * (1 - cosine)) / omega
        return {"x": x, "y": y}
