"""A sweep of FMUs gives the amplitude of a driven oscillator over frequency and damping, the surface of K eq. 121.

K 5.1, ω_0 = 1 rad/s, a force of 1 N.  A Sinusoid moves the support of an Oscillator of unit stiffness.  Each case runs
until the transient has decayed; the amplitude is fitted to the last periods.  The ridge follows the corrected ω_res =
√(ω_0² - γ²/2) and ends where γ = √2 ω_0.
"""

from __future__ import annotations

import numpy as np

from liaisons import Result, System, grid, operator, sweep
from liaisons.models import Oscillator
from liaisons.scenarios import Claims, panels, scenario, within

FREQUENCIES, DAMPINGS = np.linspace(0.3, 2.0, 24), np.linspace(0.3, 2.1, 13)
# The slowest transients decay like exp(-γt/2), γ = 0.3, and, over-damped, γ = 2.1, exp(-0.73 t): below 1e-7 at 110 s.
SETTLED, STOP = 110.0, 140.0


def amplitude(run: Result) -> float:
    """Of x = a sin ωt + b ω cos ωt, fitted to the last periods."""
    last = run.time >= SETTLED
    drive, rate, acceleration, x = (signal[last] for signal in run.values)
    (sine, cosine), *_ = np.linalg.lstsq(np.column_stack([drive, rate]), x)
    square = -(drive @ acceleration) / (drive @ drive)  # ω²
    return float(np.sqrt(sine**2 + square * cosine**2))


@scenario
def main(claim: Claims) -> None:
    system = System("resonance")
    system.add("oscillator", "Oscillator", x_0=0.0, support=operator("Sinusoid"))
    drive = "oscillator_support"
    table = sweep(
        system,
        grid({f"{drive}.angular_frequency": FREQUENCIES, "oscillator.damping": DAMPINGS}),
        {"amplitude": amplitude},
        stop_time=STOP,
        step_size=0.1,
        tolerance=1e-10,
        record=[f"{drive}.y", f"{drive}.y_dot", f"{drive}.y_ddot", "oscillator.x"],
    )
    surface = table["amplitude"].reshape(FREQUENCIES.size, DAMPINGS.size)
    expected = np.transpose([Oscillator.response(FREQUENCIES, damping=damping)[0] for damping in DAMPINGS])
    why = "transients of 7e-8 m, error of the interpolated support 1e-8, solver tolerance 1e-10 over 140 s"
    claim(f"{surface.size} amplitudes are those of K eq. 121", surface, expected, within(3e-7, "m", because=why))
    resonant = np.sqrt(2) > DAMPINGS
    ridge = FREQUENCIES[np.argmax(surface, axis=0)][resonant]
    there = [Oscillator.resonance(damping=damping) for damping in DAMPINGS[resonant]]
    why = "the largest value of a row is less than one column away from the maximum"
    column = within(FREQUENCIES[1] - FREQUENCIES[0], "rad/s", because=why)
    claim("the ridge is at √(ω_0² - γ²/2)", ridge, np.maximum(there, FREQUENCIES[0]), column)
    rise, sign = np.diff(surface[:, ~resonant], axis=0), within(0.0, "m", because="an inequality")
    claim.below("for γ > √2 ω_0 the amplitude only falls", rise, 0.0, sign)

    (axis,) = panels(("K eq. 121, from FMUs", "ω [rad/s]", "γ [1/s]"), size=(6, 4.5))
    filled = axis.contourf(FREQUENCIES, DAMPINGS, surface.T, levels=20)
    axis.figure.colorbar(filled, label="amplitude [m]")
    fine = np.linspace(DAMPINGS[0], np.sqrt(2) - 1e-9, 200)
    axis.plot([Oscillator.resonance(damping=damping) for damping in fine], fine, "k--", label="√(ω$_0$² - γ²/2)")
    axis.set(xlim=FREQUENCIES[[0, -1]])
