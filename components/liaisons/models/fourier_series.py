"""The operator that repeats any smooth motion: a Fourier series of four harmonics."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.language import Experiment, Operator, Parameter, Values, closed_form
from liaisons.units import ANY


class FourierSeries(Operator):
    """Periodic signal: y = offset + Σ cos_k cos(k · angular_frequency · t) + sin_k sin(k · angular_frequency · t)."""

    offset = Parameter(0.0, ANY, "mean value")
    angular_frequency = Parameter(1.0, "rad/s", "angular frequency of the first harmonic")
    cos_1 = Parameter(0.0, ANY, "coefficient of the cosine of the first harmonic")
    cos_2 = Parameter(0.0, ANY, "coefficient of the cosine of the second harmonic")
    cos_3 = Parameter(0.0, ANY, "coefficient of the cosine of the third harmonic")
    cos_4 = Parameter(0.0, ANY, "coefficient of the cosine of the fourth harmonic")
    sin_1 = Parameter(0.0, ANY, "coefficient of the sine of the first harmonic")
    sin_2 = Parameter(0.0, ANY, "coefficient of the sine of the second harmonic")
    sin_3 = Parameter(0.0, ANY, "coefficient of the sine of the third harmonic")
    sin_4 = Parameter(0.0, ANY, "coefficient of the sine of the fourth harmonic")

    experiment = Experiment(reference={"cos_1": 1.0, "sin_2": 0.5})

    def signal(self, t: ca.SX) -> ca.SX:
        cosines = self.cos_1, self.cos_2, self.cos_3, self.cos_4
        sines = self.sin_1, self.sin_2, self.sin_3, self.sin_4
        y = self.offset
        for k, (a, b) in enumerate(zip(cosines, sines, strict=True), 1):
            phase = k * self.angular_frequency * t
            y += a * ca.cos(phase) + b * ca.sin(phase)
        return y

    @closed_form("phasors that each derivative turns and stretches")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        harmonics = range(1, 5)
        turn = 1j * at.angular_frequency * np.array(harmonics)
        amplitudes = at.array(*(f"cos_{k}" for k in harmonics)) - 1j * at.array(*(f"sin_{k}" for k in harmonics))
        phasors = amplitudes * np.exp(np.multiply.outer(t, turn))
        y, y_dot, y_ddot = (np.real(turn**n * phasors).sum(-1) for n in range(3))
        return {"y": at.offset + y, "y_dot": y_dot, "y_ddot": y_ddot}
