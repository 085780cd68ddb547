"""Operators: sources of σ(t) with its two derivatives, for the active port of a mechanism."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.language import Operator, Parameter, Values, closed_form
from liaisons.units import ANY


def _triple(y: NDArray, y_dot: NDArray, y_ddot: NDArray) -> dict[str, NDArray]:
    return {"y": y, "y_dot": y_dot, "y_ddot": y_ddot}


class Constant(Operator):
    """Constant value: y = value."""

    value = Parameter(0.0, ANY, "the value")

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - a signal is a function of time, this one too
        return self.value

    @closed_form("the value, at rest")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        zero = np.zeros_like(t)
        return _triple(zero + at.value, zero, zero)


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
        return _triple(at.offset + at.rate * running * elapsed, at.rate * running, 0 * running)


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
        turn = 1j * at.angular_frequency
        return _triple(at.offset + phasor.imag, (turn * phasor).imag, (turn**2 * phasor).imag)


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
        return _triple(at.start_value + rise * step, 140 * rise * bump**3 / at.duration, y_ddot)
