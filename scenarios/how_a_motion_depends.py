"""A pendulum's motion depends on g t²/l alone: g ∂θ/∂g = ½ t θ', l ∂θ/∂l = -½ t θ', and on the mass not at all.

K Ex. 3 released at θ_0, far from the linear pendulum.  After n periods the pendulum is back at θ_0, whatever θ_0 is, so
∂θ/∂θ_0 = 1 there.  But the period grows with θ_0, so ∂θ'/∂θ_0 = n Ω² sin θ_0 dT/dθ_0: an error of the start value grows
in proportion to the time, as in every motion without chaos.  dT/dθ_0 follows from the derivative of Legendre's K.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import ellipe, ellipk

from liaisons import sensitivities, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

START, PERIODS = 2.0, 10
GRAVITY, LENGTH, MASS = 9.81, 1.3, 2.0
DIFFERENCE = 1e-4  # [rad]


def later() -> float:
    """dT/dθ_0 = 2/Ω sin θ_0 dK/dm with m = sin² θ_0/2, dK/dm = (E - (1 - m) K)/(2 m (1 - m))."""
    m = np.sin(START / 2) ** 2
    slope = (ellipe(m) - (1 - m) * ellipk(m)) / (2 * m * (1 - m))
    return float(2 * np.sqrt(LENGTH / GRAVITY) * np.sin(START) * slope)


@scenario
def main(claim: Claims) -> None:
    values = {"theta_0": START, "gravity": GRAVITY, "length": LENGTH, "mass": MASS}
    period = Pendulum.period(theta_0=START, gravity=GRAVITY, length=LENGTH)
    times = period * np.linspace(0, PERIODS, 40 * PERIODS + 1)
    record = ["theta", "theta_dot", "energy"]
    run = sensitivities("Pendulum", by=list(values), times=times, record=record, start_values=values, tolerance=1e-12)
    motion = within(1e-8, "rad", because="solver tolerance 1e-12 times derivatives that have grown to 100")
    turned = times * run["theta_dot"] / 2
    claim("g ∂θ/∂g = ½ t θ'", GRAVITY * run.derivative("theta", "gravity"), turned, motion)
    claim("l ∂θ/∂l = -½ t θ'", LENGTH * run.derivative("theta", "length"), -turned, motion)
    claim("∂θ/∂m = 0", MASS * run.derivative("theta", "mass"), 0.0, motion)
    torque = MASS * GRAVITY * LENGTH * np.sin(START)
    account = within(1e-7, "J", because="tolerance 1e-12 times derivatives of up to 100, times torques of 20 N.m")
    claim("∂E/∂θ_0 = m g l sin θ_0 at every instant", run.derivative("energy", "theta_0"), torque, account)

    back, n = slice(None, None, 40), np.arange(PERIODS + 1)
    slope, rate = run.derivative("theta", "theta_0"), run.derivative("theta_dot", "theta_0")
    claim("after n periods ∂θ/∂θ_0 = 1", slope[back], 1.0, motion)
    growth = n * GRAVITY / LENGTH * np.sin(START) * later()
    claim("after n periods ∂θ'/∂θ_0 = n Ω² sin θ_0 dT/dθ_0", rate[back], growth, motion)

    ends: list[Any] = [values | {"theta_0": START + step} for step in (DIFFERENCE, -DIFFERENCE)]
    more, less = (simulate("Pendulum", times=times, tolerance=1e-12, **start)["theta"] for start in ends)
    cubic = within(1e-4, "rad", because="h²/6 times the third derivative; the first is 30, the third about 30³")
    claim("∂θ/∂θ_0 is the difference of two runs of the FMU", slope, (more - less) / (2 * DIFFERENCE), cubic)

    values_of, by_start = panels(
        ("by gravity and by length", "t/T", "θ [rad]"),
        ("by the start", "t/T", "∂θ'/∂θ$_0$ [1/s]"),
    )
    turns = times / period
    values_of.plot(turns, run["theta"], color="0.6", label="θ")
    for name, symbol in (("gravity", "g ∂θ/∂g"), ("length", "l ∂θ/∂l")):
        values_of.plot(turns, values[name] * run.derivative("theta", name), label=symbol)
    dots(values_of, turns, turned, label="±½ t θ'")
    dots(values_of, turns, -turned)
    by_start.plot(turns, rate, label="∂θ'/∂θ$_0$")
    dots(by_start, n, growth, label="n Ω² sin θ$_0$ dT/dθ$_0$")
