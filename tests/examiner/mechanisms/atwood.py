"""Atwood's machine."""

from __future__ import annotations

import casadi as ca
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form


class Atwood(Mechanism):
    """Two masses on a rope over a heavy pulley: (m_1 + m_2 + I/R²) x'' = (m_1 - m_2) g.

    x is the way of the first mass downwards.  Source: H. Goldstein, Classical Mechanics, 1.6, with a heavy pulley.
    """

    mass_1 = Parameter(1.5, "kg", "first mass", above=0, symbol="m_1")
    mass_2 = Parameter(1.0, "kg", "second mass", above=0, symbol="m_2")
    inertia = Parameter(0.02, "kg.m2", "moment of inertia of the pulley", minimum=0, symbol="I")
    radius = Parameter(0.2, "m", "radius of the pulley", above=0, symbol="R")
    gravity = Gravity()
    x = Coordinate("m", "way of the first mass downwards", start_rate=-0.5)

    def kinetic_energy(self) -> ca.SX:
        masses = (self.mass_1 + self.mass_2) / 2 * self.dot(self.x) ** 2
        return masses + self.inertia / 2 * (self.dot(self.x) / self.radius) ** 2

    def potential_energy(self) -> ca.SX:
        return (self.mass_2 - self.mass_1) * self.gravity * self.x

    @closed_form("the motion at constant acceleration")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        inertia = at.mass_1 + at.mass_2 + at.inertia / at.radius**2
        acceleration = (at.mass_1 - at.mass_2) * at.gravity / inertia
        return {"x": at.x_0 + at.x_dot_0 * t + acceleration / 2 * t**2}
