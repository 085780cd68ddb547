"""A ball bounces infinitely often in a finite time, and stays on a shaken table if and only if Aω² <= g.

Dropped from the height h on a table at rest, the ball comes to rest at t = √(2h/g) (1 + e)/(1 - e), the sum of all its
flight times.  On a table that moves as A sin ωt, the ball lifts off when the table's downward acceleration reaches g,
that is at sin ωt = 1/Γ, where Γ = Aω²/g.  It then follows a parabola.  ``impact_loss`` is the energy that the impacts
dissipate; ``work`` is the energy that the table supplies.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import operator, simulate
from liaisons.models import BouncingBall
from liaisons.scenarios import Claims, dots, panels, scenario, within

OMEGA, TOLERANCE = 10.0, 1e-12
DROPPED = ("height", "gap", "gap_rests_from", "impact_loss", "energy_balance")
SHAKEN = ("height", "gap", "energy_balance")


@scenario
def main(claim: Claims) -> None:
    falls, shaken = panels(("dropped", "t [s]", "height [m]"), ("on a shaken table", "t [s]", "distance [m]"))
    why = "parabolas are integrated exactly up to rounding; the instants of events are found on the dense output"
    exact = within(1e-10, "m", because=why)
    account = within(1e-10, "J", because="rounding errors of the energies, about 10 J")
    for bounce in (0.5, 0.8):
        run = simulate(
            "BouncingBall", stop_time=5.0, step_size=0.01, tolerance=TOLERANCE, record=DROPPED, bounce=bounce
        )
        expected = BouncingBall.exact(run.time, bounce=bounce)
        claim(f"e = {bounce}: the height, through all bounces", run["height"], expected["height"], exact)
        claim(f"e = {bounce}: the energy lost in impacts", run["impact_loss"], expected["impact_loss"], account)
        end = within(1e-10, "s", because="the infinitely many low bounces are summed as a series")
        rests = BouncingBall.rests_at(bounce=bounce)
        claim(f"e = {bounce}: at rest from {rests:.4f} s", run["gap_rests_from"][-1], rests, end)
        claim(f"e = {bounce}: energy balance", run["energy_balance"], 0.0, account)
        falls.plot(run.time, run["height"], label=f"e = {bounce}")
        dots(falls, run.time, expected["height"])

    for ratio in (0.99, 1.01, 1.5):
        amplitude = ratio * 9.81 / OMEGA**2
        table = operator("Sinusoid", amplitude=amplitude, angular_frequency=OMEGA)
        start = {"height_0": 0.0, "height_dot_0": amplitude * OMEGA}
        settings: Any = {"stop_time": 0.5, "step_size": 0.001, "tolerance": TOLERANCE, "record": SHAKEN}
        run = simulate("BouncingBall", table=table, start_values=start, **settings)
        leaves = BouncingBall.leaves_at(amplitude=amplitude, angular_frequency=OMEGA)
        claim(
            f"Γ = {ratio}: the ball is never inside the table",
            np.minimum(run["gap"], 0),
            0.0,
            within(1e-12, "m", because="rounding errors"),
        )
        if ratio < 1:
            claim(f"Γ = {ratio}: it never leaves", run["gap"], 0.0, within(1e-12, "m", because="rounding errors"))
        else:
            flies = run.time - leaves
            flies = flies[(flies > 0) & (flies < 0.05)]
            sine, cosine = np.sin(OMEGA * leaves), np.cos(OMEGA * leaves)
            parabola = amplitude * (sine + OMEGA * cosine * flies) - 9.81 / 2 * flies**2
            got = run["height"][(run.time > leaves) & (run.time < leaves + 0.05)]
            text = f"Γ = {ratio}: it leaves at sin ωt = 1/Γ, {leaves:.4f} s"
            why = "error of σ interpolated between communication points: (ωH)⁶ A/720"
            claim(text, got, parabola, within(1e-9, "m", because=why))
        shaken.plot(run.time, run["gap"], label=f"Γ = {ratio}")
