"""Morse's oscillator."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class MorseOscillator(Mechanism):
    """Particle in the potential D (1 - exp(-a x))².

    With ε = E/D < 1 and Ω = a sqrt(2 D (1 - ε)/m), from an apse: exp(a x) = (1 ± √ε cos Ω t)/(1 - ε).
    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 12, problem 2 (the potential).
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    depth = Parameter(2.0, "J", "depth of the well", above=0, symbol="D")
    width = Parameter(1.3, "1/m", "inverse width of the well", above=0, symbol="a")
    x = Coordinate("m", "distance from the bottom of the well", start=0.5)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.depth * (1 - ca.exp(-self.width * self.x)) ** 2

    @closed_form("the oscillation from rest", x_dot_0="== 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        root = 1 - np.exp(-at.width * at.x_0)
        at.require(abs(root) < 1, "it escapes")
        omega = at.width * np.sqrt(2 * at.depth * (1 - root**2) / at.mass)
        return {"x": np.log((1 + root * np.cos(omega * t)) / (1 - root**2)) / at.width}
