"""IFToMM benchmark A01: a pendulum let go horizontally, its place known to 1e-3 for 2000 s, in two descriptions.

1 kg on a massless rod of 1 m, g = 9.81 m/s², for 840 swings; the error of the benchmark is the root mean square over
4000 instants of the relative errors of x and z, coordinates below 1e-3 m counting as that (M. González et al., A
benchmarking system for MBS simulation software, 2005-2010).  `Pendulum` has one coordinate, `CartesianPendulum` three
and two constraints, as most codes have that the benchmark was made for.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import Verdict, fmu_path, run_scenario, simulate, verdict
from liaisons.models import Pendulum

DURATION, STEPS, THRESHOLD, ALLOWED = 2000.0, 4000, 1e-3, 1e-3
TOLERANCE = 1e-9


def main(figure: Path) -> list[Verdict]:
    step = DURATION / STEPS
    by_angle = simulate(
        fmu_path("Pendulum"), stop_time=DURATION, step_size=step, tolerance=TOLERANCE, theta_0=np.pi / 2
    )
    start: dict[str, Any] = {"x_0": 1.0, "z_0": 1.0, "height": 1.0}
    constrained = simulate(
        fmu_path("CartesianPendulum"), stop_time=DURATION, step_size=step, tolerance=TOLERANCE, **start
    )
    theta = Pendulum.exact(by_angle.time, theta_0=np.pi / 2)["theta"]
    exact = np.array([np.sin(theta), -np.cos(theta)])
    found = {
        "by its angle": np.array([by_angle["bob_x"], by_angle["bob_z"]]),
        "by its constraints": np.array([constrained["x"], constrained["z"] - 1.0]),
    }
    draw(figure, by_angle.time, {name: np.linalg.norm(place - exact, axis=0) for name, place in found.items()})
    energy = max(np.max(np.abs(result["energy"] - result["energy"][0])) for result in (by_angle, constrained))
    return [
        *(
            verdict(f"{name}: error of the benchmark", error=deviation(place, exact), tolerance=ALLOWED, reason="A01")
            for name, place in found.items()
        ),
        verdict(
            "energy, by either",
            error=float(energy),
            tolerance=10 * TOLERANCE * 9.81 * DURATION,
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
        verdict(
            "length of the rod",
            error=float(np.max(np.abs(np.hypot(*found["by its constraints"]) - 1.0))),
            tolerance=1e-14,
            unit="m",
            reason="projected after each step: rounding of lengths of order 1",
        ),
    ]


def deviation(found: NDArray, exact: NDArray) -> float:
    """The benchmark's error of coordinates (rows) over time."""
    relative = (found - exact) / np.maximum(np.abs(exact), THRESHOLD)
    return float(np.sqrt(np.mean(relative**2)))


def draw(figure: Path, time: NDArray, errors: dict[str, NDArray]) -> None:
    plt.figure(figsize=(8, 4), layout="constrained")
    for name, error in errors.items():
        plt.semilogy(time[1:], np.maximum.accumulate(error)[1:], label=name)
    plt.gca().set(xlabel="t [s]", ylabel="largest distance so far [m]", title="from the elliptic functions")
    plt.legend()
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
