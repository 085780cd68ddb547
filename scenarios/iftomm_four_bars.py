"""IFToMM benchmark A02: parallelograms in a row swing through the horizontal, where their constraints lose rank.

Upright rods of 1 m and 1 kg, joined by equal rods at their tops, start at 1 rad/s, fall over and turn for 20 s.
Whenever all rods are in line, each parallelogram could also continue as a crossed one or fold about one pivot, and the
forces that prevent this have poles.  As parallelograms, all rods turn by J θ'' = -G cos θ, like one pendulum; the
equation of the first rod alone gives the force in the horizontal rod.
"""

from __future__ import annotations

import numpy as np

from liaisons import simulate
from liaisons.models import four_bars
from liaisons.scenarios import Claims, panels, scenario, within

TOLERANCE, STOP = 1e-9, 20.0


@scenario
def main(claim: Claims) -> None:
    motion, force = panels(
        ("all rods turn as one pendulum", "t [s]", "x of B$_0$ [m]"),
        ("force of the first horizontal rod", "t [s]", "λ$_1$ [N]"),
        mosaic="a;b",
        size=(9.0, 6.5),
    )
    pole = within(1e-4, "N", because="error 1e-6 rad of the angles, times 10 N, times 10 for 1/sin θ at most instants")
    for windows in (2, 6):
        component = four_bars(windows)
        run = simulate(component, stop_time=STOP, step_size=0.05, tolerance=TOLERANCE)
        exact = component.exact(run.time)["theta"]
        passages = np.count_nonzero(np.diff(np.floor(exact / np.pi)))
        rate = np.max(np.abs(run["theta_0_dot"]))
        turning = within(10 * TOLERANCE * STOP * rate, "rad", because="10 times tolerance, times duration, times rate")
        text = f"N = {windows}: {passages} singular configurations, all rods turn as one pendulum"
        claim(text, [run[f"theta_{i}"] for i in range(windows + 1)], exact, turning)
        claim.energy(f"N = {windows}: energy", run, tolerance=TOLERANCE)
        pull = run["lambda_rod_1"] * np.sin(exact)
        claim(f"N = {windows}: force on the first horizontal rod ~ 1/sin θ", pull, component.pull(exact), pole)
        motion.plot(run.time, np.cos(run["theta_0"]), label=f"N = {windows}")
        force.plot(run.time, run["lambda_rod_1"], ".-", linewidth=0.8, markersize=3, label=f"N = {windows}")
    force.set_yscale("symlog", linthresh=10)
