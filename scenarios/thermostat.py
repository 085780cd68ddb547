"""A thermostat that fixes the kinetic energy holds m v² = 3 k_B T at every instant, one with inertia on the average.

K Ex. 10: Gauss's principle, friction μ = -K r·r'/m v²; the motion stays in a plane and between two circles that
Lambert's W gives, L exp(-V/3 k_B T) is constant.  K 4.2: Nosé and Hoover's friction ξ follows the temperature, and an
extended energy is constant, for ever, even where the motion is chaotic.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Circle

from liaisons import Result, Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import IsokineticOscillator

ORBIT: dict[str, Any] = {
    "x_0": 1.0,
    "x_dot_0": 0.0,
    "y_dot_0": np.sqrt(1.5),
    "z_dot_0": np.sqrt(1.5),
}  # m v² = 3 k_B T, m = k_B T = 1
CHAOS: dict[str, Any] = {"q_0": 0.0, "q_dot_0": 5.0}
TOLERANCE, LONG = 1e-11, 2000.0


def main(figure: Path) -> list[Verdict]:
    fixed = simulate(fmu_path("IsokineticOscillator"), stop_time=60.0, step_size=0.02, tolerance=TOLERANCE, **ORBIT)
    moving = simulate(fmu_path("NoseHooverOscillator"), stop_time=LONG, step_size=0.05, tolerance=TOLERANCE, **CHAOS)
    draw(figure, fixed, moving)
    return [*judge_fixed(fixed), *judge_moving(moving)]


def judge_fixed(result: Result) -> list[Verdict]:
    exact = IsokineticOscillator.exact(result.time, **ORBIT)
    r, v = (np.array([result[f"{q}{end}"] for q in "xyz"]) for end in ("", "_dot"))
    invariant = np.cross(r, v, axis=0) * np.exp(-np.sum(r**2, axis=0) / 6)
    inner, outer, half_period, _ = IsokineticOscillator.turning_points(position=r[:, 0], velocity=v[:, 0])
    distance = np.linalg.norm(r, axis=0)
    turns = np.interp(half_period * np.arange(1, 20), result.time, np.sum(r * v, axis=0))
    why = f"solver tolerance {TOLERANCE:g}, amplification of 100 over 60 s"
    return [
        verdict("isokinetic: m v² = 3 k_B T", error=max_error(np.sum(v**2, axis=0), 3.0), tolerance=1e-14, unit="J"),
        verdict(
            "isokinetic: position, by Lambert's W and quadrature",
            error=max(max_error(result[q], exact[q]) for q in "xyz"),
            tolerance=1e-8,
            unit="m",
            reason=why,
        ),
        verdict("isokinetic: μ", error=max_error(result["mu"], exact["mu"]), tolerance=1e-8, unit="1/s", reason=why),
        verdict(
            "isokinetic: L exp(-V/3 k_B T) is constant",
            error=max_error(invariant, np.repeat(invariant[:, :1], result.time.size, axis=1)),
            tolerance=1e-8,
            unit="J.s",
            reason=why,
        ),
        verdict(
            f"isokinetic: r stays between {inner:.3f} and {outer:.3f} m",
            error=max(0.0, inner - distance.min(), distance.max() - outer),
            tolerance=1e-8,
            unit="m",
            reason=why,
        ),
        verdict(
            f"isokinetic: r turns every {half_period:.3f} s",
            error=max_error(turns, 0.0),
            tolerance=1e-3,
            unit="m2/s",
            reason="r·r' read between samples 0.02 s apart: h²/8 times a second derivative of 10",
        ),
    ]


def judge_moving(result: Result) -> list[Verdict]:
    extended = result["extended_energy"]
    mean = np.trapezoid(2 * result["kinetic_energy"], result.time) / LONG
    scale = float(np.max(result["energy"]))
    rest = (result["xi"][-1] - result["xi"][0]) / LONG
    return [
        verdict(
            f"Nosé-Hoover: extended energy over {LONG:g} s in the chaotic sea",
            error=max_error(extended, extended[0]),
            tolerance=10 * TOLERANCE * scale * LONG,
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
        verdict(
            "Nosé-Hoover: mean of m q'² is k_B T + Q Δξ/τ, so k_B T in the end",
            error=abs(mean - 1 - rest),
            tolerance=1e-3,
            unit="J",
            reason="trapezoids of 0.05 s: their error h²/12 (m q'²)'' averages out to the ends of the run",
        ),
    ]


def draw(figure: Path, fixed: Result, moving: Result) -> None:
    _, (path, phase, energy) = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained")
    across = (fixed["y"] + fixed["z"]) / np.sqrt(2)  # the plane of the motion holds the x axis and (0, 1, 1)
    path.plot(fixed["x"], across, linewidth=0.6)
    r = np.hypot(fixed["x"], across)
    for radius in (r.min(), r.max()):
        path.add_patch(Circle((0, 0), radius, fill=False, color="grey", linestyle=":"))
    path.set(aspect="equal", xlabel="x [m]", ylabel="(y + z)/√2 [m]", title="constant speed: a rosette")
    phase.plot(moving["q"][:8000], moving["q_dot"][:8000], linewidth=0.25)
    phase.set(xlabel="q [m]", ylabel="q' [m/s]", title="Nosé-Hoover, 400 s in the chaotic sea")
    shown = moving.time <= 60
    for name, label in (("energy", "T + V"), ("extended_energy", "with the thermostat")):
        energy.plot(moving.time[shown], moving[name][shown], label=label)
    energy.set(xlabel="t [s]", ylabel="energy [J]", title="Nosé-Hoover")
    energy.legend(loc="center right")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
