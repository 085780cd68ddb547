"""The cat in space: two halves with head, ears, legs and tail."""

from typing import Any

import casadi as ca

from liaisons.language import Ball, Rod, Shapes, turned


def picture(self: Any) -> Shapes:
    """Shapes of the cat in space."""
    A = ca.SX([0, 0, 1])  # axis of half A in its own frame
    d, R, (axis, _) = self.joint_distance, self.attitude.matrix, self._half_B()
    B = turned("z", self.azimuth) @ turned("x", self.bend) @ turned("z", self.twist - self.azimuth)

    def position(from_joint: ca.SX) -> dict[str, ca.SX]:
        """Position of a point, from its vector from the joint in units of d and the frame of A."""
        x, y, z = ca.vertsplit(R @ (d * from_joint + d / 2 * (A - axis)))
        return {"x": self.com_x + x, "y": self.com_y + y, "z": self.com_z + z}

    joint, end_A, end_B = position(ca.SX.zeros(3)), position(-2 * A), position(2 * axis)
    tips = [(B @ ca.SX([-0.35, side, 0]), B @ ca.SX([-0.7, 2 * side, 0])) for side in (-0.2, 0.2)]
    ears = [Rod(*(position(2 * axis + end) for end in ends), radius=0.08 * d) for ends in tips]
    tail = Rod(end_A, position(-3 * A + ca.SX([-0.8, 0, 0])), radius=0.08 * d)
    legs = [
        Rod(position(hip * half), position(hip * half + frame @ ca.SX([1, side, 0])), radius=0.08 * d)
        for half, frame in ((-A, ca.SX.eye(3)), (axis, B))
        for hip in (0.6, 1.6)
        for side in (-0.4, 0.4)
    ]
    halves = [Rod(joint, end, radius=0.4 * d) for end in (end_A, end_B)]
    return [*halves, Ball(end_B, radius=0.5 * d), *legs, *ears, tail]
