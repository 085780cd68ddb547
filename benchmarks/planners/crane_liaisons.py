"""The crane, from its energies."""

from typing import Any

import casadi as ca

from liaisons import plan
from liaisons.language import ActiveCoordinate, Coordinate, Gravity, Mechanism, Parameter, point


class Crane(Mechanism):
    """A load on a rope at a trolley."""

    mass = Parameter(1.0, "kg", "mass of the load")
    rope = Parameter(2.0, "m", "its length")
    gravity = Gravity()
    angle = Coordinate("rad", "angle of the rope")
    trolley = ActiveCoordinate("m", "position of the trolley")

    @point("m", "the load")
    def load(self) -> dict[str, ca.SX]:
        return {"x": self.trolley + self.rope * ca.sin(self.angle), "z": -self.rope * ca.cos(self.angle)}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.load)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.load["z"]


def solve(intervals: int) -> float:
    """∫ a² dt of the trolley."""
    end = {"trolley": 0.8, "trolley_dot": 0, "angle": 0, "angle_dot": 0}
    goal: Any = {"start": {"angle": 0}, "end": end, "duration": 3.0, "minimize": "trolley_ddot**2"}
    return plan(Crane, intervals=intervals, accuracy=None, **goal).cost
