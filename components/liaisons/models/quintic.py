"""The polynomial of degree five between two knots."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca


def quintic(begin: Sequence[ca.SX], end: Sequence[ca.SX], tau: ca.SX, h: ca.SX, u: ca.SX) -> ca.SX:
    """Value after the time tau, of the knots (y, y', y''), where h lies between them and u = tau/h."""
    (y, v, a), (y_1, v_1, a_1) = begin, end
    D, V, A = y_1 - (y + v * h + a * h**2 / 2), (v_1 - (v + a * h)) * h, (a_1 - a) * h**2
    rest = (10 * D - 4 * V + A / 2) - (15 * D - 7 * V + A) * u + (6 * D - 3 * V + A / 2) * u**2
    return y + v * tau + a * tau**2 / 2 + rest * u**3
