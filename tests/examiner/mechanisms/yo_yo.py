"""A yo-yo whose thread a hand moves."""

from __future__ import annotations

import casadi as ca
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Gravity, Mechanism, Parameter, Values, closed_form


class YoYo(Mechanism):
    """Disc that unwinds from a thread whose upper end an operator holds at the height h.

    s is the length of thread that is unwound, r the radius on which it is wound: z = h - s and
    m (s'' - h'') + J s''/r² = m g.  Source: D. Morin, Introduction to Classical Mechanics, 8.7, the hand added.
    """

    mass = Parameter(0.1, "kg", "mass of the disc", above=0)
    inertia = Parameter(5e-5, "kg.m2", "moment of inertia of the disc", above=0, symbol="J")
    radius = Parameter(0.01, "m", "radius on which the thread is wound", above=0, symbol="r")
    gravity = Gravity()
    s = Coordinate("m", "length of thread that is unwound", start=0.1)
    hand = ActiveCoordinate("m", "height of the hand", start=1.0, symbol="h")
    experiment = Experiment(reference={"hand_dot": 0.2})

    def kinetic_energy(self) -> ca.SX:
        fall = self.mass / 2 * self.dot(self.hand - self.s) ** 2
        return fall + self.inertia / 2 * (self.dot(self.s) / self.radius) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * (self.hand - self.s)

    @closed_form("the way while the hand moves evenly")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        wound = at.inertia / at.radius**2
        acceleration = at.mass * at.gravity / (at.mass + wound)
        s = at.s_0 + at.s_dot_0 * t + acceleration / 2 * t**2
        return {"s": s, "hand_force": at.mass * (at.gravity - acceleration) + 0 * t * at.hand_dot}
