"""A block on an oiled belt."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, Values, closed_form


class BeltDrag(Mechanism):
    """Block on a film of oil on a belt that an operator moves: m x'' = -c (x' - b')."""

    mass = Parameter(0.5, "kg", "mass of the block", above=0)
    drag = Parameter(0.8, "N.s/m", "coefficient of the film", above=0, symbol="c")
    x = Coordinate("m", "position of the block")
    belt = ActiveCoordinate("m", "position of the belt", symbol="b")
    experiment = Experiment(reference={"belt_dot": 1.2})

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def dissipation_function(self) -> ca.SX:
        return self.drag / 2 * self.dot(self.x - self.belt) ** 2

    @closed_form("the block that is carried along by an even belt")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rate = at.drag / at.mass
        slip = (at.x_dot_0 - at.belt_dot) * np.exp(-rate * t)
        x = at.x_0 + at.belt_dot * t - (at.x_dot_0 - at.belt_dot) / rate * np.expm1(-rate * t)
        return {"x": x, "belt_force": -at.drag * slip}
