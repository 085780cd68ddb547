"""A load on an elastic rope that a winch pulls up."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Gravity, Mechanism, Parameter, Values, closed_form


class Winch(Mechanism):
    """Load on an elastic rope whose upper end a winch lifts to w: m z'' = k (w - z) - c (z' - w') - m g.

    z is the height of the load, counted so that the rope is slack at z = w.
    """

    mass = Parameter(100.0, "kg", "mass of the load", above=0)
    stiffness = Parameter(2e4, "N/m", "stiffness of the rope", above=0, symbol="k")
    damping = Parameter(200.0, "N.s/m", "damping of the rope", minimum=0, symbol="c")
    gravity = Gravity()
    z = Coordinate("m", "height of the load", start=-0.05)
    winch = ActiveCoordinate("m", "height of the rope's upper end", symbol="w")
    experiment = Experiment(reference={"winch_dot": 0.5})

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.z) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.winch - self.z) ** 2 + self.mass * self.gravity * self.z

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * self.dot(self.winch - self.z) ** 2

    @closed_form("the lift at an even rate")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        beta = at.damping / (2 * at.mass)
        omega = np.sqrt(at.stiffness / at.mass - beta**2)
        rest = -at.mass * at.gravity / at.stiffness
        start, rate = at.z_0 - at.winch - rest, at.z_dot_0 - at.winch_dot
        swing = np.exp(-beta * t) * (start * np.cos(omega * t) + (rate + beta * start) / omega * np.sin(omega * t))
        return {"z": at.winch + at.winch_dot * t + rest + swing}
