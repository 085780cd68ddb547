"""The operator that repeats any smooth motion: a Fourier series of four harmonics."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.units import ANY
from liaisons.closed_forms import Values, closed_form
from liaisons.language import Experiment, Operator, Parameter


class FourierSeries(Operator):
    """Periodic signal: y = offset + Σ cos_k cos(k · angular_frequency · t) + sin_k sin(k · angular_frequency · t)."""

    offset = Parameter(0.0, ANY, "mean value")
    angular_frequency = Parameter(1.0, "rad/s", "angular frequency of the first harmonic")
    cos_1, cos_2, cos_3, cos_4, sin_1, sin_2, sin_3, sin_4 = (
        Parameter(0.0, ANY, f"coefficient of the {wave} of the {ordinal} harmonic")
        for wave in ("cosine", "sine")
        for ordinal in ("first", "second", "third", "fourth")
    )

    experiment = Experiment(reference={"cos_1": 1.0, "sin_2": 0.5})

    def signal(self, t: ca.SX) -> ca.SX:
        y = self.offset
        for k in range(1, 5):
            phase = k * self.angular_frequency * t
            y += self.symbols[f"cos_{k}"] * ca.cos(phase) + self.symbols[f"sin_{k}"] * ca.sin(phase)
        return y

    @closed_form("phasors that each derivative turns and stretches")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        harmonics = range(1, 5)
        factors = 1j * at.angular_frequency * np.array(harmonics)
        amplitudes = at.array(*(f"cos_{k}" for k in harmonics)) - 1j * at.array(*(f"sin_{k}" for k in harmonics))
        phasors = amplitudes * np.exp(np.multiply.outer(t, factors))
        y, y_dot, y_ddot = (np.real(factors**n * phasors).sum(-1) for n in range(3))
        return {"y": at.offset + y, "y_dot": y_dot, "y_ddot": y_ddot}
