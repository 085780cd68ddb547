"""Operators that go through knots, and sample there."""

from typing import Any

import casadi as ca

from liaisons.base.clocks import CLOCK_ERROR
from liaisons.base.units import ANY
from liaisons.language import Dimension, InternalState, Operator, ParameterArray, SampledStates
from liaisons_catalogue.quintic import quintic

KNOTS = 50
DIMENSION = Dimension("knots", KNOTS, "number of knots")


class SampledKnots(Operator, SampledStates, abstract=True):
    """A list of knots, which may be repeated periodically, and samples at the knots.

    Samples are taken at the knots, and once per period after the last knot.  Two knots that are closer to each other
    than a millionth of the period are the two sides of a jump.
    """

    instant = ParameterArray((), "s", "instants of the knots, ascending", DIMENSION)
    planned = ParameterArray((), ANY, "values at the knots", DIMENSION)
    repeats: Any  # parameter: the time after which the motion repeats itself [s]

    def completed_rounds(self, t: ca.SX) -> ca.SX:
        """Number of rounds that are completed at t, but for rounding errors."""
        return ca.floor(t / self.repeats + 1e-10)

    def time_of_round(self, t: ca.SX) -> ca.SX:
        """Time since the start of the round [s], and 1e-9 periods more, beyond rounding errors."""
        return t - self.completed_rounds(t) * self.repeats + 1e-9 * self.period

    def last_sample(self, t: ca.SX) -> ca.SX:
        return self._sample_instants(t)[0]

    def events(self) -> list[ca.SX]:
        return [self._sample_instants(self.clock)[1]]

    def _sample_instants(self, t: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Instants [s] of the last sample up to t, and of the next one."""
        (t_0,), (t_1,) = self.interval(self.time_of_round(t), "instant", rests=True)
        begin, period = self.completed_rounds(t) * self.repeats, self.period
        count = ca.floor((t - begin - t_0) / period + CLOCK_ERROR)
        last = ca.if_else(t_1 > t_0, t_0, t_0 + period * count)
        return begin + last, begin + ca.fmin(ca.if_else(t_1 > t_0, t_1, last + period), self.repeats)


class KnottedMotion(SampledKnots, abstract=True):
    """A motion through knots, interpolated as by PlannedMotion, and a correction of this motion."""

    planned_rate = ParameterArray((), ANY, "rates at the knots, in units of y a second", DIMENSION)
    planned_acceleration = ParameterArray(
        (), ANY, "accelerations at the knots, in units of y a second squared", DIMENSION
    )
    next_jump = ParameterArray(
        (1e30,) * KNOTS, "s", "first jump after the knot; beyond all if there is none", DIMENSION
    )
    value = InternalState(ANY, "correction of y")
    announced: Any  # parameter: whether next_event_time has samples, too

    def signal(self, t: ca.SX) -> ca.SX:
        columns = "instant", "planned", "planned_rate", "planned_acceleration"
        (t_0, y, v, a), (t_1, y_1, v_1, a_1) = self.interval(self.time_of_round(t), *columns, rests=True)
        tau, h = t - self.completed_rounds(t) * self.repeats - t_0, t_1 - t_0
        is_jump = h < CLOCK_ERROR * self.period
        u = tau * ca.if_else(is_jump, 0, 1 / ca.if_else(is_jump, self.period, h))
        return quintic((y, v, a), (y_1, v_1, a_1), tau, h, u) + self.value

    def next_event_time(self) -> ca.SX:
        """Instant of the next jump, of the next round, or of the next sample if samples are ``announced``.

        At samples only the third derivative jumps.
        """
        t = self.clock
        (next_jump,), _ = self.interval(self.time_of_round(t), "next_jump", rests=True)
        begin = self.completed_rounds(t) * self.repeats
        sample = ca.if_else(self.announced > 0, self.events()[0], begin + next_jump)
        return self.first_after([begin + next_jump, begin + self.repeats, sample])
