"""The bead on a circular hoop that turns about a point off its centre."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.mechanics import Coordinate, Parameter, calculated, condition, output
from liaisons.models import _elliptic
from liaisons.models._validity import require, require_not_negative, require_positive
from liaisons.models.hoop import Hoop


class CircularHoop(Hoop):
    """Bead on a circular hoop that an operator turns, in a horizontal plane, about a point O inside it.

    The centre lies on the axis OA at distance d from O; ξ is the arc length from A, ψ = ξ/R.  With r = |OP|, its
    tangential part a = r²θ' = R + d cos ψ and b = r²r'² = r² - a² = d² sin² ψ (' = d/dξ)::

        L = ½ m (r'² ξ_dot² + r² (θ' ξ_dot + β_dot)²) + ½ I β_dot²            M eq. 61, dots restored
        ξ_dot = p_ξ/m - a β_dot,    p_ξ_dot = a' p_ξ β_dot + ½ m b' β_dot²    M eq. 64
        K_Y = ½ (I + m b) Y²                                                  M eq. 63
        constant β_dot:    ψ_ddot = -(d/R) β_dot² sin ψ, a pendulum

    ξ [m], θ [rad] polar angle of the bead from OA, β [rad] angle of OA, m [kg] bead, I [kg.m2] hoop about O.
    p_ξ is m times the absolute tangential velocity; I enters the operator's torque alone.

    Source: M 8.4, eq. 61-67.
    """

    radius = Parameter(1.0, "m", "radius of the hoop", above=0)
    offset = Parameter(0.5, "m", "distance from O to the centre of the hoop", minimum=0)
    xi = Coordinate("m", "arc length of the bead from A, counter-clockwise", start_rate=1.0)

    @condition("O must lie inside the hoop: offset < radius")
    def inside(self) -> ca.SX:
        return self.radius - self.offset

    def curve(self, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        psi = u / self.radius
        return self.offset + self.radius * ca.cos(psi), self.radius * ca.sin(psi)

    def _speed(self, u: ca.SX) -> ca.SX:  # noqa: ARG002 - the same everywhere: ξ is the arc length
        return ca.SX(1)

    def _moment(self, u: ca.SX) -> ca.SX:
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

    @staticmethod
    def exact(
        t: ArrayLike,
        *,
        beta_dot: float = 0.0,
        xi_0: float = 0.0,
        xi_dot_0: float = 1.0,
        mass: float = 1.0,
        hoop_inertia: float = 0.1,
        radius: float = 1.0,
        offset: float = 0.5,
    ) -> dict[str, NDArray]:
        """Motion while the hoop turns at constant rate: a pendulum of frequency |β_dot| √(d/R).

        The centrifugal force is its gravity.  The operator's torque balances the moment of the normal force about O;
        the hoop's own inertia asks for none at constant rate.

        :param t: times since the start [s], any shape.
        :param xi_dot_0: initial rate relative to the hoop.
        :returns: ``xi`` [m], ``xi_dot`` [m/s], ``normal_force`` [N], ``beta_force`` [N.m], ``beta_power`` [W].
        :raises ValidityError: for a parameter outside its domain.
        """
        require_positive("CircularHoop.exact", mass=mass, radius=radius)
        require_not_negative("CircularHoop.exact", offset=offset, hoop_inertia=hoop_inertia)
        require(offset < radius, f"CircularHoop.exact: offset = {offset} must be < radius = {radius}")
        frequency = abs(beta_dot) * np.sqrt(offset / radius)
        if frequency > 0:
            psi, psi_dot = _elliptic.pendulum(t, xi_0 / radius, xi_dot_0 / radius, frequency)
        else:
            psi_dot = np.full_like(np.asarray(t, dtype=float), xi_dot_0 / radius)
            psi = xi_0 / radius + psi_dot * t
        normal_force = mass * (radius * (psi_dot + beta_dot) ** 2 + offset * beta_dot**2 * np.cos(psi))
        torque = -offset * np.sin(psi) * normal_force
        return {
            "xi": radius * psi,
            "xi_dot": radius * psi_dot,
            "normal_force": normal_force,
            "beta_force": torque,
            "beta_power": torque * beta_dot,
        }
