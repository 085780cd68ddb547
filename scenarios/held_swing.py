"""A periodic plan pumps a swing against friction: without feedback the swing drifts away, with feedback it comes back.

K Ex. 6 with M 8.1: a child raises and lowers itself so that a period ends as it began; ``plan`` finds the motion with
least ∫ l''² dt.  Near this motion, one period maps deviations of (θ, p_θ) by a matrix M, whose determinant is exp(-ηT)
by Liouville's theorem, whatever the child does.  So one multiplier may lie outside the unit circle, and does.  With
feedback of θ and p_θ all multipliers lie inside, and an error shrinks by the largest of them in each period.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from liaisons import hold, plan
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

START, OFF, FRICTION, ROUNDS = 0.5, 0.1, 0.1, 9
ROUND = float(Pendulum.period(theta_0=START, theta_dot_0=0.0, length=1.0, gravity=9.81))


@scenario
def main(claim: Claims) -> None:
    motion = plan(
        "Pendulum",
        "length",
        start={"theta": START, "length": 1.0},
        closed=["length", "theta", "p_theta"],
        duration=ROUND,
        minimize="length_ddot**2",
        bounds={"length": (0.7, 1.3)},
        friction=FRICTION,
    )
    claim.verdicts += motion.verify()
    held = hold(motion)
    alone = replace(held, gains=0 * held.gains)
    claim.verdicts += held.verify()
    M = alone.measured()[:2, :2]
    differences = within(1e-8, because="error of finite differences of 1e-5 on both sides of the motion")
    claim("Liouville: det M of the FMUs", np.linalg.det(M), np.exp(-FRICTION * ROUND), differences)
    free = np.abs(np.linalg.eigvals(M)).max()
    claim.below("by the plan alone an error grows: 1/|μ|", 1 / free, 1.0, within(0, because="an inequality"))

    ends = ROUND * np.arange(1, ROUNDS + 1)
    angle, rounds = panels(
        ("pumped against friction", "t [s]", "θ [rad]"), ("at the ends of rounds", "round", "|off| [rad]")
    )
    for regulator, label in ((held, "held"), (alone, "the plan alone")):
        run = regulator.simulate(ends[-1], theta_0=START + OFF)
        theta = regulator.deviation(run)[0, np.searchsorted(run.time, ends - 1e-6)]
        angle.plot(run.time, run["Pendulum.theta"], linewidth=0.8, label=label)
        rounds.semilogy(ends / ROUND, np.abs(theta), "o", label=label)
        if regulator is held:
            small = within(5e-3, because="terms beyond the linear ones at 1e-3 rad, and parts that shrink faster")
            claim("an error shrinks by μ a period", theta[-1] / theta[-2], np.abs(held.floquet_multipliers[0]), small)
    rounds.semilogy(ends / ROUND, OFF * np.abs(held.floquet_multipliers[0]) ** (ends / ROUND), label="predicted")
