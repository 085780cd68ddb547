"""A thermostat that fixes the kinetic energy keeps m v² = 3 k_B T at every instant, in a plane between two circles.

K Ex. 10: by Gauss's principle the friction is μ = -K r·r'/m v².  The motion stays in a plane and between two circles,
whose radii follow from Lambert's W, and L exp(-V/3 k_B T) is constant.  The thermostat of scenario ``nose_hoover``
keeps this value only on average.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Circle

from liaisons import simulate
from liaisons.models import IsokineticOscillator
from liaisons.scenarios import Claims, panels, scenario, within

ORBIT: Any = {"x_0": 1.0, "x_dot_0": 0.0, "y_dot_0": np.sqrt(1.5), "z_dot_0": np.sqrt(1.5)}  # m v² = 3 k_B T, both 1


@scenario
def main(claim: Claims) -> None:
    run = simulate("IsokineticOscillator", stop_time=60.0, step_size=0.02, tolerance=1e-11, **ORBIT)
    exact = IsokineticOscillator.exact(run.time, **ORBIT)
    why = "errors at solver tolerance 1e-11, amplified 100-fold over 60 s"
    r, v = (np.array([run[f"{q}{end}"] for q in "xyz"]) for end in ("", "_dot"))
    rounding = within(1e-14, "J", because="projected after each step: rounding errors of energies of 3 J")
    claim("m v² = 3 k_B T", np.sum(v**2, axis=0), 3.0, rounding)
    claim("position, by Lambert's W and quadrature", run, exact, within(1e-8, "m", because=why), names="xyz")
    claim("the friction μ", run["mu"], exact["mu"], within(1e-8, "1/s", because=why))
    kept = np.cross(r, v, axis=0) * np.exp(-np.sum(r**2, axis=0) / 6)
    claim("L exp(-V/3 k_B T) is constant", kept, kept[:, :1], within(1e-8, "J.s", because=why))
    inner, outer, half_period, _ = IsokineticOscillator.turning_points(position=r[:, 0], velocity=v[:, 0])
    distance = np.linalg.norm(r, axis=0)
    beyond = np.maximum(inner - distance, distance - outer)
    claim.below(f"r stays between {inner:.3f} and {outer:.3f} m", beyond, 0.0, within(1e-8, "m", because=why))
    turns = np.interp(half_period * np.arange(1, 20), run.time, np.sum(r * v, axis=0))
    chords = within(1e-3, "m2/s", because="r·r' between samples, h = 0.02 s: h²/8 times a second derivative of 10")
    claim(f"r turns every {half_period:.3f} s", turns, 0.0, chords)

    (path,) = panels(("constant speed: a rosette", "x [m]", "(y + z)/√2 [m]"))
    across = (run["y"] + run["z"]) / np.sqrt(2)  # the plane of the motion holds the x axis and (0, 1, 1)
    path.plot(run["x"], across, linewidth=0.6, label="FMU")
    for radius, label in ((inner, "circles of Lambert's W"), (outer, None)):
        path.add_patch(Circle((0, 0), radius, fill=False, color="grey", linestyle=":", label=label))
    path.set(aspect="equal")
