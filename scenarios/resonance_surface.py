"""A driven oscillator's amplitude over frequency and damping is the surface of K eq. 121, by a sweep of FMUs.

K 5.1, ω_0 = 1 rad/s, a force of 1 N.  A Sinusoid moves the support of an Oscillator of unit stiffness; each case runs
until the transient has died and keeps the amplitude that fits the last periods.  The ridge follows the corrected
ω_res = √(ω_0² - γ²/2) and ends where γ = √2 ω_0.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from liaisons import Result, System, Verdict, fmu_path, grid, max_error, run_scenario, sweep, verdict
from liaisons.models import Oscillator

FREQUENCIES = np.linspace(0.3, 2.0, 24)
DAMPINGS = np.linspace(0.3, 2.1, 13)
# The slowest transients decay like exp(-γt/2), γ = 0.3, and, over-damped, γ = 2.1, exp(-0.73 t): below 1e-7 at 110 s.
SETTLED, STOP, STEP = 110.0, 140.0, 0.1


def amplitude(result: Result) -> float:
    """Of x = a sin ωt + b ω cos ωt, fitted to the last periods."""
    last = result.time >= SETTLED
    drive, rate, acceleration = (result[f"drive.{name}"][last] for name in ("y", "y_dot", "y_ddot"))
    (sine, cosine), *_ = np.linalg.lstsq(np.column_stack([drive, rate]), result["oscillator.x"][last])
    square = -(drive @ acceleration) / (drive @ drive)  # ω²
    return float(np.sqrt(sine**2 + square * cosine**2))


def main(figure: Path) -> list[Verdict]:
    system = System("resonance")
    oscillator = system.add("oscillator", fmu_path("Oscillator"), x_0=0.0, input_reconstruction=2)
    drive = system.add("drive", fmu_path("Sinusoid"))
    system.connect(drive["y"], oscillator["support"])
    table = sweep(
        system,
        grid({"drive.angular_frequency": FREQUENCIES, "oscillator.damping": DAMPINGS}),
        {"amplitude": amplitude},
        stop_time=STOP,
        step_size=STEP,
        tolerance=1e-10,
        record=["drive.y", "drive.y_dot", "drive.y_ddot", "oscillator.x"],
    )
    surface = table["amplitude"].reshape(len(FREQUENCIES), len(DAMPINGS))
    expected = np.array([Oscillator.response(FREQUENCIES, damping=damping)[0] for damping in DAMPINGS]).T
    draw(figure, surface)
    resonant = np.sqrt(2) > DAMPINGS
    ridge = FREQUENCIES[np.argmax(surface, axis=0)]
    there = [Oscillator.resonance(damping=damping) for damping in DAMPINGS[resonant]]
    width = FREQUENCIES[1] - FREQUENCIES[0]
    return [
        verdict(
            f"{surface.size} amplitudes are those of K eq. 121",
            error=max_error(surface, expected),
            tolerance=3e-7,
            unit="m",
            reason="transients of 7e-8 m, interpolated support 1e-8, solver tolerance 1e-10 over 140 s",
        ),
        verdict(
            "the ridge lies at √(ω_0² - γ²/2)",
            error=max_error(ridge[resonant], np.maximum(there, FREQUENCIES[0])),
            tolerance=width,
            unit="rad/s",
            reason="the largest of a row lies next to the maximum, less than one column away",
        ),
        verdict(
            "for γ > √2 ω_0 the amplitude only falls",
            error=max(0.0, float(np.max(np.diff(surface[:, ~resonant], axis=0)))),
            tolerance=0.0,
            unit="m",
            reason="a sign, no number",
        ),
    ]


def draw(figure: Path, surface: np.ndarray) -> None:
    _, axis = plt.subplots(figsize=(6, 4.5), layout="constrained")
    filled = axis.contourf(FREQUENCIES, DAMPINGS, surface.T, levels=20)
    plt.colorbar(filled, label="amplitude [m]")
    fine = np.linspace(DAMPINGS[0], np.sqrt(2) - 1e-9, 200)
    axis.plot([Oscillator.resonance(damping=damping) for damping in fine], fine, "w--", label="√(ω$_0$² - γ²/2)")
    axis.set(xlabel="ω [rad/s]", ylabel="γ [1/s]", xlim=FREQUENCIES[[0, -1]], title="K eq. 121, from FMUs")
    axis.legend()
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
