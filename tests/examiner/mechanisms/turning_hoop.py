"""A bead on a vertical hoop that turns about its vertical diameter."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Gravity, Mechanism, Parameter, Values, closed_form, point


class TurningHoop(Mechanism):
    """Bead on a hoop which an operator turns about its vertical diameter.

    R θ'' = R φ'² sin θ cos θ - g sin θ: above φ'² = g/R it rests at cos θ = g/(R φ'²).
    Source: J. R. Taylor, Classical Mechanics, example 7.6.
    """

    mass = Parameter(0.1, "kg", "mass of the bead", above=0)
    radius = Parameter(0.5, "m", "radius of the hoop", above=0, symbol="R")
    gravity = Gravity()
    theta = Coordinate("rad", "angle from the lowest point", start=float(np.arccos(9.81 / (0.5 * 36.0))))
    turn = ActiveCoordinate("rad", "angle of the hoop", symbol="φ")
    experiment = Experiment(reference={"turn_dot": 6.0})

    @point("m", "the bead")
    def bead(self) -> dict[str, ca.SX]:
        distance = self.radius * ca.sin(self.theta)
        height = -self.radius * ca.cos(self.theta)
        return {"x": distance * ca.cos(self.turn), "y": distance * ca.sin(self.turn), "z": height}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bead)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bead["z"]

    @closed_form("rest at the angle where gravity and the centrifugal force agree", theta_dot_0="== 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        cosine = at.gravity / (at.radius * at.turn_dot**2)
        at.require(abs(np.cos(at.theta_0) - cosine) < 1e-12, "theta_0 must be the angle of rest")
        return {"theta": at.theta_0 + 0 * t, "turn_force": 0 * t}
