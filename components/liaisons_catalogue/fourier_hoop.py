"""The bead on a star-shaped hoop of any shape, given by the Fourier series of its radius."""

import casadi as ca
import numpy as np

from liaisons.language import Coordinate, Parameter, assertion, calculated
from liaisons_catalogue.parametrised_hoop import SAMPLES, ParametrisedHoop


class FourierHoop(ParametrisedHoop):
    """Bead on a hoop r(θ) that an operator turns, in a horizontal plane, about a point O inside it.

    In the frame of the hoop, with O at the origin and OA as the axis θ = 0::

        r(θ) = radius (1 + Σ cos_k cos kθ + sin_k sin kθ),  k = 1..4,    dξ/dθ = √(r² + (dr/dθ)²)

    ξ [m] is the arc length from A.  With the tangential part a = r²θ' and b = r²r'² = r² - a² (' = d/dξ)::

        ξ_dot = p_ξ/m - a β_dot,    p_ξ_dot = a' p_ξ β_dot + ½ m b' β_dot²             M eq. 64
        D_0 = p_ξ/m ∂_ξ                                                                M eq. 65
        H(Y) = Y (∂_β - a ∂_ξ + a' p_ξ ∂_p)                                            M eq. 66
        -X_K = ½ m b' Y² ∂_p                                                           M eq. 67

    Y = β_dot.  The quadrature of ξ is exact to 1e-12 of the length as long as the hoop is not pinched; for a single
    harmonic k = 1..4 this means coefficients up to 0.8, 0.5, 0.3 and 0.2.

    Source: M 8.4, eq. 61-67.
    """

    radius = Parameter(1.0, "m", "mean of r over θ", above=0)
    cos_1, cos_2, cos_3, cos_4, sin_1, sin_2, sin_3, sin_4 = (
        Parameter(0.0, "1", f"coefficient of {wave} {angle} in r/radius")
        for wave in ("cos", "sin")
        for angle in ("θ", "2θ", "3θ", "4θ")
    )
    theta = Coordinate("rad", "polar angle of the bead as seen from O, relative to OA", start_rate=1.0)

    @property
    def _coefficients(self) -> list[tuple[int, ca.SX, ca.SX]]:
        """Order k, cos_k and sin_k of each harmonic."""
        return [(k, self.symbols[f"cos_{k}"], self.symbols[f"sin_{k}"]) for k in range(1, 5)]

    @assertion("r must be > 0 all around: reduce cos_k, sin_k until O lies well inside the hoop")
    def star_shaped(self) -> ca.SX:
        """Lower bound of r/radius, from samples at intervals h: between two r falls by at most h²/8 max |d²r/dθ²|."""
        least = ca.mmin(ca.vertcat(*(self._radius(ca.SX(theta))[0] for theta in SAMPLES))) / self.radius
        bend = sum((k**2 * ca.sqrt(a**2 + b**2) for k, a, b in self._coefficients), ca.SX(0))
        return least - (SAMPLES[1] - SAMPLES[0]) ** 2 / 8 * bend

    def _radius(self, theta: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Radius r and its derivative dr/dθ."""
        cosine, sine = ca.cos(theta), ca.sin(theta)
        c, s, r, slope = ca.SX(1), ca.SX(0), ca.SX(1), ca.SX(0)
        for k, a, b in self._coefficients:
            c, s = c * cosine - s * sine, s * cosine + c * sine  # cos kθ and sin kθ
            r += a * c + b * s
            slope += k * (b * c - a * s)
        return self.radius * r, self.radius * slope

    def curve(self, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        r, _ = self._radius(u)
        return r * ca.cos(u), r * ca.sin(u)

    def _speed(self, u: ca.SX) -> ca.SX:
        r, slope = self._radius(u)
        return ca.sqrt(r**2 + slope**2)

    def _moment_of_rate(self, u: ca.SX) -> ca.SX:
        return self._r_squared(u)

    def _r_squared(self, u: ca.SX) -> ca.SX:
        return self._radius(u)[0] ** 2

    @calculated("m2", "area inside the hoop")
    def hoop_area(self) -> ca.SX:
        return np.pi * self.radius**2 * (1 + sum(a**2 + b**2 for _, a, b in self._coefficients) / 2)

    from liaisons_catalogue.solutions.fourier_hoop import exact, slow_turn
