"""A swing whose rope is let out slowly keeps its action, whatever it does with its energy and its amplitude.

M 8.1 with a SmoothStep that takes the length from 1 m to 2 m within T.  The action of a pendulum of fixed length, the
area of its orbit in phase space over 2π, is (8/π) m l² Ω (E(k) - (1 - k²) K(k)) where it swings, and for a turn, where
it goes round, (4/π) m l² Ω k E(1/k).  It is the same before and after, up to a power of 1/T that the jump of the fourth
derivative of the length leaves.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe, ellipk

from liaisons import Result, System, Verdict, fmu_path, run_scenario, verdict

GRAVITY = 9.81
SHORT, LONG = 1.0, 2.0  # length before and after [m]
DURATIONS = np.array([10.0, 20.0, 40.0, 80.0, 160.0])
STARTS = {"swinging": (2.0, 0.0), "going round": (0.0, 20.0)}  # θ, θ'


def action(result: Result) -> NDArray:
    """Action of the pendulum that the swing would be if its length were kept, at each instant; unit mass."""
    length, theta, rate = (result[f"swing.{name}"] for name in ("length", "theta", "theta_dot"))
    omega = np.sqrt(GRAVITY / length)
    m = np.sin(theta / 2) ** 2 + (rate / (2 * omega)) ** 2  # k²
    inside, outside = np.minimum(m, 1.0), np.minimum(1 / m, 1.0)
    swinging = 8 / np.pi * (ellipe(inside) - (1 - inside) * ellipk(np.where(m < 1, m, 0.0)))
    return length**2 * omega * np.where(m < 1, swinging, 4 / np.pi * np.sqrt(m) * ellipe(outside))


def let_out(duration: float, theta: float, rate: float) -> Result:
    system = System("adiabatic swing")
    start: dict[str, Any] = {"theta_0": theta, "theta_dot_0": rate, "length": SHORT, "input_reconstruction": 2}
    swing = system.add("swing", fmu_path("Pendulum"), **start)
    step = {"start_value": SHORT, "end_value": LONG, "duration": duration}
    system.connect(system.add("operator", fmu_path("SmoothStep"), **step)["y"], swing["length"])
    names = [f"swing.{name}" for name in ("length", "theta", "theta_dot", "energy", "energy_balance")]
    return system.simulate(duration, 0.05, tolerance=1e-12, record=names)


def main(figure: Path) -> list[Verdict]:
    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    verdicts = []
    for name, start in STARTS.items():
        changes = []
        for duration in DURATIONS:
            result = let_out(duration, *start)
            J = action(result)
            changes.append(abs(J[-1] / J[0] - 1))
            if duration == DURATIONS[1]:
                left.plot(result.time, J / J[0], label=f"action, {name}")
                left.plot(
                    result.time, result["swing.energy"] / result["swing.energy"][0], "--", label=f"energy, {name}"
                )
        right.loglog(DURATIONS, changes, "o-", label=name)
        verdicts += [
            verdict(
                f"{name}: the action after T = {DURATIONS[-1]:g} s is that before",
                error=float(changes[-1]),
                tolerance=1e-8,
                reason="relative; (T Ω)⁻⁴ · 840, from the jumps of the fourth derivative at both ends",
            ),
            verdict(
                f"{name}: the change falls at least as T⁻⁴, from T = 10 s to 160 s",
                error=float(changes[-1] / changes[0]),
                tolerance=16.0**-4,
                reason="the order of the first derivative of the length that jumps",
            ),
        ]
    left.set(xlabel="t [s]", title="T = 20 s: relative to the start")
    right.set(xlabel="T [s]", ylabel="relative change of the action", title="before and after")
    left.legend()
    right.legend()
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
