"""A hundred thousand pendulums on a shaken pivot draw the map of stability that Mathieu's a_m and b_m bound.

K Ex. 3, M 8.1.  With the pivot at z = (ε/2) cos 2t and l = 1 m, small swings obey θ'' + (δ - 2ε cos 2t) θ = 0, δ = g
in m/s².  Over the period π of the pivot the motion is a matrix of determinant 1; it is bounded where |trace| < 2.  An
ensemble of the very equations that the FMU has, two members a point of the map, gives the matrix at every point.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.special import mathieu_a, mathieu_b

from liaisons import Verdict, ensemble, grid, run_scenario, verdict
from liaisons.models import Pendulum, Sinusoid

STIFFNESS = np.linspace(-2.0, 10.0, 400)  # δ
DEPTH = np.linspace(0.02, 4.0, 250)  # ε
NEAR = 1e-9  # start [rad, rad/s]; what is not linear is of relative size NEAR²
STEP = np.pi / 80
CURVES = {("a", m): mathieu_a for m in range(5)} | {("b", m): mathieu_b for m in range(1, 5)}


def main(figure: Path) -> list[Verdict]:
    matrix, error = monodromy()
    trace, determinant = matrix[0, 0] + matrix[1, 1], matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    size = np.max(np.abs(matrix), axis=(0, 1))
    stable = np.abs(trace) < 2
    # What Mathieu's functions say, and how far a point is from the nearest boundary, in δ.
    edges = np.array([[curve(m, depth) for depth in DEPTH] for (_, m), curve in CURVES.items()])
    order = np.sort(edges, axis=0)
    inside = np.sum(order[:, None, :] < STIFFNESS[:, None], axis=0)  # boundaries left of a point: odd in a stable band
    near = np.min(np.abs(edges[:, None, :] - STIFFNESS[:, None]), axis=0)
    wrong = stable != (inside % 2 == 1)
    draw(figure, trace)
    return [
        verdict(
            f"{trace.size} points are stable or not as a_m and b_m say",
            error=float(np.max(near[wrong], initial=0.0)),
            tolerance=1e-6,
            reason="δ of the farthest point on the wrong side; a trace right to 1e-10 moves edges of tongues by 1e-6",
        ),
        verdict(
            "phase space keeps its area: the determinant is 1",
            error=float(np.max(np.abs(determinant - 1) / size**2)),
            tolerance=4e-10,
            reason="relative to the products of entries in it, each with the error below",
        ),
        verdict(
            "steps twice as long give the same matrix",
            error=float(np.max(error / size)),
            tolerance=1e-10,
            reason="relative; 80 steps of order 8 with frequencies below 4.3 /s, (4.3 π/80)^8 = 7e-7, coefficient 1e-6",
        ),
    ]


def monodromy() -> tuple[NDArray, NDArray]:
    """Matrix (start, θ or θ', δ, ε) of a period, and the largest error of its entries (δ, ε)."""
    points = grid({"gravity": STIFFNESS, "pivot_z.amplitude": DEPTH / 2})
    entries, errors = [], []
    for start in ({"theta_0": NEAR, "theta_dot_0": 0.0}, {"theta_0": 0.0, "theta_dot_0": NEAR}):
        found = ensemble(
            Pendulum,
            {**points, **start, "pivot_z.angular_frequency": 2.0, "pivot_z.phase": np.pi / 2},
            stop_time=np.pi,
            step_size=STEP,
            operators={"pivot_z": Sinusoid},
            record=["theta", "theta_dot"],
        )
        entries.append(found.values[:, -1] / NEAR)
        errors.append(np.maximum(found.error("theta"), found.error("theta_dot")) / NEAR)
    shape = len(STIFFNESS), len(DEPTH)
    return np.reshape(entries, (2, 2, *shape)), np.max(errors, axis=0).reshape(shape)


def draw(figure: Path, trace: NDArray) -> None:
    _, axis = plt.subplots(figsize=(8, 5), layout="constrained")
    growth = np.arccosh(np.maximum(np.abs(trace) / 2, 1)) / np.pi
    filled = axis.pcolormesh(STIFFNESS, DEPTH, growth.T, cmap="magma_r", shading="auto")
    plt.colorbar(filled, label="rate of growth [1/s]")
    for (name, m), curve in CURVES.items():
        axis.plot([curve(m, depth) for depth in DEPTH], DEPTH, color="tab:blue" if name == "a" else "tab:green", lw=0.8)
    axis.set(xlabel="δ", ylabel="ε", xlim=STIFFNESS[[0, -1]], title="blue a_m, green b_m; bounded where it is bright")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
