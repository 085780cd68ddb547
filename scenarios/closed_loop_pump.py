"""A child pumps a swing by feedback: it rises at the lowest point and crouches at the turning points.

M 8.1: the SwingPump measures θ and θ' and moves the length through three filters, so that the rate and acceleration of
the length are continuous.  The faster the filters, the closer the growth of 1 - cos θ_max per half swing comes to that
of sudden crouches, (l_low/l_high)³, where l_low is the length of a crouching child.  The loss is proportional to the
square of the delay of the filters, 3/rate.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from liaisons import Result, System, crossings
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

LOW, HIGH = 1.05, 1.0  # length crouched and standing [m]
RATES = np.array([50.0, 100.0, 200.0, 400.0])  # of the filters [1/s]
TOLERANCE = 1e-9


def pumped(rate: float) -> Result:
    system = System("closed loop")
    swing = system.add("swing", "Pendulum", theta_0=0.2, length=LOW)
    child = system.add("child", "SwingPump", low=HIGH, high=LOW, rate=rate)
    system.connect(child["y"], swing["length"])
    system.connect(swing["theta"], child["theta"])
    system.connect(swing["theta_dot"], child["theta_dot"])
    return system.simulate(12.0, 0.1 / rate, tolerance=TOLERANCE)


def growth(run: Result) -> float:
    """Of 1 - cos θ at the turning points, from one half swing to the next: the mean over all of them."""
    turning = crossings(run.time, run["swing.theta_dot"], run["swing.theta_ddot"])
    theta = CubicHermiteSpline(run.time, run["swing.theta"], run["swing.theta_dot"])(turning[turning > 0.5])
    versine = 1 - np.cos(theta)
    return (versine[-1] / versine[0]) ** (1 / (versine.size - 1))


@scenario
def main(claim: Claims) -> None:
    runs = [pumped(rate) for rate in RATES]
    sudden = Pendulum.crouch_growth(length_low=LOW, length_high=HIGH)
    lost = sudden - np.array([growth(run) for run in runs])
    delay = within((3 * np.sqrt(9.81) / RATES[-1]) ** 2, because="the squared phase of the delay, (Ω · 3/rate)²")
    claim(f"the growth tends to that of sudden crouches, (l_low/l_high)³ = {sudden:.4f}", lost[-1], 0.0, delay)
    regression = within(0.1, because="slope over a factor of 8 in rate; the next term is Ω · 3/rate = 0.2 at most")
    claim.order("the loss is proportional to the square of the delay", 1 / RATES, lost, 2, regression)
    claim.energy("the energy gained is the child's work", *runs, tolerance=TOLERANCE)

    angle, length, law = panels(
        (f"the child's filters at {RATES[0]:g} /s", "", "θ [deg]"),
        ("", "t [s]", "length [m]"),
        ("slope -2", "rate of the filters [1/s]", "growth lost in a half swing"),
        mosaic="ac;bc",
        size=(11, 4),
        width_ratios=[2, 1],
    )
    angle.plot(runs[0].time, np.degrees(runs[0]["swing.theta"]))
    length.plot(runs[0].time, runs[0]["child.y"], color="tab:orange")
    law.loglog(RATES, lost, "ko-", markersize=4)
    law.set_xticks(RATES, [f"{rate:g}" for rate in RATES])
    law.minorticks_off()
