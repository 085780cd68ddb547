"""The operator that goes from one value to another, smoothly."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.units import ANY
from liaisons.closed_forms import Values, closed_form
from liaisons.language import Operator, Parameter


class SmoothStep(Operator):
    """Step from one value to another with three continuous derivatives.

    With u = (t - start_time)/duration between 0 and 1::

        y = start_value + (end_value - start_value) u⁴ (35 - 84 u + 70 u² - 20 u³)
    """

    start_value = Parameter(0.0, ANY, "value before the step")
    end_value = Parameter(1.0, ANY, "value after the step")
    start_time = Parameter(0.0, "s", "instant at which the step begins")
    duration = Parameter(1.0, "s", "time the step takes", above=0)

    def signal(self, t: ca.SX) -> ca.SX:
        u = ca.fmin(ca.fmax((t - self.start_time) / self.duration, 0), 1)
        return self.start_value + (self.end_value - self.start_value) * u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)

    def events(self) -> list[ca.SX]:
        return [self.start_time, self.start_time + self.duration]

    @closed_form("from the derivative 140 u³ (1 - u)³ of the polynomial")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rise = at.end_value - at.start_value
        u = np.clip((t - at.start_time) / at.duration, 0.0, 1.0)
        bump = u * (1 - u)
        step = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])(u)
        y_ddot = 420 * rise * bump**2 * (1 - 2 * u) / at.duration**2
        return {"y": at.start_value + rise * step, "y_dot": 140 * rise * bump**3 / at.duration, "y_ddot": y_ddot}
