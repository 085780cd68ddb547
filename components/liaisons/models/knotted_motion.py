"""Operators that move through knots, by the time that has elapsed."""

from __future__ import annotations

from typing import Any

import casadi as ca

from liaisons.base.units import ANY
from liaisons.language import Dimension, InternalState, Operator, ParameterArray
from liaisons.models.quintic import quintic

KNOTS = 50
NEAR = 1e-6
"""Part of a period: knots that are nearer to each other are both sides of a jump."""
DIMENSION = Dimension("knots", KNOTS, "number of knots")


class KnottedMotion(Operator, abstract=True):
    """A motion through knots that may repeat itself, between them as PlannedMotion, and a correction of it."""

    instant = ParameterArray((), "s", "instants of the knots, ascending", DIMENSION)
    planned = ParameterArray((), ANY, "values at the knots", DIMENSION)
    planned_rate = ParameterArray((), ANY, "rates at the knots, in units of y a second", DIMENSION)
    planned_acceleration = ParameterArray(
        (), ANY, "accelerations at the knots, in units of y a second squared", DIMENSION
    )
    next_jump = ParameterArray(
        (1e30,) * KNOTS, "s", "first jump after the knot; beyond all if there is none", DIMENSION
    )
    elapsed = InternalState("s", "time since the start")
    value = InternalState(ANY, "correction of y")
    period: Any  # parameters of what samples: the sampling period [s],
    repeats: Any  # the time after which the motion repeats itself [s],
    announced: Any  # and whether next_event_time has samples, too

    def rounds(self, t: ca.SX) -> ca.SX:
        """Number of completed rounds; a round that ends within rounding errors is completed."""
        return ca.floor(t / self.repeats + 1e-10)

    def time_of_round(self, t: ca.SX) -> ca.SX:
        """Time since the start of the round, put forward by rounding errors."""
        return t - self.rounds(t) * self.repeats + 1e-9 * self.period

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - by the time that the other states have, too
        columns = "instant", "planned", "planned_rate", "planned_acceleration"
        (t_0, y, v, a), (t_1, y_1, v_1, a_1) = self.interval(self.time_of_round(self.elapsed), *columns, rests=True)
        tau, h = self.elapsed - self.rounds(self.elapsed) * self.repeats - t_0, t_1 - t_0
        is_jump = h < 1e-6 * self.period
        u = tau * ca.if_else(is_jump, 0, 1 / ca.if_else(is_jump, self.period, h))
        return quintic((y, v, a), (y_1, v_1, a_1), tau, h, u) + self.value

    def next_event_time(self) -> ca.SX:
        """Next repeated instant of this round, the start of the next round, or the next sample if these are announced.

        At samples only the third derivative jumps.
        """
        (next_jump, t_0), (_, t_1) = self.interval(self.time_of_round(self.elapsed), "next_jump", "instant", rests=True)
        begin = self.rounds(self.elapsed) * self.repeats
        since = self.elapsed - begin - t_0
        sample = ca.if_else(t_1 > t_0, t_1, t_0 + self.period * (ca.floor(since / self.period + NEAR) + 1))
        announced = begin + ca.if_else(self.announced > 0, sample, next_jump)
        instants = begin + next_jump, begin + self.repeats, announced
        return self.first_after(self.clock + (instant - self.elapsed) for instant in instants)
