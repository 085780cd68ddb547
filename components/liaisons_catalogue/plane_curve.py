"""Base class of motions on a closed plane curve about a point O."""

from abc import abstractmethod
from typing import Any

import casadi as ca

from liaisons.language import Mechanism


class PlaneCurve(Mechanism, abstract=True):
    """Motion on a closed curve OP(u), which a subclass gives by :meth:`curve`; abstract.

    ξ is the arc length, r = |OP|, θ the direction of OP from the axis OA.
    """

    once_round: Any  # what u grows by in one turn

    @abstractmethod
    def curve(self, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Components of OP along the axis OA and to its left [m]; u grows counter-clockwise."""

    def _rates(self, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Components of dOP/du [m]."""
        v = ca.SX.sym("v")
        along, left = (ca.substitute(ca.jacobian(component, v), v, u) for component in self.curve(v))
        return along, left

    def _speed(self, u: ca.SX) -> ca.SX:
        """Speed dξ/du = |dOP/du| [m]."""
        x, y = self._rates(u)
        return ca.sqrt(x**2 + y**2)

    def _moment_of_rate(self, u: ca.SX) -> ca.SX:
        """Moment of dOP/du about O, r² dθ/du [m2], positive where OP turns counter-clockwise."""
        (x, y), (x_rate, y_rate) = self.curve(u), self._rates(u)
        return x * y_rate - y * x_rate

    def _r_squared(self, u: ca.SX) -> ca.SX:
        """Square of the distance from O, r² [m2]."""
        return ca.SX(sum(component**2 for component in self.curve(u)))

    def _polar_angle(self, near: ca.SX) -> ca.SX:
        """Polar angle of OP, not wrapped: that within π of an angle, which must not be opposite to it."""
        (x, y), cosine, sine = self.curve(self.free.q), ca.cos(near), ca.sin(near)
        return near + ca.atan2(y * cosine - x * sine, x * cosine + y * sine)
