"""A pendulum on a shaken pivot falls out of step in tongues, which Mathieu's characteristic values a_m, b_m bound.

M 8.1(a), K Ex. 3.  With the pivot at z = (ε/2) cos 2t and l = 1 m small swings obey Mathieu's equation,

    θ'' + (δ - 2ε cos 2t) θ = 0,    δ = g in m/s²

whose motion over a period T = π is a matrix of determinant 1 (Floquet): bounded while |trace| < 2, that is, between a_m
and b_(m+1), and growing as e^(μt), cosh μT = |trace|/2, in between.  The matrix comes from two runs beside the
equilibrium, of a Pendulum that a Sinusoid shakes: a sweep of FMUs.  Weight upwards, δ < 0, is the pendulum that stands
on its pivot: the shaking can hold it up.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.special import mathieu_a, mathieu_b

from liaisons import System, Verdict, fmu_path, max_error, run_scenario, sweep, verdict

PERIOD, STEPS = np.pi, 40
NEAR = 1e-5  # start [rad, rad/s]; what is not linear is of relative size NEAR²
STIFFNESS = np.linspace(-1.45, 9.8, 25)  # δ
DEPTH = np.linspace(0.1, 4.1, 13)  # ε
CURVES = {(name, m): value for name, value in (("a", mathieu_a), ("b", mathieu_b)) for m in range(name == "b", 4)}


def monodromy(delta: NDArray, epsilon: NDArray) -> NDArray:
    """(θ, θ') after one period, per unit of each of them at its beginning; shape (points, 2, 2)."""
    system = System("shaken pendulum")
    pendulum = system.add("pendulum", fmu_path("Pendulum"), input_reconstruction=2)
    pivot = system.add("pivot", fmu_path("Sinusoid"), angular_frequency=2.0, phase=np.pi / 2)
    system.connect(pivot["y"], pendulum["pivot_z"])
    cases = {
        "pendulum.gravity": np.repeat(delta, 2),
        "pivot.amplitude": np.repeat(epsilon / 2, 2),
        "pendulum.theta_0": np.tile([NEAR, 0.0], delta.size),
        "pendulum.theta_dot_0": np.tile([0.0, NEAR], delta.size),
    }
    keep = ["pendulum.theta", "pendulum.theta_dot"]
    table = sweep(system, cases, keep, stop_time=PERIOD, step_size=PERIOD / STEPS, tolerance=1e-12)
    columns = np.stack([table[name] for name in keep], axis=-1).reshape(-1, 2, 2) / NEAR
    return columns.swapaxes(1, 2)


def is_bounded(delta: float, epsilon: float) -> bool:
    """Whether Mathieu's functions say so: a_m < δ < b_(m+1) for some m."""
    return any(mathieu_a(m, epsilon) < delta < mathieu_b(m + 1, epsilon) for m in range(4))


def main(figure: Path) -> list[Verdict]:
    grid = monodromy(np.tile(STIFFNESS, DEPTH.size), np.repeat(DEPTH, STIFFNESS.size))
    traces = np.trace(grid, axis1=1, axis2=2).reshape(DEPTH.size, STIFFNESS.size)
    expected = np.array([[is_bounded(delta, epsilon) for delta in STIFFNESS] for epsilon in DEPTH])
    upright = (STIFFNESS < 0) & (np.abs(traces) < 2)
    depths = np.array([0.5, 1.0, 2.0])
    edges = [(m, np.trace(monodromy(curve(m, depths), depths), axis1=1, axis2=2)) for (_, m), curve in CURVES.items()]
    draw(figure, traces)
    return [
        verdict(
            f"{traces.size} points of the map are stable or not as a_m, b_m say",
            error=float(np.sum((np.abs(traces) < 2) != expected)),
            tolerance=0,
            reason=f"a count; the nearest trace differs from 2 by {np.min(np.abs(np.abs(traces) - 2)):.2g}",
        ),
        verdict(
            "on the curves a_0 ... a_3, b_1 ... b_3 the trace is 2 (-1)^m",
            error=max(max_error(trace, 2 * (-1.0) ** m) for m, trace in edges),
            tolerance=1e-6,
            reason="tolerance 1e-12 of angles of 1 rad over NEAR, ten times",
        ),
        verdict(
            "the determinant is 1 everywhere (Liouville)",
            error=float(np.max(np.abs(np.linalg.det(grid) - 1) / np.sum(grid**2, axis=(1, 2)))),
            tolerance=1e-6,
            reason="relative to the squares of the entries; as above",
        ),
        verdict(
            f"{np.sum(upright)} points with δ < 0 are stable: the pendulum stands on its pivot",
            error=float(not np.any(upright)),
            tolerance=0,
            reason="a count",
        ),
    ]


def draw(figure: Path, traces: NDArray) -> None:
    _, axis = plt.subplots(figsize=(8, 5), layout="constrained")
    growth = np.arccosh(np.maximum(np.abs(traces) / 2, 1)) / PERIOD
    colours = axis.pcolormesh(STIFFNESS, DEPTH, np.where(growth > 0, growth, np.nan), cmap="viridis_r")
    plt.colorbar(colours, ax=axis, label="growth rate μ from FMUs [1/s]; white: bounded")
    epsilon = np.linspace(0, DEPTH[-1], 200)
    for (name, m), value in CURVES.items():
        axis.plot(value(m, epsilon), epsilon, "k" if name == "a" else "k--", linewidth=1)
        axis.annotate(f"{name}$_{m}$", (value(m, 3.6), 3.6), xytext=(3, 0), textcoords="offset points")
    axis.axvline(0, color="tab:gray", linewidth=0.6)
    axis.set(xlabel="δ", ylabel="ε", xlim=(STIFFNESS[0], STIFFNESS[-1]), title="θ'' + (δ - 2ε cos 2t) θ = 0")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
