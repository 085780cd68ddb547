"""Where the potential is homogeneous of degree h, motions of size λ take λ^(1-h/2) times as long, and 2T̄ = h V̄.

K 2.5 and 2.7.  The degree comes from the Lagrangian: h = 2 for an oscillator in the plane, whose period does not know
its amplitude; h = 1 for free fall, whose duration goes as the root of the height; h = -1 for a planet, Kepler's third
law.  Each FMU is started twice, lengths by λ and speeds by λ^(h/2) larger the second time: it has to run through the
same path, λ times as large, in its own time.  The virial theorem holds for any time τ, if p·r is kept at the ends.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from liaisons import Mechanism, Result, Verdict, analysis, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import FreeParticle, KeplerOrbit, PlanarOscillator

RATIO = 3.0  # λ
DURATION, STEPS = 2 * np.pi, 400  # of the first motion [s]
Start = dict[str, float]
SYSTEMS: dict[type[Mechanism], tuple[int, Start]] = {
    PlanarOscillator: (2, {"x_0": 1.0, "y_dot_0": 0.5}),
    FreeParticle: (1, {"x_0": 0.0, "z_0": 0.0, "x_dot_0": 4.0, "z_dot_0": 20.0}),
    KeplerOrbit: (-1, {"x_0": 1.0, "y_dot_0": 1.2}),
}


def run(component: type[Mechanism], start: Start, duration: float) -> Result:
    starts: dict[str, Any] = dict(start)
    return simulate(
        fmu_path(component.__name__), stop_time=duration, step_size=duration / STEPS, tolerance=1e-12, **starts
    )


def enlarged(start: Start, h: int) -> Start:
    """Lengths times λ, rates times λ^(h/2)."""
    return {name: value * RATIO ** (h / 2 if name.endswith("_dot_0") else 1) for name, value in start.items()}


def main(figure: Path) -> list[Verdict]:
    verdicts = []
    picture, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    for axis, (component, (h, start)) in zip(axes, SYSTEMS.items(), strict=True):
        name, similarity = component.__name__, analysis.similarity(component)
        ratio = float(similarity.time_ratio(RATIO))
        small, large = run(component, start, DURATION), run(component, enlarged(start, h), ratio * DURATION)
        lengths = [q.name for q in component.coordinates]
        size = RATIO * max(float(np.max(np.abs(small[q]))) for q in lengths)
        motion = {f"{q}{end}": small[f"{q}{end}"] for q in lengths for end in ("", "_dot")}
        means = analysis.virial(component, small.time, motion)
        verdicts += [
            verdict(
                f"{name}: V is of degree h = {h}, times go as λ^({similarity.time_exponent:g})",
                error=abs(similarity.degree - h),
                tolerance=1e-12,
                reason="Euler's theorem at random states: roundings",
            ),
            verdict(
                f"{name}: {RATIO:g} times as large it takes {ratio:.3f} times as long",
                error=max(max_error(large[q], RATIO * small[q]) for q in lengths) / size,
                tolerance=1e-10,
                reason="relative to the size; tolerance 1e-12, no more than two revolutions",
            ),
            verdict(
                f"{name}: 2T̄ = h V̄ + [p·r]/τ over τ = {DURATION:.3f} s",
                error=abs(2 * means.kinetic - h * means.potential - means.boundary) / means.kinetic,
                tolerance=1e-7,
                reason=f"relative; quadrature of fourth order, (2·2π/{STEPS})⁴/720 at two and more turns a second",
            ),
        ]
        first, second = lengths[0], lengths[-1]
        for result, label in ((small, "λ = 1"), (large, f"λ = {RATIO:g}")):
            (line,) = axis.plot(result[first], result[second], linewidth=0.8, label=label)
            axis.plot(result[first][::25], result[second][::25], ".", color=line.get_color())
        axis.set_aspect("equal", adjustable="datalim")
        axis.set(xlabel=f"{first} [m]", ylabel=f"{second} [m]", title=f"{name}: h = {h}, τ'/τ = {ratio:.2f}")
    picture.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
