"""A bob swung up on a string leaves its circle at the height (v² - 2gl)/3g, flies freely, and is caught with a tug.

Let v be the speed at the lowest point, 2gl < v² < 5gl.  From the angle ψ above the horizontal the bob flies for the
time 4 u cos ψ/g, u² = gl sin ψ, and meets the circle at -3ψ, where an inelastic string removes the radial part of its
velocity.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import simulate
from liaisons.models import StringPendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

RECORD = ("x", "z", "x_dot", "z_dot", "slack", "slack_force", "impact_loss", "energy_balance")


@scenario
def main(claim: Claims) -> None:
    path, force = panels(("path", "x [m]", "z [m]"), ("the string pulls or is slack", "t [s]", "force [N]"))
    metres = within(1e-9, "m", because="errors at solver tolerance 1e-13, amplified 100-fold by flights and tugs")
    joules = within(1e-9, "J", because="the same errors, for energies of 20 J")
    for speed in (5.0, 6.0, 6.6):
        start: Any = {"x_0": 0.0, "z_0": -1.0, "x_dot_0": speed}
        run = simulate("StringPendulum", stop_time=2.0, step_size=0.005, tolerance=1e-13, record=RECORD, **start)
        expected = StringPendulum.exact(run.time, **start)
        claim(f"v = {speed}: x, z", run, {name: expected[name] for name in ("x", "z")}, metres)
        claim(f"v = {speed}: energy lost in the tugs", run["impact_loss"], expected["impact_loss"], joules)
        claim(f"v = {speed}: energy balance", run["energy_balance"], 0.0, joules)
        first = int(np.argmax(run["slack"] > 1e-9))
        height = StringPendulum.slack_height(speed)
        # As long as it is taut, x² + z² = 1; from the parabola behind it the height at which that begins.
        rate = np.sqrt(9.81 * height)
        claim(
            f"v = {speed}: slack at {height:.4f} m",
            run["z"][first] >= height and run["z"][first - 1] <= height,
            True,
            within(0.0, because="an inequality between two communication points"),
        )
        speed_there = np.hypot(run["x_dot"][first], run["z_dot"][first])
        energy = within(1e-9, "m2/s2", because="the same errors, for the energy of the flight")
        claim(
            f"v = {speed}: it leaves with √(gh)",
            speed_there**2 / 2 + 9.81 * (run["z"][first] - height),
            rate**2 / 2,
            energy,
        )
        path.plot(run["x"], run["z"], label=f"v = {speed} m/s")
        dots(path, expected["x"], expected["z"])
        force.plot(run.time, run["slack_force"])
    path.set_aspect("equal")
