"""The bead on a circular hoop that turns about a point off its centre."""

import casadi as ca
import numpy as np

from liaisons.language import Coordinate, Parameter, assertion, calculated, output
from liaisons_catalogue.hoop import Hoop


class CircularHoop(Hoop):
    """Bead on a circular hoop that an operator turns, in a horizontal plane, about a point O inside it.

    The centre lies on the axis OA at distance d from O; ξ is the arc length from A, ψ = ξ/R.  With r = |OP|, its
    tangential part a = r²θ' = R + d cos ψ and b = r²r'² = r² - a² = d² sin² ψ (' = d/dξ)::

        L = ½ m (r'² ξ_dot² + r² (θ' ξ_dot + β_dot)²) + ½ I β_dot²            M eq. 61, with dots missing there
        ξ_dot = p_ξ/m - a β_dot,    p_ξ_dot = a' p_ξ β_dot + ½ m b' β_dot²    M eq. 64
        constant β_dot:    ψ_ddot = -(d/R) β_dot² sin ψ, a pendulum

    Source: M 8.4, eq. 61-67.
    """

    radius = Parameter(1.0, "m", "radius of the hoop", above=0)
    offset = Parameter(0.5, "m", "distance from O to the centre of the hoop", minimum=0, symbol="d")
    xi = Coordinate("m", "arc length of the bead from A, counter-clockwise", start_rate=1.0)

    @assertion("O must lie inside the hoop: offset < radius")
    def inside(self) -> ca.SX:
        return self.radius - self.offset

    once_round = property(lambda self: 2 * np.pi * self.radius)

    def curve(self, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        psi = u / self.radius
        return self.offset + self.radius * ca.cos(psi), self.radius * ca.sin(psi)

    def _speed(self, u: ca.SX) -> ca.SX:  # noqa: ARG002 - the same everywhere: ξ is the arc length
        return ca.SX(1)

    def _moment_of_rate(self, u: ca.SX) -> ca.SX:
        return self.radius + self.offset * ca.cos(u / self.radius)

    def _r_squared(self, u: ca.SX) -> ca.SX:
        R, d = self.radius, self.offset
        return R**2 + d**2 + 2 * R * d * ca.cos(u / R)

    @output("rad", "polar angle of the bead as seen from O, relative to OA, not wrapped")
    def theta(self) -> ca.SX:
        return self._polar_angle(self.xi / self.radius)

    @calculated("m", "length of the hoop")
    def hoop_length(self) -> ca.SX:
        return 2 * np.pi * self.radius

    @calculated("m2", "area inside the hoop")
    def hoop_area(self) -> ca.SX:
        return np.pi * self.radius**2

    from liaisons_catalogue.solutions.circular_hoop import dynamic_field, exact, on_a_free_shaft, slow_turn
