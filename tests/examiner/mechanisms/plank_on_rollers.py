"""A plank on two rollers that turn against each other."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form


class PlankOnRollers(Mechanism):
    """Plank on two rollers at the distance 2 a that turn inwards fast: friction swings it, m x'' = -μ m g x/a.

    Dry friction that always slides is a force of constant coefficient here, and has a potential.
    Source: J. P. Den Hartog, Mechanical Vibrations, problem 51.
    """

    mass = Parameter(5.0, "kg", "mass of the plank", above=0)
    coefficient = Parameter(0.3, "1", "coefficient of sliding friction", above=0, symbol="μ")
    half = Parameter(0.5, "m", "half of the distance between the rollers", above=0, symbol="a")
    gravity = Gravity()
    x = Coordinate("m", "position of the plank's centre from the middle", start=0.2, start_rate=-0.1)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.coefficient * self.mass * self.gravity / (2 * self.half) * self.x**2

    @closed_form("the harmonic swing while both rollers slide", gravity="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega = np.sqrt(at.coefficient * at.gravity / at.half)
        return {"x": at.x_0 * np.cos(omega * t) + at.x_dot_0 / omega * np.sin(omega * t)}
