"""The child on its swing."""

from typing import Any

import casadi as ca

from liaisons.language import Ball, Box, Rod, Shapes, turned


def picture(self: Any) -> Shapes:
    """Shapes of rope, board, legs and torso."""
    x, z, s, c = self.seat["x"], self.seat["z"], ca.sin(self.theta), ca.cos(self.theta)
    knee, foot = ({"x": x - 0.4 * c + l * s, "z": z - 0.4 * s - l * c} for l in (0, 0.4))  # noqa: E741
    board = Box(self.seat, turned("y", -self.theta), (0.5, 0.3, 0.05))
    legs = [Rod(self.seat, knee, radius=0.06), Rod(knee, foot, radius=0.05)]
    child = [Rod(self.seat, self.torso, radius=0.08), *legs, Ball(self.torso, radius=0.14)]
    return [Rod({}, self.seat), board, *child]
