"""A driven oscillator answers with amplitude (K 121) and phase -atan2(γω, ω_0²-ω²); it resonates iff γ < √2 ω_0.

K Fig. 7: ω_0 = 1 rad/s, |F_0|/m = 1, γ = ½, 1, 2, 4, here from FMUs: a Sinusoid moves the support of an Oscillator,
which for unit stiffness is a unit force.  The stationary motion is fitted over the last periods, when the transient
has died.  K (122), ω_res = √(ω_0²-γ²/4), and K (123), an arctangent that jumps by π at ω_0, are misprints: the same
FMUs refute both.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import System, Verdict, fmu_path, max_error, run_scenario, verdict
from liaisons.models import Oscillator

DAMPINGS = (0.5, 1.0, 2.0, 4.0)
FREQUENCIES = np.linspace(0.2, 3.0, 15)
STEP = 0.05
# The slowest transient, γ = ½, decays like exp(-t/4), over-damped γ = 4 like exp(-0.268 t): below 1e-9 at 85 s.
SETTLED, STOP = 85.0, 125.0


def stationary(damping: float, frequency: float) -> complex:
    """Complex amplitude u_0 of x(t) = Re(u_0 exp(iωt)) under a force cos ωt, fitted to the simulated motion."""
    system = System("resonance")
    oscillator = system.add("oscillator", fmu_path("Oscillator"), damping=damping, support=1.0, input_reconstruction=2)
    drive = system.add("drive", fmu_path("Sinusoid"), angular_frequency=frequency, phase=np.pi / 2)
    system.connect(drive["y"], oscillator["support"])
    result = system.simulate(stop_time=STOP, step_size=STEP, tolerance=1e-10, record=["oscillator.x"])
    last = result.time >= SETTLED
    t, x = result.time[last], result["oscillator.x"][last]
    basis = np.column_stack([np.cos(frequency * t), np.sin(frequency * t)])
    (cosine, sine), *_ = np.linalg.lstsq(basis, x)
    return complex(cosine, -sine)


def response(damping: float, frequencies: NDArray) -> NDArray:
    return np.array([stationary(damping, frequency) for frequency in frequencies])


def main(figure: Path) -> list[Verdict]:
    verdicts = []
    _, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    fine = np.linspace(0.02, 3.0, 400)
    for damping in DAMPINGS:
        u_0 = response(damping, FREQUENCIES)
        amplitude, phase = Oscillator.response(FREQUENCIES, damping=damping)
        for name, measured, expected in (("amplitude", abs(u_0), amplitude), ("phase", np.angle(u_0), phase)):
            verdicts.append(
                verdict(
                    f"γ = {damping:g}: {name} over the whole curve",
                    error=max_error(measured, expected),
                    tolerance=1e-7,
                    reason="transient 1e-9, σ interpolated over 0.05 s, solver tolerance 1e-10 over 125 s",
                )
            )
        curve_amplitude, curve_phase = Oscillator.response(fine, damping=damping)
        (line,) = left.plot(fine, curve_amplitude, label=f"γ = {damping:g}")
        left.plot(FREQUENCIES, abs(u_0), ".", color=line.get_color())
        right.plot(fine, curve_phase, color=line.get_color())
        right.plot(FREQUENCIES, np.angle(u_0), ".", color=line.get_color())

    verdicts.append(maximum_is_where_the_corrected_formula_says(damping=0.5))
    # K says "γ < 2 ω_0": at γ = 1.7 the amplitude must still rise somewhere.  It falls from the start.
    falling = abs(response(1.7, np.array([0.1, 0.3, 0.5, 0.7])))
    verdicts.append(
        verdict(
            "γ = 1.7 > √2 ω_0: no resonance, the amplitude only falls",
            error=max(0.0, float(np.max(np.diff(falling)))),
            tolerance=0.0,
            unit="m",
            reason="a sign, no number: it falls by 0.004 m at least from point to point",
        )
    )
    left.set(xlabel="ω [rad/s]", ylabel="|u_0| [m]", title="amplitude")
    right.set(xlabel="ω [rad/s]", ylabel="φ [rad]", title="phase")
    left.legend()
    plt.savefig(figure, dpi=150)
    return verdicts


def maximum_is_where_the_corrected_formula_says(damping: float) -> Verdict:
    """Vertex of the parabola through 1/|u_0|² at three frequencies: exactly quadratic in ω² by K 121."""
    omega = np.array([0.8, 0.9, 1.0])
    curvature, slope, _ = np.polyfit(omega**2, 1 / abs(response(damping, omega)) ** 2, 2)
    measured = np.sqrt(-slope / (2 * curvature))
    printed = np.sqrt(1 - damping**2 / 4)  # K 122 as printed
    assert abs(measured - printed) > 0.02, "the printed formula is distinguishable from the measured maximum"
    return verdict(
        f"γ = {damping:g}: the maximum lies at √(ω_0²-γ²/2) = {Oscillator.resonance(damping=damping):.4f} rad/s",
        error=abs(measured - Oscillator.resonance(damping=damping)),
        tolerance=1e-6,
        unit="rad/s",
        reason="amplitudes to 1e-7, divided by the parabola's curvature of order 1",
    )


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
