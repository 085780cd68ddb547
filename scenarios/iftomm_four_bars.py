"""IFToMM benchmark A02: parallelograms in a row swing through the horizontal, where their constraints lose rank.

Upright rods of 1 m and 1 kg, joined by such rods at their tops, fall over at 1 rad/s and turn for 20 s.  Whenever all
rods lie in line, each parallelogram could as well go on as a crossed one or fold about one pivot, and the forces that
prevent it have poles.  As parallelograms all rods turn by J θ'' = -G cos θ, like one pendulum; the equation of the
first rod alone says what force the lying rod then has to bring up.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import Result, Verdict, assemble, build, max_error, run_scenario, simulate, verdict
from liaisons.models import FourBars, four_bars

WINDOWS = (2, 6)
TOLERANCE, STOP, STEP = 1e-9, 20.0, 0.05
GRAVITY = 9.81


def run(component: type[FourBars]) -> Result:
    fmu = build(assemble(component))
    return simulate(fmu, stop_time=STOP, step_size=STEP, tolerance=TOLERANCE)


def angles(result: Result, windows: int) -> NDArray:
    return np.array([result[f"theta_{i}"] for i in range(windows + 1)])


def force(windows: int, theta: NDArray) -> NDArray:
    """λ_1 sin θ for m = l = 1: (1/3 + 1/2) θ'' = -g (1/2 + 1/2) cos θ + λ_1 sin θ with θ'' = -(G/J) cos θ."""
    inertia, weight = (windows + 1) / 3 + windows, GRAVITY * ((windows + 1) / 2 + windows)
    return (GRAVITY - 5 / 6 * weight / inertia) * np.cos(theta)


def main(figure: Path) -> list[Verdict]:
    verdicts = []
    picture, axes = plt.subplots(1, 2, figsize=(12, 4), layout="constrained")
    for windows in WINDOWS:
        component = four_bars(windows)
        result = run(component)
        exact = component.exact(result.time)["theta"]
        passages = int(np.sum(np.diff(np.floor(exact / np.pi)) != 0))
        found = angles(result, windows)
        energy = float(np.max(np.abs(result["energy"] - result["energy"][0])))
        scale = float(np.max(result["kinetic_energy"]))
        pull = result["lambda_rod_1"] * np.sin(exact)
        name = f"N = {windows}"
        verdicts += [
            verdict(
                f"{name}: {passages} singular configurations, all rods turn as one pendulum",
                error=max_error(found, np.broadcast_to(exact, found.shape)),
                tolerance=10 * TOLERANCE * STOP * float(np.max(np.abs(result["theta_0_dot"]))),
                unit="rad",
                reason="10 x tolerance x time x rate",
            ),
            verdict(
                f"{name}: energy",
                error=energy,
                tolerance=10 * TOLERANCE * scale * STOP,
                unit="J",
                reason="10 x tolerance x energy scale x time",
            ),
            verdict(
                f"{name}: the force on the first lying rod grows as 1/sin θ",
                error=max_error(pull, force(windows, exact)),
                tolerance=1e-4,
                unit="N",
                reason="as the angles, 1e-6 rad, times 10 N, times 10: 1/sin θ at most instants",
            ),
        ]
        axes[0].plot(result.time, np.cos(found[0]), label=name)
        axes[1].plot(result.time, result["lambda_rod_1"], ".-", linewidth=0.5, label=name)
    axes[0].set(xlabel="t [s]", ylabel="x of B$_0$ [m]", title="all rods turn as one pendulum")
    axes[1].set(xlabel="t [s]", ylabel="λ$_1$ [N]", title="force of the first lying rod")
    axes[1].set_yscale("symlog", linthresh=10)
    picture.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
