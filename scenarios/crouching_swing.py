"""A swing is pumped by crouching and rising: each time 1 - cos θ_max is multiplied by (l_low/l_high)³.

The operator prescribes the length of a Pendulum (M 8.1): it becomes l_high when the child stands up at the lowest
point, and l_low when the child crouches at a turning point.  Since θ and p_θ are continuous through each jump, the
growth has a closed form, and the instants are elliptic integrals.  Scenario ``pumped_swing`` moves the length smoothly.
"""

from __future__ import annotations

import numpy as np

from liaisons import simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

LOW, HIGH = 1.1, 1.0  # distance of the centre of mass from the pivot, crouched and standing [m]
AMPLITUDE, HALF_SWINGS, TOLERANCE = 0.3, 10, 1e-11


@scenario
def main(claim: Claims) -> None:
    lengths = {"length_low": LOW, "length_high": HIGH}
    instants, amplitudes = Pendulum.crouch_schedule(HALF_SWINGS, theta_0=AMPLITUDE, **lengths)
    knots = np.append(0.0, instants)
    times = np.interp(np.arange(10 * instants.size + 1), 10 * np.arange(knots.size), knots)  # ten in each quarter swing

    def length(t: float) -> float:
        return HIGH if np.searchsorted(instants, t, side="right") % 2 else LOW  # at an instant the new length holds

    run = simulate("Pendulum", times=times, tolerance=TOLERANCE, inputs={"length": length}, theta_0=AMPLITUDE)
    lowest, turning = run["theta"][10::20], run["theta"][20::20]
    why = "errors at solver tolerance 1e-11 over 11 s, amplified less than 100-fold"
    growth = (1 - np.cos(turning)) / (1 - np.cos(amplitudes[1:]))
    claim(
        f"1 - cos θ_max grows {LOW / HIGH:g}³-fold in each of {HALF_SWINGS} half swings",
        growth,
        1.0,
        within(1e-8, because=why),
    )
    claim("θ = 0 at the instants that elliptic integrals give", lowest, 0.0, within(1e-8, "rad", because=why))
    claim.energy("the energy gained is the operator's work, impulses included", run, tolerance=TOLERANCE)

    angle, distance = panels(
        ("crouch and rise", "", "θ [deg]"),
        ("", "t [s]", "length [m]"),
        mosaic="a;b",
        size=(7, 5),
        sharex=True,
        height_ratios=[3, 1],
    )
    angle.plot(run.time, np.degrees(run["theta"]), label="FMU")
    signed = np.degrees(amplitudes[1:]) * (-1.0) ** np.arange(1, HALF_SWINGS + 1)
    dots(angle, instants[1::2], signed, label="closed form, (l_low/l_high)³")
    distance.plot(run.time, run["length"], color="tab:orange", drawstyle="steps-post")
