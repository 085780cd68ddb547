"""The bead on an elliptic hoop that turns about any point inside it."""

import casadi as ca
import numpy as np

from liaisons.language import Coordinate, Parameter, assertion, calculated, output
from liaisons_catalogue.parametrised_hoop import ParametrisedHoop

# Landen steps: errors of 1e-14 for ratios of the axes up to a million.
_LANDEN_STEPS = 7


class EllipticHoop(ParametrisedHoop):
    """Bead on an elliptic hoop that an operator turns, in a horizontal plane, about a point O inside it.

    In the frame of the hoop, with O at the origin and OA as first axis, the eccentric anomaly u gives the point::

        OP = (c_x + a cos u, c_y + b sin u),    dξ/du = √(a² sin² u + b² cos² u)

    ξ [m] is the arc length from A, an elliptic integral of the second kind.  With r = |OP|, θ = (OA, OP), the
    tangential part α = r²θ' and γ = r²r'² = r² - α² (' = d/dξ), the motion is that of M eq. 64::

        ξ_dot = p_ξ/m - α β_dot,    p_ξ_dot = α' p_ξ β_dot + ½ m γ' β_dot²
        constant β_dot:    ½ ξ_dot² - ½ β_dot² r² is constant (Jacobi)
        a slow full turn that starts and stops smoothly:    ξ falls behind by 4π area/length (Hannay, Berry)

    Source: M 8.4, eq. 61-67.
    """

    semi_axis_a = Parameter(2.0, "m", "semi-axis along OA", above=0, symbol="a")
    semi_axis_b = Parameter(1.0, "m", "semi-axis across OA", above=0, symbol="b")
    centre_x = Parameter(0.0, "m", "position of the centre along OA", symbol="c_x")
    centre_y = Parameter(0.0, "m", "position of the centre to the left of OA", symbol="c_y")
    u = Coordinate("rad", "eccentric anomaly of the bead, counter-clockwise from OA", start_rate=1.0)

    @assertion("O must lie inside the hoop: (centre_x/semi_axis_a)² + (centre_y/semi_axis_b)² < 1")
    def star_shaped(self) -> ca.SX:
        """Positive where O lies inside: an ellipse is star-shaped about each point inside."""
        return 1 - (self.centre_x / self.semi_axis_a) ** 2 - (self.centre_y / self.semi_axis_b) ** 2

    def curve(self, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        return self.centre_x + self.semi_axis_a * ca.cos(u), self.centre_y + self.semi_axis_b * ca.sin(u)

    @property
    def _u_at_A(self) -> ca.SX:  # noqa: N802
        return -ca.asin(self.centre_y / self.semi_axis_b)

    def _arc_length(self, u: ca.SX) -> ca.SX:
        """Arc length from u = 0, an incomplete elliptic integral of the second kind, by Landen's transformation.

        Each step takes the semi-axes to their means and about doubles the angle, until the ellipse is a circle.  In
        this form it holds for either order of the axes and any number of turns.
        """
        p, q = self.semi_axis_b, self.semi_axis_a
        square, angle, periodic = (p**2 + q**2) / 2, u, ca.SX(0)
        for step in range(_LANDEN_STEPS):
            sine, cosine = ca.sin(angle), ca.cos(angle)
            angle = 2 * angle - ca.atan2((p - q) * sine * cosine, p * cosine**2 + q * sine**2)
            p, q, c = (p + q) / 2, ca.sqrt(p * q), (p - q) / 2
            square -= 2**step * c**2
            periodic += c * ca.sin(angle)
        return square * angle / (2**_LANDEN_STEPS * p) + periodic

    @calculated("m", "length of the hoop")
    def hoop_length(self) -> ca.SX:
        return self._arc_length(ca.SX(2 * np.pi))

    @calculated("m2", "area inside the hoop")
    def hoop_area(self) -> ca.SX:
        return np.pi * self.semi_axis_a * self.semi_axis_b

    @output("rad", "polar angle of the bead as seen from O, relative to OA, not wrapped")
    def theta(self) -> ca.SX:
        return self._polar_angle(self.u)

    from liaisons_catalogue.solutions.elliptic_hoop import exact, slow_turn
