"""A rotor with a motor's torque and a viscous brake."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class DampedRotor(Mechanism):
    """Rotor on a shaft: J φ'' = τ - c φ'."""

    inertia = Parameter(0.3, "kg.m2", "moment of inertia", above=0, symbol="J")
    brake = Parameter(0.15, "N.m.s/rad", "coefficient of the brake", above=0, symbol="c")
    angle = Coordinate("rad", "angle of the rotor", start_rate=4.0, symbol="φ")

    def kinetic_energy(self) -> ca.SX:
        return self.inertia / 2 * self.dot(self.angle) ** 2

    def dissipation_function(self) -> ca.SX:
        return self.brake / 2 * self.dot(self.angle) ** 2

    @closed_form("the approach to the rate at which brake and torque agree")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        last, rate = at.angle_force / at.brake, at.brake / at.inertia
        angle = at.angle_0 + last * t - (at.angle_dot_0 - last) / rate * np.expm1(-rate * t)
        return {"angle": angle, "angle_dot": last + (at.angle_dot_0 - last) * np.exp(-rate * t)}
