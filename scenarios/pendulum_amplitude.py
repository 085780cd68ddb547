"""A pendulum keeps time only if its swings are small: the period grows from 2π/Ω to 4K(sin θ_0/2)/Ω.

K Fig. 2: the linear and the nonlinear pendulum (Ω = 1, released at rest) at small and at large amplitude.  In both
cases the FMU must follow Jacobi's elliptic functions, and its period, read off the zero crossings of θ, must agree with
Legendre's K.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import crossings, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

AMPLITUDES = {"small": 0.2, "large": 3.0}  # [rad]


@scenario
def main(claim: Claims) -> None:
    solver = within(1e-7, "rad", because="errors at solver tolerance 1e-10, amplified less than 100-fold over 60 s")
    spline = within(1e-7, "s", because="errors of the spline at the crossings, 0.02⁴/384, and of the solver")
    axes = panels(*((f"θ(0) = {amplitude} rad", "Ωt", "θ [rad]") for amplitude in AMPLITUDES.values()))
    for axis, (name, amplitude) in zip(axes, AMPLITUDES.items(), strict=True):
        start: Any = {"theta_0": amplitude, "gravity": 1.0}  # Ω = 1 rad/s
        run = simulate("Pendulum", stop_time=60.0, step_size=0.02, tolerance=1e-10, **start)
        exact = Pendulum.exact(run.time, **start)
        claim(f"{name} amplitude: θ(t) is Jacobi's elliptic function", run["theta"], exact["theta"], solver)
        period = np.diff(crossings(run.time, run["theta"], run["theta_dot"], rising=True)).mean()
        legendre = Pendulum.period(**start)
        claim(f"{name} amplitude: period {legendre:.4f} s is 4K/Ω", period, legendre, spline)
        axis.plot(run.time, Pendulum.small_angle(run.time, **start)["theta"], color="tab:purple", label="linear")
        axis.plot(run.time, run["theta"], color="tab:blue", label="FMU")
        dots(axis, run.time, exact["theta"], every=50, label="elliptic functions")
        axis.set(xlim=(0, 40))

    # K Ex. 3, condition "θ ≪ 1": the relative period error of the linear pendulum is θ²/16 + O(θ⁴).
    square = AMPLITUDES["small"] ** 2
    stretch = Pendulum.period(theta_0=AMPLITUDES["small"], gravity=1.0) / (2 * np.pi) - 1
    series = within(square, because="the next term of the series, relative to the first: 11 θ²/192")
    claim("small amplitude: the linear period is short by θ²/16", stretch / (square / 16), 1.0, series)
