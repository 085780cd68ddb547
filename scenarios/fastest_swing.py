"""In the fastest half swing from 0.5 to 0.55 rad, one stands up before the lowest point and sits down before the turn.

M 8.1 with M 2: the length of a Pendulum lies between l_min and l_max and may jump, and the time to reach an amplitude
is minimized.  To gain the most energy, the length would switch at θ = 0; but a short pendulum also swings faster.
Since p is continuous through both switches and the energy constant between them, c_1 - c_2 = (cos α - cos β)/(1 -
(l_min/l_max)³), c = cos θ, from amplitude α to β.  The duration of each arc is an elliptic integral of the first kind,
and one number remains to be optimized.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import ellipkinc

from liaisons import plan
from liaisons.scenarios import Claims, dots, panels, scenario, within

SHORT, LONG, BEGIN, GRAVITY = 1.0, 1.1, 0.5, 9.81
ENDS = (0.53, 0.55, 0.57)


def fall(length: float, amplitude: float, theta: float) -> float:
    """Time from θ to the lowest point."""
    k = np.sin(amplitude / 2)
    return np.sqrt(length / GRAVITY) * ellipkinc(np.arcsin(min(1.0, np.sin(theta / 2) / k)), k**2)


def switches(theta: float, end: float) -> tuple[float, float]:
    """Where it sits down, and the amplitude between, if it stands up at θ before the lowest point."""
    stretch = (LONG / SHORT) ** 3
    down = np.arccos(np.cos(theta) - (np.cos(BEGIN) - np.cos(end)) / (1 - 1 / stretch))
    return down, np.arccos(np.cos(theta) - stretch * (np.cos(theta) - np.cos(BEGIN)))


def duration(theta: float, end: float) -> float:
    """Of the half swing that stands up there."""
    down, between = switches(theta, end)
    begun = fall(LONG, BEGIN, BEGIN) - fall(LONG, BEGIN, theta)
    ended = fall(LONG, end, end) - fall(LONG, end, down)
    return begun + fall(SHORT, between, theta) + fall(SHORT, between, down) + ended


@scenario
def main(claim: Claims) -> None:
    angle, length = panels(("half a swing", "t [s]", "θ [rad]"), ("its length", "t [s]", "l [m]"))
    closed = within(1e-9, "s", because="the instants of jumps are unknowns, so arcs are smooth and of tenth order")
    flat = within(1e-6, "rad", because="the duration is stationary there, so its error 1e-13 is √1e-13 of the angle")
    for end in ENDS:
        goal = {"p_theta": 0, "theta": end}
        bounds = {"length": (SHORT, LONG)}
        motion = plan(
            "Pendulum", ["length"], start={"theta": -BEGIN}, end=goal, duration=(0.5, 3), minimize="time", bounds=bounds
        )
        turn = np.arccos(np.cos(end) + np.cos(BEGIN) - np.cos(switches(BEGIN, end)[0]))  # there it sits down at the end
        best: Any = minimize_scalar(duration, bounds=(0, turn), args=(end,), method="bounded", options={"xatol": 1e-11})
        claim(f"to {end} rad: the least time by elliptic integrals", motion.duration, best.fun, closed)
        run = motion.replay()
        found = run["theta"][np.searchsorted(run.time, motion.switches)]
        claim("... with the same instants", found, [-best.x, switches(best.x, end)[0]], flat)
        claim.verdicts += motion.verify() if end == ENDS[1] else []
        (line,) = angle.plot(run.time, run["theta"], label=f"to {end} rad")
        dots(angle, motion.switches, found, color=line.get_color(), markersize=8)
        length.plot(run.time, run["length"], drawstyle="steps-post")
