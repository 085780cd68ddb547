"""Base class of hoops: a bead on a closed plane curve that an operator turns about a point O inside it."""

import casadi as ca

from liaisons.language import ActiveCoordinate, Ball, Experiment, Parameter, Rod, Shapes, Wire, output, point
from liaisons_catalogue.plane_curve import PlaneCurve


class Hoop(PlaneCurve, abstract=True):
    """Bead on a hoop that an operator turns, in a horizontal plane, about a point O inside it; abstract.

    A subclass declares one coordinate, u, and gives the :meth:`curve` on which u places the bead P.  OA is an axis
    fixed in the hoop, ξ the arc length, r = |OP|, θ the angle from OA to OP, and ' = d/dξ.  If the hoop turns at unit
    rate, its velocity at P has the tangential part a = r²θ'; its normal part has the square b = r²r'² = r² - a²::

        L = ½ m (r'² ξ_dot² + r² (θ' ξ_dot + β_dot)²) + ½ I β_dot²            M eq. 61, with dots missing there
          = ½ m (ξ_dot² + 2 a ξ_dot β_dot + r² β_dot²) + ½ I β_dot²
        ξ_dot = p_ξ/m - a β_dot,    p_ξ_dot = a' p_ξ β_dot + ½ m b' β_dot²    M eq. 64
        K_Y = ½ (I + m b) Y²                                                  M eq. 63

    β is the angle of OA.  The moment of inertia I enters only the operator's torque.

    Source: M 8.4, eq. 61-67.
    """

    mass = Parameter(1.0, "kg", "mass of the bead", above=0)
    hoop_inertia = Parameter(0.1, "kg.m2", "moment of inertia of the hoop about O", minimum=0, symbol="I")
    beta = ActiveCoordinate("rad", "angle of the axis OA in the fixed frame")
    experiment = Experiment(reference={"beta_dot": 1.0, "beta_ddot": 0.2})
    _a = property(lambda self: self._moment_of_rate(self.free.q) / self._speed(self.free.q))  # r²θ' at the bead
    _xi_dot = property(lambda self: self._speed(self.free.q) * self.free.q_dot)

    @property
    def _r_r_dash(self) -> ca.SX:
        """Product r dr/dξ at the bead [m], with r the distance from O."""
        return ca.jacobian(self._r_squared(self.free.q), self.free.q) / (2 * self._speed(self.free.q))

    def _fixed_point(self, u: ca.SX) -> dict[str, ca.SX]:
        """Point of the hoop at the coordinate u, by axes of the fixed frame."""
        (x, y), cosine, sine = self.curve(u), ca.cos(self.beta), ca.sin(self.beta)
        return {"x": x * cosine - y * sine, "y": x * sine + y * cosine}

    @point("m", "the bead, in the fixed frame")
    def bead(self) -> dict[str, ca.SX]:
        return self._fixed_point(self.free.q)

    def picture(self) -> Shapes:
        hoop = [self._fixed_point(self.once_round * k / 48) for k in range(48)]
        return [Wire(hoop, closed=True), Rod({}, hoop[0]), Ball(self.bead)]

    def kinetic_energy(self) -> ca.SX:
        u, u_dot, beta_dot = self.free.q, self.free.q_dot, self.dot(self.beta)
        bead = self._xi_dot**2 + 2 * self._moment_of_rate(u) * u_dot * beta_dot + self._r_squared(u) * beta_dot**2
        return self.mass / 2 * bead + self.hoop_inertia / 2 * beta_dot**2

    @output("J", "K_Y of M eq. 63 with Y = beta_dot: kinetic energy of the hoop and of the bead's normal velocity")
    def K_Y(self) -> ca.SX:  # noqa: N802
        return (self.hoop_inertia + self.mass * self._r_r_dash**2) / 2 * self.dot(self.beta) ** 2

    @output("N", "force on the bead along the left normal, exerted by the hoop and by a load if there is one")
    def normal_force(self) -> ca.SX:
        """Mass times the sum of relative, Coriolis, centripetal and Euler's acceleration across the hoop."""
        u, rate, beta_dot = self.free.q, self._xi_dot, self.dot(self.beta)
        x, y = self._rates(u)
        curvature = (x * ca.jacobian(y, u) - y * ca.jacobian(x, u)) / self._speed(u) ** 3
        relative = curvature * rate**2 + 2 * rate * beta_dot
        return self.mass * (relative + self._a * beta_dot**2 + self._r_r_dash * self.dot(beta_dot))
