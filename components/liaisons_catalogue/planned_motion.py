"""The operator that runs through a plan: knots, between which it moves as smoothly as they are given."""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from liaisons.base.units import ANY
from liaisons.closed_forms import Values, closed_form
from liaisons.language import Dimension, Operator, ParameterArray
from liaisons_catalogue.quintic import quintic

_KNOTS = Dimension("knots", 100, "number of knots that there is room for")


class PlannedMotion(Operator):
    """Motion through knots (t, y, y', y''); between two knots the polynomial of degree five that fits both.

    With τ = t - t_k, h = t_(k+1) - t_k, and the differences of value, rate and acceleration that remain at the end of
    the interval, D = y_(k+1) - (y_k + y_k' h + y_k'' h²/2), V = y_(k+1)' - (y_k' + y_k'' h), A = y_(k+1)'' - y_k''::

        y = y_k + y_k' τ + y_k'' τ²/2 + (10 D - 4 V h + A h²/2) (τ/h)³
            - (15 D - 7 V h + A h²) (τ/h)⁴ + (6 D - 3 V h + A h²/2) (τ/h)⁵

    Two different knots at one instant are a jump; the value at that instant is that of the later knot.  The list ends
    where the instants no longer increase, so knots that are left at 0 are ignored.  Beyond both ends the polynomials
    continue.  ``liaisons.plan`` finds the knots; any FMU that follows it interpolates by the same polynomial.
    """

    instant = ParameterArray((0.0, 1.0), "s", "instants of the knots, ascending; twice the same is a jump", _KNOTS)
    value = ParameterArray((0.0, 1.0), ANY, "values at the knots", _KNOTS)
    rate = ParameterArray((), ANY, "rates at the knots, in units of y a second", _KNOTS)
    acceleration = ParameterArray((), ANY, "accelerations at the knots, in units of y a second squared", _KNOTS)

    def signal(self, t: ca.SX) -> ca.SX:
        (t_0, y, v, a), (t_1, y_1, v_1, a_1) = self.interval(t, "instant", "value", "rate", "acceleration")
        h, tau = t_1 - t_0, t - t_0
        u = tau / ca.if_else(h > 0, h, 1)
        return quintic((y, v, a), (y_1, v_1, a_1), tau, h, u)

    def events(self) -> Sequence[ca.SX]:
        return ca.vertsplit(self.instant)

    @closed_form("Bernstein's polynomials through the knots, put together by SciPy")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        knots = np.transpose([at.instant, at.value, at.rate, at.acceleration])
        t_0, t_1 = knots[:-1, 0], knots[1:, 0]
        forward = np.flatnonzero(t_1 > t_0)
        interval = forward[np.maximum(np.searchsorted(t_0[forward], t, side="right") - 1, 0)]
        pieces = {k: BPoly.from_derivatives(knots[k : k + 2, 0], knots[k : k + 2, 1:]) for k in forward}
        orders = range(3)
        columns = [[pieces[k].derivative(n)(instant) for n in orders] for k, instant in zip(interval, t, strict=True)]
        return dict(zip(("y", "y_dot", "y_ddot"), np.transpose(columns), strict=True))
