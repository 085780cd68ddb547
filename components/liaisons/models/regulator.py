"""The operator that holds a mechanism to a motion: it reads states, and corrects its coordinate where they are off."""

from __future__ import annotations

import casadi as ca

from liaisons.language import Dimension, Input, InternalState, Operator, Parameter, ParameterArray
from liaisons.units import ANY

READINGS, KNOTS = 24, 50
_KNOTS = Dimension("knots", KNOTS, "number of knots")
_READINGS = Dimension("readings", READINGS, "number of readings")


class Regulator(Operator):
    """A motion through knots, and its correction by linear feedback of what was read at the last communication point.

    From the knot k on that was begun at that point, in the round n of a motion that repeats itself::

        y = y_k + y_k' τ + y_k'' τ²/2 + ... + x       between knots as PlannedMotion, after the last one without "..."
        w = clip(offset_k - Σ gain_ki (reading_i - n shift_i), lowest_k, highest_k)
        x''' = (w - x'') / period

    so that x stays within room_k and x' within rate_room_k: bounds that are approached no faster than by
    exp(-t/(2 period)).  Readings stay as they are until the next communication point, and so does ``sampled``, the
    time that was read there from ``elapsed``; y, y_dot and y_ddot are read through wires like the states of others.
    Every knot needs its numbers: the last one is repeated where there are less than there is room for.
    ``liaisons.hold`` finds all of it.
    """

    period = Parameter(0.01, "s", "sampling period: distance of the communication points", above=0)
    repeats = Parameter(1e9, "s", "time after which the motion repeats itself", above=0)
    instant = ParameterArray((), "s", "instants of the knots, ascending", _KNOTS)
    planned = ParameterArray((), ANY, "values at the knots", _KNOTS)
    planned_rate = ParameterArray((), ANY, "rates at the knots, in units of y a second", _KNOTS)
    planned_acceleration = ParameterArray((), ANY, "accelerations at the knots, in units of y a second squared", _KNOTS)
    offset = ParameterArray((), ANY, "sum of gains and the values that are wanted, by knots", _KNOTS)
    lowest = ParameterArray((-1e9,) * KNOTS, ANY, "least correcting acceleration", _KNOTS)
    highest = ParameterArray((1e9,) * KNOTS, ANY, "greatest correcting acceleration", _KNOTS)
    least = ParameterArray((-1e9,) * KNOTS, ANY, "least correction", _KNOTS)
    most = ParameterArray((1e9,) * KNOTS, ANY, "greatest correction", _KNOTS)
    slowest = ParameterArray((-1e9,) * KNOTS, ANY, "least rate of the correction", _KNOTS)
    fastest = ParameterArray((1e9,) * KNOTS, ANY, "greatest rate of the correction", _KNOTS)
    shift = ParameterArray((), ANY, "by how much what is wanted moves on in a round", _READINGS)
    for _i in range(1, READINGS + 1):
        vars()[f"gain_{_i}"] = ParameterArray((), ANY, f"gains of reading {_i}, by knots", _KNOTS)
        vars()[f"reading_{_i}"] = Input(ANY, f"reading {_i}")
    sampled = Input("s", "time elapsed at the last communication point")
    elapsed = InternalState("s", "time since the start")
    value = InternalState(ANY, "correction of y")
    rate = InternalState(ANY, "its rate")
    acceleration = InternalState(ANY, "its acceleration")

    def _round(self, t: ca.SX) -> ca.SX:
        """Whole rounds until a time; one that ends within rounding errors has ended."""
        return ca.floor(t / self.repeats + 1e-10)

    def _begun(self, t: ca.SX) -> ca.SX:
        """1 for the knot that was begun last, else 0; before the first one it is the first."""
        late = t - self._round(t) * self.repeats + 1e-9 * self.period
        begun = ca.vertcat(1, late >= self.instant[1:])
        return begun - ca.vertcat(begun[1:], 0)

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - by the time that the other states have, too
        begun, columns = self._begun(self.elapsed), (self.instant, self.planned, self.planned_rate)
        t_0, y, v, a = (ca.dot(begun, x) for x in (*columns, self.planned_acceleration))
        next_one = ca.vertcat(0, begun[:-1])
        t_1, y_1, v_1, a_1 = (ca.dot(next_one, x) for x in (*columns, self.planned_acceleration))
        tau, h = self.elapsed - self._round(self.elapsed) * self.repeats - t_0, t_1 - t_0
        D, V, A = y_1 - (y + v * h + a * h**2 / 2), (v_1 - (v + a * h)) * h, (a_1 - a) * h**2
        is_jump = h < 1e-6 * self.period
        u = ca.if_else(is_jump, 0, tau / ca.if_else(is_jump, self.period, h))
        rest = (10 * D - 4 * V + A / 2) - (15 * D - 7 * V + A) * u + (6 * D - 3 * V + A / 2) * u**2
        return y + v * tau + a * tau**2 / 2 + rest * u**3 + self.value

    def internal_rates(self) -> dict[str, ca.SX]:
        begun, rounds = self._begun(self.sampled), self._round(self.sampled)
        wanted = ca.dot(begun, self.offset)
        for i in range(1, READINGS + 1):
            reading = self.symbols[f"reading_{i}"] - rounds * self.shift[i - 1]
            wanted -= ca.dot(begun, getattr(self, f"gain_{i}")) * reading
        x, v, a, H, p = self.value, self.rate, self.acceleration, self.period, 1 / self.period
        for low, high in (
            (self.lowest, self.highest),
            (a + H * (p**2 * (bound - v) - 2 * p * a) for bound in (self.slowest, self.fastest)),
            (a + H * (p**3 * (bound - x) - 3 * p**2 * v - 3 * p * a) for bound in (self.least, self.most)),
        ):
            wanted = ca.fmin(ca.fmax(wanted, ca.dot(begun, low)), ca.dot(begun, high))
        return {"elapsed": ca.SX(1), "value": v, "rate": a, "acceleration": (wanted - a) / H}
