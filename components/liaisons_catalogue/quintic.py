"""The polynomial of degree five between two knots."""

from collections.abc import Sequence

import casadi as ca

from liaisons.base.hermite import upper_coefficients


def quintic(begin: Sequence[ca.SX], end: Sequence[ca.SX], elapsed: ca.SX, interval: ca.SX, fraction: ca.SX) -> ca.SX:
    """Value of the polynomial of degree five between two knots (y, y', y'').

    :param elapsed: time since the first knot [s].
    :param interval: time between both [s].
    :param fraction: ``elapsed`` over ``interval``, which the caller makes finite at a jump.
    """
    (y, v, a), (c_3, c_4, c_5) = begin, upper_coefficients(begin, end, interval)
    rest = (c_3 + c_4 * fraction + c_5 * fraction**2) * fraction**3
    return y + v * elapsed + a * elapsed**2 / 2 + rest
