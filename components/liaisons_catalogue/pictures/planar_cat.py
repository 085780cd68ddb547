"""The plane cat: trunk, head, tail and legs."""

from typing import Any

import casadi as ca

from liaisons.language import Ball, Rod, Shapes, turned


def picture(self: Any) -> Shapes:
    """Shapes of the plane cat."""
    h, (_, _, x, z, *_) = self.hinge, next(self._bodies)

    def point(hinge: Any, along: Any = 0.0, up: Any = 0.0, psi: Any = 0.0) -> dict[str, ca.SX]:
        """Position of a point of a body that is turned by psi about a hinge."""
        r = turned("y", -self.phi) @ (ca.vertcat(x + hinge, 0, z) + turned("y", -psi) @ ca.vertcat(along, 0, up))
        return {"x": self.com_x + r[0], "z": self.com_z + r[2]}

    head, tail = point(h, c := 2 * self.arm_1, 0.0, self.psi_1), point(-h, -2 * self.arm_2, 0.0, self.psi_2)
    trunk = [
        Rod(point(-h), point(h), 0.3 * h),
        Rod(point(h), head, 0.25 * h),
        Rod(point(-h), tail, 0.1 * h),
    ]
    rest = [Ball(head, 0.4 * h), *(Rod(point(a * h), point(a * h, 0, -h), 0.1 * h) for a in (-0.8, 0.8))]
    return [*trunk, *(Rod(head, point(h, c + a * h, 0.6 * h, self.psi_1), 0.1 * h) for a in (-0.3, 0.3)), *rest]
