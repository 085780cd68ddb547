"""In a four-bar linkage, the rocker follows Freudenstein's equation, and the energy is the work done on the crank.

The fourth hinge of the FourBar closes the loop.  Of its five constraints, the FMU needs two; the others follow from the
parallel axes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import operator, simulate
from liaisons.models import FourBar
from liaisons.scenarios import Claims, dots, panels, scenario, within

RATE, TOLERANCE = 2.0, 1e-10


@scenario
def main(claim: Claims) -> None:
    start = float(np.asarray(FourBar.turn.start))
    h = 1e-5
    slope = {
        name: float((FourBar.freudenstein(start + h)[name] - FourBar.freudenstein(start - h)[name]) * RATE / (2 * h))
        for name in ("swing", "elbow")
    }
    rates: dict[str, Any] = {f"{name}_dot_0": rate for name, rate in slope.items()}
    crank = operator("Ramp", offset=start, rate=RATE)
    run = simulate("FourBar", stop_time=2 * np.pi, step_size=0.01, tolerance=TOLERANCE, turn=crank, **rates)
    exact = FourBar.freudenstein(run["turn"])
    closed = within(
        1e-7, "rad", because="loops are closed up to rounding; finite differences of rates at the start add 1e-10"
    )
    claim("rocker: Freudenstein's equation", np.unwrap(run["swing"]), np.unwrap(exact["swing"]), closed)
    claim("the constraints left out hold, too", len(FourBar.redundant), 3, within(0, because="a whole number"))
    claim.energy("the crank's work is the energy", run, tolerance=TOLERANCE)
    rocker, torque = panels(("rocker", "crank [rad]", "ψ [rad]"), ("torque of the operator", "crank [rad]", "λ [N m]"))
    rocker.plot(run["turn"], run["swing"], label="FMU")
    dots(rocker, run["turn"], exact["swing"], every=30, label="Freudenstein")
    torque.plot(run["turn"], run["turn_force"])
