"""If the potential is homogeneous of degree h, motions λ times as large take λ^(1-h/2) times as long, and 2T̄ = h V̄.

K 2.5 and 2.7.  The degree is computed from the Lagrangian: h = 2 for an oscillator in the plane, whose period does not
depend on its amplitude; h = 1 for free fall, whose duration is proportional to the root of the height; h = -1 for a
planet, with Kepler's third law.  Each FMU is started twice, the second time with lengths larger by λ and speeds larger
by λ^(h/2).  It must then follow the same path, λ times as large, in the scaled time.  The virial theorem holds for any
time τ if p·r at the ends is included.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import analysis, simulate
from liaisons.models import FreeParticle, KeplerOrbit, PlanarOscillator
from liaisons.scenarios import Claims, dots, panels, scenario, within

RATIO, TAU, STEPS = 3.0, 2 * np.pi, 400  # λ, duration of the first motion [s]
SYSTEMS: Any = {
    PlanarOscillator: (2, {"x_0": 1.0, "y_dot_0": 0.5}),
    FreeParticle: (1, {"x_0": 0.0, "z_0": 0.0, "x_dot_0": 20.0, "z_dot_0": 30.8}),
    KeplerOrbit: (-1, {"x_0": 1.0, "y_dot_0": 1.2}),
}


@scenario
def main(claim: Claims) -> None:
    euler = within(1e-12, because="rounding errors of Euler's theorem at random states")
    solver = within(1e-10, because="errors relative to the size, at tolerance 1e-12, over at most two revolutions")
    why = f"relative error of quadrature of fourth order, (2·2π/{STEPS})⁴/720 at two and more turns a second"
    axes = panels(*((f"{component.__name__}: h = {h}", "x [m]", "y, z [m]") for component, (h, _) in SYSTEMS.items()))
    for axis, (component, (h, start)) in zip(axes, SYSTEMS.items(), strict=True):
        name, similarity = component.__name__, analysis.similarity(component)
        text = f"{name}: V is of degree h = {h}, times go as λ^({similarity.time_exponent:g})"
        claim(text, similarity.degree, h, euler)

        ratio = float(similarity.time_ratio(RATIO))
        larger = {key: value * RATIO ** (h / 2 if key.endswith("_dot_0") else 1) for key, value in start.items()}
        small, large = (
            simulate(component, stop_time=T, step_size=T / STEPS, tolerance=1e-12, **values)
            for T, values in ((TAU, start), (ratio * TAU, larger))
        )
        lengths = [q.name for q in component.coordinates]
        path, enlarged = (np.array([run[q] for q in lengths]) for run in (small, large))
        size = RATIO * np.max(np.abs(path))
        text = f"{name}: {RATIO:g} times as large it takes {ratio:.3f} times as long"
        claim(text, enlarged / size, RATIO * path / size, solver)

        motion = {f"{q}{end}": small[f"{q}{end}"] for q in lengths for end in ("", "_dot")}
        means = analysis.virial(component, small.time, motion)
        balance = (2 * means.kinetic - h * means.potential - means.boundary) / means.kinetic
        claim(f"{name}: 2T̄ = h V̄ + [p·r]/τ over τ = {TAU:.3f} s", balance, 0.0, within(1e-7, because=why))
        for run, label in ((small, "λ = 1"), (large, f"λ = {RATIO:g}")):
            (line,) = axis.plot(run[lengths[0]], run[lengths[-1]], linewidth=0.8, label=label)
            dots(axis, run[lengths[0]], run[lengths[-1]], every=25, color=line.get_color())
        axis.set_aspect("equal", adjustable="datalim")
