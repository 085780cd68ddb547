"""The polynomial of degree five between two knots."""

from collections.abc import Sequence

import casadi as ca

from liaisons.base.hermite import upper_coefficients


def quintic(begin: Sequence[ca.SX], end: Sequence[ca.SX], tau: ca.SX, h: ca.SX, u: ca.SX) -> ca.SX:
    """Value at a time tau after a knot (y, y', y'') of the polynomial to the next one, h later; u = tau/h."""
    (y, v, a), (c_3, c_4, c_5) = begin, upper_coefficients(begin, end, h)
    return y + v * tau + a * tau**2 / 2 + (c_3 + c_4 * u + c_5 * u**2) * u**3
