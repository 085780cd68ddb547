"""Two wheels with teeth and a brake."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class GearPair(Mechanism):
    """Two toothed wheels of radii r_1, r_2: r_1 φ_1 = -r_2 φ_2; a viscous brake c on the second.

    (I_1 + n² I_2) φ_1'' = τ - n² c φ_1',  n = r_1/r_2.
    Source: J. P. Den Hartog, Mechanical Vibrations, 1.7, geared systems.
    """

    inertia_1 = Parameter(0.02, "kg.m2", "moment of inertia of the first wheel", above=0, symbol="I_1")
    inertia_2 = Parameter(0.5, "kg.m2", "moment of inertia of the second wheel", above=0, symbol="I_2")
    radius_1 = Parameter(0.05, "m", "radius of the first wheel", above=0, symbol="r_1")
    radius_2 = Parameter(0.2, "m", "radius of the second wheel", above=0, symbol="r_2")
    brake = Parameter(0.3, "N.m.s/rad", "coefficient of the brake on the second wheel", above=0, symbol="c")
    angle = Coordinate("rad", "angle of the first wheel", start_rate=10.0, symbol="φ_1")

    def _second(self) -> ca.SX:
        return -self.radius_1 / self.radius_2 * self.angle

    def kinetic_energy(self) -> ca.SX:
        first = self.inertia_1 / 2 * self.dot(self.angle) ** 2
        return first + self.inertia_2 / 2 * self.dot(self._second()) ** 2

    def dissipation_function(self) -> ca.SX:
        return self.brake / 2 * self.dot(self._second()) ** 2

    @closed_form("the run-down under a constant torque")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        n = at.radius_1 / at.radius_2
        inertia, drag = at.inertia_1 + n**2 * at.inertia_2, n**2 * at.brake
        last, decay = at.angle_force / drag, -np.expm1(-drag / inertia * t) * inertia / drag
        return {"angle": at.angle_0 + last * t + (at.angle_dot_0 - last) * decay}
