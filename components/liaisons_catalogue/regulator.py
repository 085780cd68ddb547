"""The operator that holds a mechanism to a motion: it reads states, and corrects its coordinate where they are off."""

from operator import mul

import casadi as ca

from liaisons.base.units import ANY
from liaisons.language import DiscreteState, Input, InternalState, Parameter, ParameterArray, declare
from liaisons_catalogue.knotted_motion import DIMENSION, KNOTS, KnottedMotion

READINGS = 24


class CorrectedMotion(KnottedMotion, abstract=True):
    """A motion through knots, with tables for its correction: gains of the measured values, and bounds."""

    offset = ParameterArray((), ANY, "sum of gains and the values that are wanted, by knots", DIMENSION)
    advance = ParameterArray((), ANY, "by how much the offset grows in a round of a motion that moves on", DIMENSION)
    lowest = ParameterArray((-1e30,) * KNOTS, ANY, "least correcting acceleration", DIMENSION)
    highest = ParameterArray((1e30,) * KNOTS, ANY, "greatest correcting acceleration", DIMENSION)
    least = ParameterArray((-1e30,) * KNOTS, ANY, "least correction", DIMENSION)
    most = ParameterArray((1e30,) * KNOTS, ANY, "greatest correction", DIMENSION)
    slowest = ParameterArray((-1e30,) * KNOTS, ANY, "least rate of the correction", DIMENSION)
    fastest = ParameterArray((1e30,) * KNOTS, ANY, "greatest rate of the correction", DIMENSION)


for _i in range(1, READINGS + 1):
    declare(CorrectedMotion, f"gain_{_i}", ParameterArray((), ANY, f"gains of reading {_i}, by knots", DIMENSION))
    declare(CorrectedMotion, f"reading_{_i}", Input(ANY, f"reading {_i}"))


class Regulator(CorrectedMotion):
    """Motion through knots, corrected by linear feedback of the values measured at the last sample.

    Samples are taken at the knots, and once per period after the last of them; in Co-Simulation without event mode each
    has to be a communication point.  From the sampled knot k on, in the round n of a periodic motion::

        y = y_k + y_k' τ + y_k'' τ²/2 + ... + x       between knots as PlannedMotion, after the last one without "..."
        w = clip(offset_k + n advance_k - Σ gain_ki reading_i, lowest_k, highest_k)
        x''' = (w - x'') / period

    so that x stays between least_k and most_k and x' between slowest_k and fastest_k.  These bounds are approached no
    faster than by exp(-t/(2 period)).  Unused places for knots repeat the last knot.
    """

    period = Parameter(100.0, "s", "sampling period, of which communication steps are parts", above=0)
    repeats = Parameter(1e30, "s", "time after which the motion repeats itself", above=0)
    announced = Parameter(1.0, "1", "next_event_time has samples, too; 0: communication points are there anyhow")
    rate = InternalState(ANY, "its rate")
    acceleration = InternalState(ANY, "its acceleration")
    wanted = DiscreteState(ANY, "acceleration that was wanted at the last sample")

    def update(self) -> dict[str, ca.SX]:
        gains = [f"gain_{i}" for i in range(1, READINGS + 1)]
        t = self.clock
        (offset, advance, *row), _ = self.interval(self.time_of_round(t), "offset", "advance", *gains, rests=True)
        readings = (self.symbols[f"reading_{i}"] for i in range(1, READINGS + 1))
        return {"wanted": offset + self.completed_rounds(t) * advance - sum(map(mul, row, readings))}

    def internal_rates(self) -> dict[str, ca.SX]:
        limits = ["lowest", "highest", "slowest", "fastest", "least", "most"]
        bounds, _ = self.interval(self.time_of_round(self.clock), *limits, rests=True)
        lowest, highest, slowest, fastest, least, most = bounds
        x, v, a, H, p, wanted = self.value, self.rate, self.acceleration, self.period, 1 / self.period, self.wanted
        for low, high in (
            (lowest, highest),
            (a + H * (p**2 * (bound - v) - 2 * p * a) for bound in (slowest, fastest)),
            (a + H * (p**3 * (bound - x) - 3 * p**2 * v - 3 * p * a) for bound in (least, most)),
        ):
            wanted = ca.fmin(ca.fmax(wanted, low), high)
        return {"value": v, "rate": a, "acceleration": (wanted - a) / H}
