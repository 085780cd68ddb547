"""Hoops whose coordinate is not the arc length, which then is a quadrature."""

import casadi as ca
import numpy as np

from liaisons.language import assertion, calculated, output
from liaisons_catalogue.hoop import Hoop

# Quadrature of the arc length, nodes and weights on [-1, 1]: Gauss and Legendre's over half a turn at most, the
# midpoint rule over a period.
_GAUSS = np.polynomial.legendre.leggauss(80)
_MIDPOINT = np.linspace(-1, 1, 128, endpoint=False) + 1 / 128, np.full(128, 2 / 128)
SAMPLES = np.linspace(0, 2 * np.pi, 64, endpoint=False)


class ParametrisedHoop(Hoop, abstract=True):
    """Hoop with a bead whose coordinate u is not the arc length; abstract.

    The :meth:`curve` has the period 2π and passes A at u = 0, or at :attr:`_u_at_A`.  Length, area and arc length are
    computed by quadrature unless the subclass has closed forms.
    """

    once_round = ca.SX(2 * np.pi)

    @assertion("the hoop must be star-shaped about O, which lies inside it")
    def star_shaped(self) -> ca.SX:
        """Smallest r² dθ/du of the samples, positive about a hoop that is star-shaped."""
        return ca.mmin(ca.vertcat(*(self._moment_of_rate(ca.SX(u)) for u in SAMPLES)))

    @property
    def _u_at_A(self) -> ca.SX:  # noqa: N802
        """Coordinate u of the point A, at which the axis OA meets the hoop."""
        return ca.SX(0)

    def _arc(self, u: ca.SX, rule: tuple[np.ndarray, np.ndarray]) -> ca.SX:
        """Arc length from 0 to u by a quadrature rule, nodes and weights on [-1, 1]; a loop in the generated code."""
        nodes, weights = (ca.DM(column) for column in rule)
        k, v = self.parameter_column, ca.SX.sym("v")
        speed = ca.Function("speed", [k, v], [self._speed(v)]).map(nodes.numel())
        values, end = ca.MX.sym("values", k.numel()), ca.MX.sym("end")
        length = end / 2 * (speed(values, end / 2 * (1 + nodes.T)) @ weights)
        always_inline, never_inline = False, True
        return ca.Function("arc", [values, end], [length]).call([k, u], always_inline, never_inline)[0]

    def _arc_length(self, u: ca.SX) -> ca.SX:
        """Arc length from 0 to u, over any number of turns."""
        turns = ca.floor(u / (2 * np.pi) + 0.5)
        return turns * self.hoop_length + self._arc(u - 2 * np.pi * turns, _GAUSS)

    @output("m", "arc length of the bead from A, counter-clockwise, not wrapped")
    def xi(self) -> ca.SX:
        return self._arc_length(self.free.q) - self._arc_length(self._u_at_A)

    @output("m/s", "rate of xi")
    def xi_dot(self) -> ca.SX:
        return self._xi_dot

    @output("kg.m/s", "momentum conjugate to xi: mass times absolute tangential velocity of the bead")
    def p_xi(self) -> ca.SX:
        return self.mass * (self._xi_dot + self._a * self.dot(self.beta))

    @calculated("m", "length of the hoop")
    def hoop_length(self) -> ca.SX:
        return self._arc(ca.SX(2 * np.pi), _MIDPOINT)

    @calculated("m2", "area inside the hoop")
    def hoop_area(self) -> ca.SX:
        """Area by the trapezoidal rule, which is exact for trigonometric polynomials."""
        return np.pi * sum((self._moment_of_rate(ca.SX(u)) for u in SAMPLES), ca.SX(0)) / len(SAMPLES)
