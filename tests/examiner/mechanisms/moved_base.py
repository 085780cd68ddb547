"""A mass on a spring and a damper whose base is moved."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, Values, closed_form


class MovedBase(Mechanism):
    """Mass on a spring and a damper that stand on a base, which an operator moves: m x'' = -k (x - b) - c (x' - b').

    Source: J. P. Den Hartog, Mechanical Vibrations, 2.6; here the base moves evenly.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(25.0, "N/m", "stiffness of the spring", above=0, symbol="k")
    damping = Parameter(1.0, "N.s/m", "coefficient of the damper", minimum=0, symbol="c")
    x = Coordinate("m", "position of the mass", start=0.1)
    base = ActiveCoordinate("m", "position of the base", symbol="b")
    experiment = Experiment(reference={"base_dot": 0.5})

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.x - self.base) ** 2

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * self.dot(self.x - self.base) ** 2

    @closed_form("the damped oscillation on a base that moves evenly, and the force that moves it")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        beta = at.damping / (2 * at.mass)
        omega = np.sqrt(at.stiffness / at.mass - beta**2)
        start, rate = at.x_0 - at.base, at.x_dot_0 - at.base_dot
        sine, cosine, decay = np.sin(omega * t), np.cos(omega * t), np.exp(-beta * t)
        stretch = decay * (start * cosine + (rate + beta * start) / omega * sine)
        stretch_dot = decay * (rate * cosine - (beta * rate + start * (omega**2 + beta**2)) / omega * sine)
        force = -at.stiffness * stretch - at.damping * stretch_dot
        return {"x": at.base + at.base_dot * t + stretch, "base_force": force}
