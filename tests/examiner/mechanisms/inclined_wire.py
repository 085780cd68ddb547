"""A bead on an inclined wire that turns about the vertical."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Gravity, Mechanism, Parameter, Values, closed_form, point


class InclinedWire(Mechanism):
    """Bead on a straight wire at the angle α from the vertical, which an operator turns about the vertical.

    r'' = r φ'² sin² α - g cos α.  Source: L. N. Hand, J. D. Finch, Analytical Mechanics, 1.8.
    """

    mass = Parameter(0.3, "kg", "mass of the bead", above=0)
    angle = Parameter(0.8, "rad", "angle of the wire from the vertical", above=0, below=1.5, symbol="α")
    gravity = Gravity()
    r = Coordinate("m", "distance along the wire from the axis", start=1.0)
    turn = ActiveCoordinate("rad", "azimuth of the wire", symbol="φ")
    experiment = Experiment(reference={"turn_dot": 2.0})

    @point("m", "the bead")
    def bead(self) -> dict[str, ca.SX]:
        across, up = self.r * ca.sin(self.angle), self.r * ca.cos(self.angle)
        return {"x": across * ca.cos(self.turn), "y": across * ca.sin(self.turn), "z": up}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bead)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bead["z"]

    @closed_form("the motion at constant rate", turn_dot="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rate = at.turn_dot * np.sin(at.angle)
        rest = at.gravity * np.cos(at.angle) / rate**2
        r = rest + (at.r_0 - rest) * np.cosh(rate * t) + at.r_dot_0 / rate * np.sinh(rate * t)
        return {"r": r}
