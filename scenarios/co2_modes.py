"""CO2 along its axis has three normal modes, with Ω = 0, √(κ/m), √(κ(1/m + 2/M)), and every motion is their sum.

K Ex. 11, eq. 152-158, with the masses of oxygen and carbon.  The eigenvalues of K eq. 156 are the squares of the
frequencies.  Each mode is started alone and its frequency read off the simulated motion; then one atom is struck, all
three modes sound together, and each keeps its energy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.interpolate import CubicHermiteSpline

from liaisons import Result, Verdict, analysis, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import LinearMolecule

OUTER, INNER, STIFFNESS, SPACING = 15.999, 12.011, 1.0, 0.116  # consistent units: only ratios matter
AMPLITUDE = 0.02
PICTURES = {1: "→ → →", 2: "←  |  →", 3: "→ ← →"}
RECORD = [form.format(k) for k in PICTURES for form in ("x_{}", "x_{}_dot", "p_x_{}", "mode_{}", "omega_{}")]


def run(stop_time: float, **starts: Any) -> Result:
    return simulate(
        fmu_path("LinearMolecule"), times=np.arange(0, stop_time, 0.05), tolerance=1e-11, record=RECORD, **starts
    )


def started_in(k: int) -> Result:
    """At rest, displaced along u_k; the translation is pushed instead."""
    u = AMPLITUDE * LinearMolecule.modes(mass_outer=OUTER, mass_inner=INNER)[:, k - 1]
    if k == 1:
        return run(100.0, x_1_0=0.0, **{f"x_{i + 1}_dot_0": 0.1 * u[i] for i in range(3)})
    return run(100.0, **{f"x_{i + 1}_0": i * SPACING + u[i] for i in range(3)})


def frequency(result: Result, k: int) -> float:
    """Of mode k, from the zeros of its normal coordinate; a cubic spline through q and q' locates them."""
    rates = np.linalg.solve(LinearMolecule.modes(), [result[f"x_{i}_dot"] for i in PICTURES])
    zeros = CubicHermiteSpline(result.time, result[f"mode_{k}"], rates[k - 1]).roots(extrapolate=False)
    return float(np.pi / np.mean(np.diff(zeros)))


def main(figure: Path) -> list[Verdict]:
    alone = {k: started_in(k) for k in PICTURES}
    struck = run(300.0, x_1_0=0.0, x_1_dot_0=0.01)
    squares = np.linalg.eigvalsh(mass_weighted_stiffness())
    verdicts = [
        verdict(
            "K eq. 156 is what the Lagrangian gives at its equilibrium",
            error=max_error(analysis.normal_modes(LinearMolecule, x_1=0.0).squares, squares),
            tolerance=1e-15,
            unit="rad2/s2",
            reason="eigenvalues of a matrix of order 0.2: roundings",
        )
    ]
    verdicts += [
        verdict(
            f"mode {k} {PICTURES[k]}: Ω = {np.sqrt(squares[k - 1]):.5f} rad/s, root of the eigenvalue",
            error=abs(frequency(alone[k], k) / np.sqrt(squares[k - 1]) - 1),
            tolerance=1e-9,
            reason="relative; solver tolerance 1e-11, spline error of the zeros (0.05 Ω)⁴/384",
        )
        for k in (2, 3)
    ]
    verdicts += [
        verdict(
            f"mode {k} {PICTURES[k]} started alone stays alone",
            error=max(max_error(alone[k][f"mode_{other}"], 0.0) for other in PICTURES if other != k),
            tolerance=1e-10,
            unit="m",
            reason="10 x tolerance 1e-11: linear equations mix modes by their errors only",
        )
        for k in PICTURES
    ]
    momentum = np.sum([struck[f"p_x_{i}"] for i in PICTURES], axis=0)
    exact = LinearMolecule.exact(struck.time, x_1_0=0.0, x_1_dot_0=0.01)
    verdicts += [
        verdict(
            "a struck molecule: the sum of three modes, each with its frequency",
            error=max(max_error(struck[name], exact[name]) for name in ("x_1", "x_2", "x_3")),
            tolerance=1e-9,
            unit="m",
            reason="10 x tolerance 1e-11 x 10: a phase Ωt of 140 in amplitudes of 0.1 m",
        ),
        verdict(
            "its total momentum stays, with each atom's own mass",
            error=max_error(momentum, momentum[0]),
            tolerance=1e-13,
            unit="kg.m/s",
            reason="the forces of a spring on its ends cancel: roundings",
        ),
    ]
    draw(figure, alone, struck)
    return verdicts


def mass_weighted_stiffness() -> np.ndarray:
    """K eq. 156, from eq. 154 and 155."""
    root = np.sqrt([OUTER, INNER, OUTER])
    return STIFFNESS * np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1]]) / np.outer(root, root)


def draw(figure: Path, alone: dict[int, Result], struck: Result) -> None:
    _, axes = plt.subplots(1, 4, figsize=(14, 4), sharey=True, layout="constrained")
    titles = {k: f"mode {k}: {picture}" for k, picture in PICTURES.items()} | {4: "left atom struck"}
    for axis, (k, title) in zip(axes, titles.items(), strict=True):
        result = alone.get(k, struck)
        shown = result.time <= 60
        for i, colour in zip(PICTURES, ("tab:red", "0.2", "tab:red"), strict=True):
            axis.plot(result[f"x_{i}"][shown], result.time[shown], color=colour)
        axis.set(title=title, xlabel="position [m]")
    axes[0].set_ylabel("t [s]")
    axes[0].legend(["O", "C"], loc="upper left")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
