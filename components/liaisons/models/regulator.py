"""The operator that holds a mechanism: it reads states, and accelerates its coordinate against what they are off."""

from __future__ import annotations

import casadi as ca

from liaisons.language import Dimension, Input, InternalState, Operator, Parameter, ParameterArray
from liaisons.units import ANY

_READINGS = 16


class Regulator(Operator):
    """Linear feedback of what was read at the last communication point, within bounds.

    ::

        w = clip(-Σ gain_i (reading_i - wanted_i), lowest, highest)
        y''' = (w - y'') / period

    Readings stay as they are until the next communication point.  What the operator itself has done is read like the
    rest, through wires from y, y_dot and y_ddot to readings of its own.  y, y_dot and y_ddot are states and
    continuous, so that the loop is the same in every importer that exchanges all values at once.
    ``liaisons.hold`` finds the gains.
    """

    period = Parameter(0.01, "s", "sampling period: distance of the communication points", above=0)
    lowest = Parameter(-1e9, ANY, "least acceleration, in units of y a second squared")
    highest = Parameter(1e9, ANY, "greatest acceleration, in units of y a second squared")
    gain = ParameterArray((), ANY, "gains", Dimension("readings", _READINGS, "number of readings"))
    wanted = ParameterArray((), ANY, "values to hold", Dimension("readings", _READINGS, "number of readings"))
    for _i in range(1, _READINGS + 1):
        vars()[f"reading_{_i}"] = Input(ANY, f"reading {_i}")
    value = InternalState(ANY, "y")
    rate = InternalState(ANY, "rate of y")
    acceleration = InternalState(ANY, "acceleration of y")

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - time enters through what is read alone
        return self.value

    def internal_rates(self) -> dict[str, ca.SX]:
        read = ca.vertcat(*(self.symbols[f"reading_{i}"] for i in range(1, _READINGS + 1)))
        chosen = ca.fmin(ca.fmax(-ca.dot(self.gain, read - self.wanted), self.lowest), self.highest)
        return {
            "value": self.rate,
            "rate": self.acceleration,
            "acceleration": (chosen - self.acceleration) / self.period,
        }
