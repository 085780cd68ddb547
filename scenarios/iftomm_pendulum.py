"""IFToMM benchmark A01: a pendulum released horizontally, its position right to 1e-3 for 2000 s, modelled in two ways.

A mass of 1 kg on a massless rod of 1 m makes 840 swings with g = 9.81 m/s².  The error of the benchmark is the root
mean square, over 4000 instants, of the relative errors of x and z, where coordinates below 1e-3 m are replaced by 1e-3
m (M. González et al., A benchmarking system for MBS simulation software, 2005-2010).  `Pendulum` has one coordinate;
`CartesianPendulum` has three and two constraints, like most of the codes for which the benchmark was made.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

SETTINGS: Any = {"stop_time": 2000.0, "step_size": 0.5, "tolerance": 1e-9}


@scenario
def main(claim: Claims) -> None:
    (axis,) = panels(("from the elliptic functions", "t [s]", "largest distance so far [m]"), size=(8, 4))
    by_angle = simulate("Pendulum", theta_0=np.pi / 2, **SETTINGS)
    constrained = simulate("CartesianPendulum", x_0=1.0, z_0=1.0, height=1.0, **SETTINGS)
    theta = Pendulum.exact(by_angle.time, theta_0=np.pi / 2)["theta"]
    exact = np.array([np.sin(theta), -np.cos(theta)])
    found = {
        "by its angle": np.array([by_angle["bob_x"], by_angle["bob_z"]]),
        "by its constraints": np.array([constrained["x"], constrained["z"] - 1.0]),
    }
    for name, place in found.items():
        relative = (place - exact) / np.maximum(np.abs(exact), 1e-3)
        claim(f"{name}: error of the benchmark", np.sqrt(np.mean(relative**2)), 0.0, within(1e-3, because="set by A01"))
        distance = np.linalg.norm(place - exact, axis=0)
        axis.semilogy(by_angle.time[1:], np.maximum.accumulate(distance)[1:], label=name)
    claim.energy("energy, in both models", by_angle, constrained, tolerance=SETTINGS["tolerance"])
    rounding = within(1e-14, "m", because="projected after each step: rounding errors of lengths of about 1 m")
    claim("length of the rod", np.hypot(*found["by its constraints"]), 1.0, rounding)
