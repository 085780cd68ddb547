"""A puck that slides freely over a turntable."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, Values, closed_form, point


class PuckOnTurntable(Mechanism):
    """Puck without friction on a table that an operator turns by φ; r, θ are polar coordinates in the table.

    Seen from outside it moves straight.  Source: J. R. Taylor, Classical Mechanics, 9.5 and problem 9.24.
    """

    mass = Parameter(0.2, "kg", "mass of the puck", above=0)
    r = Coordinate("m", "distance from the centre", start=1.0, start_rate=-0.2, above=0)
    theta = Coordinate("rad", "azimuth in the table")
    turn = ActiveCoordinate("rad", "angle of the table", symbol="φ")
    experiment = Experiment(reference={"turn_dot": 0.9})

    @point("m", "the puck")
    def puck(self) -> dict[str, ca.SX]:
        azimuth = self.theta + self.turn
        return {"x": self.r * ca.cos(azimuth), "y": self.r * ca.sin(azimuth)}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.puck)

    @closed_form("the straight line, seen from a table that turns evenly")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rate = at.theta_dot_0 + at.turn_dot
        line = at.r_0 + (at.r_dot_0 + 1j * at.r_0 * rate) * t
        return {"r": np.abs(line), "theta": at.theta_0 + np.unwrap(np.angle(line)) - at.turn_dot * t}
