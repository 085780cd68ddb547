"""A plane isotropic oscillator in polar coordinates."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class IsotropicOscillator(Mechanism):
    """Mass on a spring of no length, in polar coordinates: its path is an ellipse about the centre.

    Source: V. I. Arnold, Mathematical Methods of Classical Mechanics, 8.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(9.0, "N/m", "stiffness", above=0, symbol="k")
    r = Coordinate("m", "distance from the centre", start=1.0, above=0)
    phi = Coordinate("rad", "azimuth", start_rate=1.2)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.r) ** 2 + self.r**2 * self.dot(self.phi) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.r**2

    @closed_form("the ellipse from one of its apses", r_dot_0="== 0", phi_dot_0="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega = np.sqrt(at.stiffness / at.mass)
        along, across = at.r_0 * np.cos(omega * t), at.r_0 * at.phi_dot_0 / omega * np.sin(omega * t)
        return {"r": np.hypot(along, across), "phi": at.phi_0 + np.unwrap(np.arctan2(across, along))}
