"""An oscillator in the plane runs through one ellipse, whether it is told in x, y or in r, φ; p_φ is constant.

K Ex. 5, eq. 34-43.  φ is cyclic, and r obeys r'' - p_φ²/(m² r³) + Ω² r = 0: the centrifugal term is missing in the
printed eq. 43, by which r would swing through zero.  The two FMUs share not one equation of motion.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from liaisons import Result, Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import PlanarOscillator

BODY = {"mass": 0.8, "stiffness": 2.0}
OMEGA = np.sqrt(BODY["stiffness"] / BODY["mass"])
RADIUS, RATE = 1.0, 0.8  # r_0 and φ'_0, across the radius: an ellipse with the semi-axes 1 m and RATE/OMEGA
MOMENT = BODY["mass"] * RADIUS**2 * RATE
CARTESIAN = BODY | {"x_0": RADIUS, "y_dot_0": RADIUS * RATE}
POLAR = BODY | {"r_0": RADIUS, "phi_dot_0": RATE}
TOLERANCE = 1e-12


def run(name: str, step_size: float, starts: Any) -> Result:
    return simulate(fmu_path(name), stop_time=19 * np.pi / OMEGA, step_size=step_size, tolerance=TOLERANCE, **starts)


def main(figure: Path) -> list[Verdict]:
    planar, polar = run("PlanarOscillator", 0.02, CARTESIAN), run("PolarOscillator", 0.02, POLAR)
    half_periods = run("PolarOscillator", np.pi / OMEGA, POLAR)
    r, phi = polar["r"], polar["phi"]
    exact = PlanarOscillator.exact(planar.time, **CARTESIAN)
    x, y = r * np.cos(phi), r * np.sin(phi)
    amplification = f"10 x tolerance {TOLERANCE:g} x κ: a phase Ωt of 60 and (r_max/r_min)² = 4 amount to 100"
    verdicts = [
        verdict(
            "x, y: the closed form",
            error=max(max_error(planar[q], exact[q]) for q in ("x", "y")),
            tolerance=1e-9,
            unit="m",
            reason=amplification,
        ),
        verdict(
            "x, y and r, φ: the same trajectory",
            error=max(max_error(planar["x"], x), max_error(planar["y"], y)),
            tolerance=1e-9,
            unit="m",
            reason=amplification,
        ),
        verdict(
            "the orbit is the ellipse x² + (Ω y/φ'_0)² = r_0²",
            error=max_error(x**2 + (y * OMEGA / RATE) ** 2, RADIUS**2),
            tolerance=1e-9,
            unit="m2",
            reason=amplification,
        ),
        verdict(
            "p_φ of the one is the angular momentum of the other, and constant",
            error=max(max_error(polar["p_phi"], MOMENT), max_error(planar["angular_momentum"], MOMENT)),
            tolerance=1e-9,
            unit="kg.m2/s",
            reason=amplification,
        ),
        verdict(
            "φ grows by π in each half period",
            error=max_error(np.diff(half_periods["phi"]), np.pi),
            tolerance=1e-9,
            unit="rad",
            reason=amplification,
        ),
        verdict(
            "r'' - p_φ²/(m² r³) + Ω² r = 0",
            error=max_error(polar["r_ddot"] + OMEGA**2 * r, (polar["p_phi"] / BODY["mass"]) ** 2 / r**3),
            tolerance=1e-13,
            unit="m/s2",
            reason="an identity at each instant: roundings of accelerations of 8 m/s2",
        ),
    ]
    assert np.max(np.abs(polar["r_ddot"] + OMEGA**2 * r)) > 1, "K eq. 43 as printed is far from satisfied"
    draw(figure, planar, polar)
    return verdicts


def draw(figure: Path, planar: Result, polar: Result) -> None:
    shown = polar.time <= 3 * np.pi / OMEGA
    t, r, phi = polar.time[shown], polar["r"][shown], polar["phi"][shown]
    _, (plane, radius, angle) = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    plane.plot(planar["x"][shown], planar["y"][shown], label="x, y")
    once = phi < 2 * np.pi
    plane.plot((r * np.cos(phi))[once][::8], (r * np.sin(phi))[once][::8], "k.", label="r, φ")
    plane.plot(0, 0, "k+")
    plane.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", ylim=(-0.7, 1.0), title="one ellipse from two FMUs")
    plane.legend(loc="upper center", ncols=2)
    radius.plot(t, r, label="FMU")
    radius.plot(t, RADIUS * np.cos(OMEGA * t), "--", color="tab:red", label="K eq. 43 as printed")
    radius.axhline(0, color="0.7", linewidth=0.8)
    radius.set(xlabel="t [s]", ylabel="r [m]", ylim=(-1.1, 1.6), title="distance from the centre")
    radius.legend(loc="upper center", ncols=2)
    angle.plot(t, phi)
    angle.plot(np.arange(4) * np.pi / OMEGA, np.arange(4) * np.pi, "ko", label="π a half period")
    angle.set(xlabel="t [s]", ylabel="φ [rad]", title="angle, at constant p_φ")
    angle.legend(loc="upper left")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
