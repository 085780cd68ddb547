"""If a crane slews at a constant rate, its load hangs outwards by tan α = Ω² (R + (l + (I_t - I_a)/(m l)) sin α)/g.

The operator turns the tower of a SlewingCrane at the rate Ω; the trolley is at rest at the radius R.  The centre of
mass of the load is l below the trolley; its moments of inertia are I_t across the rope and I_a along it.  Started at
the angle α to the vertical that follows from Euler's equations, the load stays there.  As I_t > I_a, the rope hangs a
little farther outwards than that of a point mass.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import operator, simulate
from liaisons.models import SlewingCrane
from liaisons.scenarios import Claims, panels, scenario, within

RATES, RADIUS, TOLERANCE = (0.2, 0.3, 0.4), 12.0, 1e-11


@scenario
def main(claim: Claims) -> None:
    held = within(1e-8, "rad", because="errors at solver tolerance 1e-11 over ten swings of the load")
    (axis,) = panels(("deflection of the load", "rate of the tower [rad/s]", "α [deg]"), size=(6, 4))
    for rate in RATES:
        steady = SlewingCrane.steady_deflection(rate, travel=RADIUS)
        slew = operator("Ramp", rate=rate)
        start: dict[str, Any] = {"rope_y_0": steady["rope_y"], "travel": RADIUS, "rope_damping": 0.0}
        run = simulate("SlewingCrane", stop_time=60.0, step_size=0.05, tolerance=TOLERANCE, slew=slew, **start)
        claim(f"Ω = {rate} rad/s: the load stays at α", run["rope_y"], steady["rope_y"], held)
        claim.energy(f"Ω = {rate} rad/s: energy", run, tolerance=TOLERANCE)
        axis.plot(
            [rate], -np.degrees(run["rope_y"][-1:]), "o", color="tab:blue", label="FMU" if rate == RATES[0] else ""
        )
    rates = np.linspace(0.01, 0.45, 40)
    angles = [-np.degrees(SlewingCrane.steady_deflection(rate, travel=RADIUS)["rope_y"]) for rate in rates]
    axis.plot(rates, angles, color="black", label="Euler's equations")
    axis.legend()
