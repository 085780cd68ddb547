"""The operator that holds a value."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.units import ANY
from liaisons.closed_forms import Values, closed_form
from liaisons.language import Operator, Parameter


class Constant(Operator):
    """Constant value: y = value."""

    value = Parameter(0.0, ANY, "the value")

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - a signal is a function of time, this one too
        return self.value

    @closed_form("the value, at rest")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        zero = np.zeros_like(t)
        return {"y": zero + at.value, "y_dot": zero, "y_ddot": zero}
