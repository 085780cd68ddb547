"""The best half swing multiplies 1 - cos θ by (l_max/l_min)³: stand up at the lowest point, crouch when it turns.

M 8.1 with M 2: the length of a Pendulum may be anything between l_min and l_max, and may jump, for only l enters the
motion of (θ, p).  What is planned is the largest amplitude at the end of one half swing, with a free duration: the plan
finds by itself that the length switches once, where the swing passes its lowest point, as every child does.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Claims, dots, panels, plan, scenario, within

SHORT, LONG, AMPLITUDE = 1.0, 1.1, 0.5


@scenario
def main(claim: Claims) -> None:
    angle, length = panels(("half a swing", "t [s]", "θ [rad]"), ("its length", "t [s]", "l [m]"))
    goal: Any = {"start": {"theta": -AMPLITUDE}, "end": {"p_theta": 0, "theta": (0.3, 2)}, "duration": (0.5, 3)}
    versine = "-sin(theta)*theta_dot"  # what 1 - cos θ gains, to be large
    motion = plan("Pendulum", ["length"], minimize=versine, bounds={"length": (SHORT, LONG)}, **goal)
    run = motion.replay()
    ratio = (1 - np.cos(run["theta"][-1])) / (1 - np.cos(AMPLITUDE))
    mesh = within(1e-9, because="the instant of the switch is an unknown; arcs are smooth, of tenth order")
    claim("1 - cos θ grows by (l_max/l_min)³", ratio, (LONG / SHORT) ** 3, mesh)
    claim("the length switches once", motion.switches.size, 1, within(0, because="a count"))
    at_switch = run["theta"][np.searchsorted(run.time, motion.switches[0])]
    claim("... at the lowest point", at_switch, 0.0, within(1e-7, "rad", because="the cost is flat there: √1e-14"))
    claim.verdicts += motion.verify()
    angle.plot(run.time, run["theta"], label="FMU")
    dots(angle, run.time[-1:], np.arccos(1 - (1 - np.cos([AMPLITUDE])) * (LONG / SHORT) ** 3), label="closed form")
    length.plot(run.time, run["length"], drawstyle="steps-post")
