"""A mass on a spring with viscous damping."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class DampedSpring(Mechanism):
    """Mass on a spring and a damper: m x'' = -k x - b x'.

    x is the stretch of the spring.  Source: J. R. Taylor, Classical Mechanics, 5.4.
    """

    mass = Parameter(2.0, "kg", "mass", above=0)
    stiffness = Parameter(18.0, "N/m", "stiffness of the spring", above=0, symbol="k")
    damping = Parameter(0.8, "N.s/m", "coefficient of the damper", minimum=0, symbol="b")
    x = Coordinate("m", "stretch of the spring", start=0.5)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.x**2

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * self.dot(self.x) ** 2

    @closed_form("the damped oscillation below critical damping")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        beta = at.damping / (2 * at.mass)
        square = at.stiffness / at.mass - beta**2
        at.require(square > 0, "damping must be below critical")
        omega = np.sqrt(square)
        swing = at.x_0 * np.cos(omega * t) + (at.x_dot_0 + beta * at.x_0) / omega * np.sin(omega * t)
        return {"x": np.exp(-beta * t) * swing}
