"""Of all accelerations along its circle, a pendulum has the one of least constraint: Gauss's principle.

K eq. 107.  If the acceleration of a CartesianPendulum is changed by ±δ along its circle, Gauss's function m/2 (a -
F/m)² grows by m δ²/2.  Scenario ``two_routes`` has the motion by Gauss's multipliers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import analysis, simulate
from liaisons.models import CartesianPendulum
from liaisons.scenarios import Claims, panels, scenario, within


@scenario
def main(claim: Claims) -> None:
    start: Any = {"x_0": np.sin(2.5), "z_0": 1 - np.cos(2.5)}
    run = simulate("CartesianPendulum", stop_time=60.0, step_size=0.02, tolerance=1e-11, **start)
    function = analysis.gauss_function(CartesianPendulum)

    def aside(delta: float) -> np.ndarray:
        return function.evaluate(x_ddot=run["x_ddot"] + delta * (1 - run["z"]), z_ddot=run["z_ddot"] + delta * run["x"])

    squares = within(1e-11, "N2/kg", because="rounding errors of the squares of forces of 60 N")
    for delta in (1.0, -1.0):
        text = f"Gauss's function is m δ²/2 more for another acceleration along the circle, δ = {delta:g} m/s2"
        claim(text, aside(delta) - aside(0.0), 0.5, squares)

    (axis,) = panels(("beside the motion", "δ [m/s2]", "Gauss's function beyond its least [N2/kg]"))
    deltas = np.linspace(-2, 2, 41)
    growth = np.array([aside(delta) - aside(0.0) for delta in deltas])
    axis.plot(deltas, deltas**2 / 2, color="0.6", label="m δ²/2")
    for k, i in enumerate((0, 100, 200)):  # each at every third δ, so that none hides another
        axis.plot(deltas[k::3], growth[k::3, i], "o", label=f"t = {run.time[i]:g} s")
