"""The operator that holds a mechanism by a force: it reads states, and sets what acts until the next sample."""

from operator import mul

import casadi as ca

from liaisons.base.clocks import CLOCK_ERROR
from liaisons.base.units import ANY
from liaisons.language import DiscreteOutput, DiscreteState, Input, Parameter, ParameterArray, declare
from liaisons_catalogue.knotted_motion import DIMENSION, SampledKnots
from liaisons_catalogue.regulator import READINGS


class _CorrectedForce(SampledKnots, abstract=True):
    """A force given by knots, with a table of gains for its correction."""

    offset = ParameterArray((), ANY, "sum of gains and the values that are wanted, by knots", DIMENSION)
    advance = ParameterArray((), ANY, "by how much the offset grows in a round of a motion that moves on", DIMENSION)
    own_gain = ParameterArray((), ANY, "gains of the force itself, by knots", DIMENSION)


for _i in range(1, READINGS + 1):
    declare(_CorrectedForce, f"gain_{_i}", ParameterArray((), ANY, f"gains of reading {_i}, by knots", DIMENSION))
    declare(_CorrectedForce, f"reading_{_i}", Input(ANY, f"reading {_i}"))


class ForceRegulator(_CorrectedForce):
    """Force that is constant between samples: the planned force, corrected by linear feedback of measured values.

    Samples are taken at the knots, and once per period after the last of them; in Co-Simulation without event mode each
    has to be a communication point.  At the knot k, in the round n of a periodic motion::

        y = next                                                    of the sample before
        next = clip(planned_(k+1) + offset_k + n advance_k - own_gain_k y - Σ gain_ki reading_i, lowest, highest)

    so a whole period is available to compute the value.  Unused places for knots repeat the last knot.
    """

    period = Parameter(100.0, "s", "sampling period, of which communication steps are parts", above=0)
    repeats = Parameter(1e30, "s", "time after which the motion repeats itself", above=0)
    lowest = Parameter(-1e30, ANY, "least force")
    highest = Parameter(1e30, ANY, "greatest force")
    next = DiscreteState(ANY, "force from the next sample on")
    force = DiscreteOutput(ANY, "force, constant between samples")
    held = DiscreteOutput(
        ANY, "the same, for other regulators and observers; in Co-Simulation from when inputs are set"
    )

    def update(self) -> dict[str, ca.SX]:
        gains, readings = ([f"{name}_{i}" for i in range(1, READINGS + 1)] for name in ("gain", "reading"))
        t = self.clock
        (offset, advance, own, _, *row), (_, _, _, planned, *_) = self.interval(
            self.time_of_round(t), "offset", "advance", "own_gain", "planned", *gains, rests=True
        )
        feedback = own * self.next + sum(map(mul, row, (self.symbols[name] for name in readings)))
        wanted = planned + offset + self.completed_rounds(t) * advance - feedback
        return {
            "next": ca.fmin(ca.fmax(wanted, self.lowest), self.highest),
            "force": self.next,
            "held": self.next,
        }

    def visible_states(self, memory: ca.SX) -> ca.SX:
        """Discrete states that outputs show: the next force from its instant on, before a sample is taken."""
        _, after, last = self._memory_parts(memory)
        upcoming, force, held = ca.vertsplit(after)
        is_due = self.last_sample(self.clock) > last + 2 * CLOCK_ERROR * self.period
        return ca.vertcat(upcoming, ca.if_else(is_due, upcoming, force), held)

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - it changes with the state alone
        return self.held

    def next_event_time(self) -> ca.SX:
        """Instant of the next sample, at which the force jumps."""
        return self.events()[0]
