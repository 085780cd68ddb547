"""A mass on springs on a turntable."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, Values, closed_form, point


class TurntableOscillator(Mechanism):
    """Mass held to the centre of a turntable by springs; x, y are fixed in the table, which an operator turns by φ.

    Seen from outside its path is an ellipse, as that of Foucault's pendulum.
    Source: V. I. Arnold, Mathematical Methods of Classical Mechanics, 27.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(16.0, "N/m", "stiffness of the springs", above=0, symbol="k")
    x = Coordinate("m", "position in the table", start=0.5)
    y = Coordinate("m", "position in the table, across")
    turn = ActiveCoordinate("rad", "angle of the table", symbol="φ")
    experiment = Experiment(reference={"turn_dot": 0.7})

    @point("m", "the mass")
    def place(self) -> dict[str, ca.SX]:
        sine, cosine = ca.sin(self.turn), ca.cos(self.turn)
        return {"x": self.x * cosine - self.y * sine, "y": self.x * sine + self.y * cosine}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.place)

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.x**2 + self.y**2)

    @closed_form("the ellipse, seen from a table that turns evenly")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega = np.sqrt(at.stiffness / at.mass)
        start = at.x_0 + 1j * at.y_0
        rate = at.x_dot_0 + 1j * at.y_dot_0 + 1j * at.turn_dot * start
        outside = start * np.cos(omega * t) + rate / omega * np.sin(omega * t)
        inside = outside * np.exp(-1j * at.turn_dot * t)
        return {"x": inside.real, "y": inside.imag}
