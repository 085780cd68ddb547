"""The satellite with two wheels, from its kinetic energy."""

from typing import Any

import casadi as ca

from liaisons import plan
from liaisons.language import ActiveCoordinate, Mechanism, Orientation, Parameter


class Satellite(Mechanism):
    """A body that two wheels turn."""

    J = Parameter(10.0, "kg.m2", "moment of inertia, wheels locked")
    J_wheel = Parameter(0.1, "kg.m2", "moment of inertia of a wheel")
    attitude = Orientation("attitude of the body")
    wheel_1 = ActiveCoordinate("rad", "angle of the wheel along x")
    wheel_2 = ActiveCoordinate("rad", "angle of the wheel along y")

    def kinetic_energy(self) -> ca.SX:
        omega, wheels = self.attitude.rate, self.dot(ca.vertcat(self.wheel_1, self.wheel_2))
        return self.J / 2 * ca.sumsqr(omega) + self.J_wheel * (ca.dot(omega[:2], wheels) + ca.sumsqr(wheels) / 2)


def solve(intervals: int) -> float:
    """∫ ½ φ'·Θφ' dt."""
    goal: Any = {"end": {"attitude": (0, 0, 0, 1)}, "duration": 2.0}
    return plan(Satellite, intervals=intervals, accuracy=None, **goal).cost
