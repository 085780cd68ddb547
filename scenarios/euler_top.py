"""A free rigid body turns by Jacobi's elliptic functions, its attitude by an elliptic integral of the third kind.

M 8.3 with the wheels locked.  About the axes of the largest and the least moment the rotation is stable; started about
the middle axis the body turns over, and over again, after a time that grows with the logarithm of the disturbance.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import Result, Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import Satellite

MOMENTS = np.array([10.0, 12.0, 8.0])  # kg.m2: x is the middle axis
STARTS: dict[str, dict[str, Any]] = {
    "about the least axis": {"omega_x_0": 0.3, "omega_y_0": 0.2, "omega_z_0": 1.0},
    "about the largest axis": {"omega_x_0": 0.3, "omega_y_0": 1.0, "omega_z_0": 0.2},
    "about the middle axis": {"omega_x_0": 1.0, "omega_y_0": 1e-3, "omega_z_0": 1e-3},
}
RATES, QUATERNION, MOMENTA = (
    ("omega_x", "omega_y", "omega_z"),
    ("q_w", "q_x", "q_y", "q_z"),
    ("H_x", "H_y", "H_z"),
)
STOP, TOLERANCE = 300.0, 1e-13


def main(figure: Path) -> list[Verdict]:
    fmu = fmu_path("Satellite")
    results = {
        name: simulate(fmu, stop_time=STOP, step_size=0.1, tolerance=TOLERANCE, **start)
        for name, start in STARTS.items()
    }
    verdicts = []
    for name, result in results.items():
        exact = Satellite.exact(result.time, **STARTS[name])
        tolerance, reason = 1e-10, f"solver tolerance {TOLERANCE:g}, amplification below 100 over {STOP:g} s"
        if name == "about the middle axis":
            # How near the axis it comes back, ε, follows from ε² = a difference of energies: an error over ε².
            tolerance, reason = 10 * TOLERANCE / 1e-3**2, "10 x solver tolerance / (1e-3, distance from the axis)²"
        for kind, names in (("ω", RATES), ("attitude", QUATERNION)):
            error = max(max_error(result[signal], exact[signal]) for signal in names)
            verdicts.append(verdict(f"{name}: {kind}", error=error, tolerance=tolerance, reason=reason))
        R = Rotation.from_quat(np.array([result[q] for q in QUATERNION]).T, scalar_first=True)
        H = R.apply(np.array([result[w] for w in RATES]).T * MOMENTS)
        verdicts.append(
            verdict(
                f"{name}: R J ω stays where it was",
                error=max_error(H, np.broadcast_to(H[0], H.shape)),
                tolerance=1e-13,
                unit="kg.m2/s",
                reason="H is a state without a rate: roundings of 12 kg.m2/s",
            )
        )
    draw(figure, results)
    return verdicts


def draw(figure: Path, results: dict[str, Result]) -> None:
    plt.figure(figsize=(12, 4.8), layout="constrained")
    body = plt.subplot(1, 2, 1, projection="3d")
    for extreme, others in ((1, (0, 2)), (2, (0, 1))):
        for size in (0.2, 0.5, 0.8):
            for sign in (1, -1):
                # Started in the plane of the extreme and the middle axis, with the same |H|.
                H = np.zeros(3)
                H[extreme], H[others[0]] = sign * 10 * np.cos(size), 10 * np.sin(size)
                start = {f"{w}_0": float(h / J) for w, h, J in zip(RATES, H, MOMENTS, strict=True)}
                exact = Satellite.exact(np.linspace(0, 150, 1500), **start)
                body.plot(
                    *(exact[w] * J / 10 for w, J in zip(RATES, MOMENTS, strict=True)), color="grey", linewidth=0.4
                )
    for name, result in results.items():
        H = np.array([result[w] for w in RATES]).T * MOMENTS
        body.plot(*(H / np.linalg.norm(H[0])).T, linewidth=1.2, label=name)
    body.set(
        xlabel="x (middle)",
        ylabel="y (largest)",
        zlabel="z (least)",
        title="direction of H in the body",
        aspect="equal",
    )
    body.legend(fontsize=8, loc="upper left")
    over = plt.subplot(1, 2, 2)
    result = results["about the middle axis"]
    exact = Satellite.exact(result.time, **STARTS["about the middle axis"])
    for w in RATES:
        (line,) = over.plot(result.time, result[w], linewidth=0.9, label=w)
        over.plot(result.time[::50], exact[w][::50], ".", color=line.get_color(), markersize=4)
    over.set(xlabel="t [s]", ylabel="[rad/s]", title="about the middle axis (dots: elliptic functions)")
    over.legend(loc="center right", fontsize=8)
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
