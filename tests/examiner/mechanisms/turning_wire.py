"""A bead on a straight wire that turns in a horizontal plane."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, Values, closed_form, point


class TurningWire(Mechanism):
    """Bead on a straight wire which an operator turns about one of its points: r'' = r φ'².

    Source: H. Goldstein, Classical Mechanics, 1.6.
    """

    mass = Parameter(0.3, "kg", "mass of the bead", above=0)
    r = Coordinate("m", "distance from the axis", start=0.2)
    turn = ActiveCoordinate("rad", "angle of the wire", symbol="φ")
    experiment = Experiment(reference={"turn_dot": 1.5})

    @point("m", "the bead")
    def bead(self) -> dict[str, ca.SX]:
        return {"x": self.r * ca.cos(self.turn), "y": self.r * ca.sin(self.turn)}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bead)

    @closed_form("the flight along the wire at constant rate", turn_dot="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rate = at.turn_dot
        r = at.r_0 * np.cosh(rate * t) + at.r_dot_0 / rate * np.sinh(rate * t)
        r_dot = at.r_0 * rate * np.sinh(rate * t) + at.r_dot_0 * np.cosh(rate * t)
        return {"r": r, "r_dot": r_dot, "turn_force": 2 * at.mass * r * r_dot * rate}
