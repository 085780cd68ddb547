"""The operator that moves at a constant rate from a given instant on."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.units import ANY
from liaisons.closed_forms import Values, closed_form
from liaisons.language import Operator, Parameter


class Ramp(Operator):
    """Constant rate from a start time on: y = offset + rate · max(t - start_time, 0), a jump in y_dot."""

    offset = Parameter(0.0, ANY, "value before the start time")
    rate = Parameter(1.0, ANY, "rate after the start time, in units of y a second")
    start_time = Parameter(0.0, "s", "instant at which the rate jumps")

    def signal(self, t: ca.SX) -> ca.SX:
        return self.offset + ca.if_else(t >= self.start_time, self.rate * (t - self.start_time), 0)

    def events(self) -> list[ca.SX]:
        return [self.start_time]

    @closed_form("at the jump the values after it")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        elapsed = t - at.start_time
        running = np.heaviside(elapsed, 1.0)
        return {"y": at.offset + at.rate * running * elapsed, "y_dot": at.rate * running, "y_ddot": 0 * running}
