"""A hanging chain swings in as many modes as it has links, with Ω² = g/l times the zeros of a Laguerre polynomial.

K 2.2 for any number of links; its small motions are D. Bernoulli's, of 1732.  All modes of ten links are started at
once, slightly, and told apart by projection.  A shaken pivot then drives the chain, at the frequency of its second
mode, to a motion that is not small: the energy gained is the operator's work.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import PendulumChain

N = 10
SMALL = 1e-5  # of each mode [rad]
STEP = 0.1  # [s]; less than half the shortest period


def angles(result: Result, name: str = "theta[{}]") -> NDArray:
    return np.array([result[name.format(j)] for j in range(1, N + 1)])


def frequencies(q: NDArray) -> NDArray:
    """Of the rows of q, each a cosine: q(t + h) + q(t - h) = 2 cos(Ωh) q(t), by least squares."""
    around, middle = q[:, 2:] + q[:, :-2], q[:, 1:-1]
    return np.arccos(np.sum(around * middle, axis=1) / np.sum(middle**2, axis=1) / 2) / STEP


def main(figure: Path) -> list[Verdict]:
    chain = fmu_path("PendulumChain", n=N)
    expected, modes = PendulumChain.normal_modes(n=N)
    modes = modes / np.max(np.abs(modes), axis=0)
    start = SMALL * modes.sum(axis=1)
    small = simulate(chain, stop_time=60.0, step_size=STEP, tolerance=1e-13, theta_0=start)
    q = np.linalg.solve(modes, angles(small))
    exact = PendulumChain.small_angles(small.time, theta_0=start)
    system = System("shaken chain")
    links: dict[str, Any] = {"theta_0": 0.0, "input_reconstruction": 2}
    masses = system.add("chain", chain, **links)
    sine = {"amplitude": 0.05, "angular_frequency": float(expected[1])}
    system.connect(system.add("operator", fmu_path("Sinusoid"), **sine)["y"], masses["pivot_x"])
    driven = system.simulate(20.0, 0.02, tolerance=1e-10)
    scale = float(np.max(np.abs(driven["chain.work"])) + np.max(driven["chain.kinetic_energy"]))
    largest = np.max(np.abs(angles(driven, "chain.theta[{}]")))
    draw(figure, modes, expected, driven)
    return [
        verdict(
            f"{N} modes: Ω² l/g are the zeros of the Laguerre polynomial",
            error=max_error(frequencies(q), expected),
            tolerance=1e-6,
            unit="rad/s",
            reason="(Nθ)², 1e-8, and tolerance 1e-13 over 1e-5 rad, both over h sin Ωh = 0.01",
        ),
        verdict(
            "the motion is their sum",
            error=max_error(angles(small), exact["theta"].T) / SMALL,
            tolerance=1e-5,
            reason="relative; (Nθ)² = 1e-8 of a phase Ωt of 1000",
        ),
        verdict(
            f"shaken, its links turn by up to {np.degrees(largest):.0f}°: the energy gained is work",
            error=float(np.max(np.abs(driven["chain.energy_balance"]))),
            tolerance=10 * 1e-10 * scale * 20.0,
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
    ]


def draw(figure: Path, modes: NDArray, frequency: NDArray, driven: Result) -> None:
    _, (shapes, motion) = plt.subplots(1, 2, figsize=(10, 5), layout="constrained")
    depth = -np.arange(N + 1)
    for k in range(4):
        x = np.concatenate([[0.0], np.cumsum(modes[:, k])])
        shapes.plot(2.5 * k + x / np.max(np.abs(x)), depth, "o-", markersize=3)
    shapes.set_xticks(2.5 * np.arange(4), [f"{f:.2f} rad/s" for f in frequency[:4]])
    shapes.set(ylabel="z [m]", title="the four slowest modes")
    theta, pivot = angles(driven, "chain.theta[{}]"), driven["chain.pivot_x"]
    for i in range(driven.time.size - 200, driven.time.size, 10):
        x = np.concatenate([[0.0], np.cumsum(np.sin(theta[:, i]))]) + pivot[i]
        z = -np.concatenate([[0.0], np.cumsum(np.cos(theta[:, i]))])
        motion.plot(x, z, color="tab:blue", alpha=0.4, linewidth=0.8)
    motion.set(xlabel="x [m]", ylabel="z [m]", title="shaken at the second frequency: the last 4 s")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
