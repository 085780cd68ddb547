"""The sampled PID controller with output bounds and anti-windup."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.units import ANY
from liaisons.closed_forms import Values, closed_form
from liaisons.language import DiscreteOutput, DiscreteState, Input, Parameter, Sampled


class Pid(Sampled):
    """PID controller with bounded output, filtered derivative, weighted setpoint and anti-windup, with period h.

    With setpoint r, reading y, e = r - y, at a sample (Åström and Wittenmark 8.3; derivative by backward difference)::

        f = f⁻ + N h/(T_d + N h) (b_d r - y - f⁻)
        v = K (b_p r - y) + I⁻ + K N (b_d r - y - f)
        output = clip(v, lowest, highest)
        I = I⁻ + h/T_i (K e + (output - v)/N_i)

    I⁻ and f⁻ are the values before the sample.  The names in Modelica's LimPID are: K ``k``, T_i ``Ti``, T_d ``Td``, N
    ``Nd``, N_i ``Ni``, b_p ``wp``, b_d ``wd``, bounds ``yMin``, ``yMax``.  T_i = 1e30 and T_d = 0 switch off the
    integral and the derivative.
    """

    gain = Parameter(1.0, ANY, "proportional gain, of the output by the reading", symbol="K")
    integral_time = Parameter(0.5, "s", "time of the integral", above=0, symbol="T_i")
    derivative_time = Parameter(0.1, "s", "time of the derivative", minimum=0, symbol="T_d")
    filter = Parameter(10.0, "1", "derivative_time over the time of its filter", above=0, symbol="N")
    anti_windup = Parameter(0.9, "1", "time in which the integral leaves a bound, over integral_time", above=0)
    setpoint_weight = Parameter(1.0, "1", "weight of the setpoint in the proportional part", minimum=0)
    derivative_weight = Parameter(0.0, "1", "weight of the setpoint in the derivative", minimum=0)
    lowest = Parameter(-1e30, ANY, "least output")
    highest = Parameter(1e30, ANY, "greatest output")
    setpoint = Input(ANY, "what the reading is to be")
    reading = Input(ANY, "what is controlled")
    integral = DiscreteState(ANY, "integral part, which the next sample adds")
    filtered = DiscreteState(ANY, "filtered deviation in the derivative")
    output = DiscreteOutput(ANY, "what acts")

    def update(self) -> dict[str, ca.SX]:
        K, h, N, r, y = self.gain, self.period, self.filter, self.setpoint, self.reading
        deviation = self.derivative_weight * r - y
        filtered = self.filtered + N * h / (self.derivative_time + N * h) * (deviation - self.filtered)
        unbounded = K * (self.setpoint_weight * r - y) + self.integral + K * N * (deviation - filtered)
        output = ca.fmin(ca.fmax(unbounded, self.lowest), self.highest)
        excess = (output - unbounded) / self.anti_windup
        integral = self.integral + h / self.integral_time * (K * (r - y) + excess)
        return {"integral": integral, "filtered": filtered, "output": output}

    @closed_form("sums of constants and a geometric series", delay="== 0", lowest="== -1e30", highest="== 1e30")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        """Return outputs and states between samples, for constant inputs."""
        n = np.floor(t / at.period + 1e-6)
        deviation = at.derivative_weight * at.setpoint - at.reading
        decay = at.derivative_time / (at.derivative_time + at.filter * at.period)
        left = (at.filtered_0 - deviation) * decay ** (n + 1)
        slope = at.gain * (at.setpoint - at.reading) * at.period / at.integral_time
        proportional = at.gain * (at.setpoint_weight * at.setpoint - at.reading)
        integral = at.integral_0 + n * slope
        return {
            "output": proportional + integral - at.gain * at.filter * left,
            "integral": integral + slope,
            "filtered": deviation + left,
        }
