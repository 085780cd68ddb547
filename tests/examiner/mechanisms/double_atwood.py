"""Atwood's machine whose one mass is another such machine."""

from __future__ import annotations

import casadi as ca
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form


class DoubleAtwood(Mechanism):
    """Mass m_1 against a massless pulley that carries m_2 and m_3.

    x is the way of m_1 downwards, y that of m_2 downwards from its pulley::

        m_1 x'' + m_2 (x'' - y'') + m_3 (x'' + y'') = (m_1 - m_2 - m_3) g
        m_2 (y'' - x'') + m_3 (y'' + x'') = (m_2 - m_3) g

    Source: D. Morin, Introduction to Classical Mechanics, problem 6.2.
    """

    mass_1 = Parameter(4.0, "kg", "mass on the fixed pulley", above=0, symbol="m_1")
    mass_2 = Parameter(2.0, "kg", "first mass on the other pulley", above=0, symbol="m_2")
    mass_3 = Parameter(1.0, "kg", "second mass on the other pulley", above=0, symbol="m_3")
    gravity = Gravity()
    x = Coordinate("m", "way of the first mass downwards")
    y = Coordinate("m", "way of the second mass downwards from its pulley", start_rate=0.2)

    def kinetic_energy(self) -> ca.SX:
        first = self.mass_1 / 2 * self.dot(self.x) ** 2
        second = self.mass_2 / 2 * self.dot(self.y - self.x) ** 2
        return first + second + self.mass_3 / 2 * self.dot(self.y + self.x) ** 2

    def potential_energy(self) -> ca.SX:
        ways = self.mass_1 * self.x + self.mass_2 * (self.y - self.x) - self.mass_3 * (self.x + self.y)
        return -self.gravity * ways

    @closed_form("all at constant accelerations")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        m_1, m_2, m_3 = at.mass_1, at.mass_2, at.mass_3
        product = 4 * m_2 * m_3 + m_1 * (m_2 + m_3)
        first = (m_1 * (m_2 + m_3) - 4 * m_2 * m_3) / product * at.gravity
        second = 2 * m_1 * (m_2 - m_3) / product * at.gravity
        x = at.x_0 + at.x_dot_0 * t + first / 2 * t**2
        return {"x": x, "y": at.y_0 + at.y_dot_0 * t + second / 2 * t**2}
