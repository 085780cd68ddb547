"""The operator that swings harmonically."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.units import ANY
from liaisons.closed_forms import Values, closed_form
from liaisons.language import Operator, Parameter


class Sinusoid(Operator):
    """Harmonic signal: y = offset + amplitude · sin(angular_frequency · t + phase)."""

    offset = Parameter(0.0, ANY, "mean value")
    amplitude = Parameter(1.0, ANY, "amplitude")
    angular_frequency = Parameter(1.0, "rad/s", "angular frequency")
    phase = Parameter(0.0, "rad", "phase at t = 0")

    def signal(self, t: ca.SX) -> ca.SX:
        return self.offset + self.amplitude * ca.sin(self.angular_frequency * t + self.phase)

    @closed_form("a phasor that each derivative turns by a right angle")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        phasor = at.amplitude * np.exp(1j * (at.angular_frequency * t + at.phase))
        y, y_dot, y_ddot = (((1j * at.angular_frequency) ** n * phasor).imag for n in range(3))
        return {"y": at.offset + y, "y_dot": y_dot, "y_ddot": y_ddot}
