"""A driven oscillator has the amplitude of K eq. 121 and the phase -atan2(γω, ω_0²-ω²); it resonates iff γ < √2 ω_0.

K Fig. 7: ω_0 = 1 rad/s, |F_0|/m = 1, γ = ½, 1, 2, 4.  A Sinusoid moves the support of an Oscillator FMU, which for unit
stiffness is a unit force.  The stationary motion is fitted over the last periods, when the transient has decayed.  K
(122), ω_res = √(ω_0²-γ²/4), and K (123), an arctangent that jumps by π at ω_0, are misprints, as the same FMUs show.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from liaisons import operator, simulate
from liaisons.models import Oscillator
from liaisons.scenarios import Claims, Lesson, panels, scenario, within

FREQUENCIES = np.linspace(0.2, 3.0, 15)
# The slowest transient, γ = ½, decays like exp(-t/4), over-damped γ = 4 like exp(-0.268 t): below 1e-9 at 85 s.
SETTLED, STOP = 85.0, 125.0


def response(damping: float, frequencies: Iterable[float]) -> NDArray:
    """Complex amplitudes u_0 of x(t) = Re(u_0 exp(iωt)) under a force cos ωt, fitted to the simulated motion."""
    found = []
    for frequency in frequencies:
        drive = operator("Sinusoid", angular_frequency=frequency, phase=np.pi / 2)
        settings = {"stop_time": STOP, "step_size": 0.05, "tolerance": 1e-10, "record": "x"}
        run = simulate("Oscillator", damping=damping, support=drive, **settings)
        last = run.time >= SETTLED
        turns = np.exp(1j * frequency * run.time[last])
        (cosine, sine), *_ = np.linalg.lstsq(np.column_stack([np.real(turns), np.imag(turns)]), run["x"][last])
        found.append(complex(cosine, -sine))
    return np.array(found)


def lesson() -> Lesson:
    return Lesson(
        "Oscillator",
        question="At which frequency of the drive does a damped oscillator respond with the largest amplitude?",
        predict="At its own frequency ω_0 = 1 rad/s, below it, or above?",
        try_out="Change the angular frequency of the support and let the motion settle; then change the damping.",
        answer="Below it: at √(ω_0² - γ²/2), 0.935 rad/s for γ = 0.5, and at none if γ > √2 ω_0.  The amplitude "
        "follows K eq. 121, and the phase is -90° at ω_0 itself, whatever the damping.",
        controls=["support", "damping"],
        plots=["x", "support"],
        start_values={"damping": 0.5, "support": operator("Sinusoid", angular_frequency=0.6)},
    )


@scenario
def main(claim: Claims) -> None:
    curve = within(1e-7, because="transient 1e-9, errors of interpolating σ over 0.05 s and of the solver over 125 s")
    axes = panels(("amplitude", "ω [rad/s]", "|u$_0$| [m]"), ("phase", "ω [rad/s]", "φ [rad]"))
    fine = np.linspace(0.02, 3.0, 400)
    for damping in (0.5, 1.0, 2.0, 4.0):
        u_0 = response(damping, FREQUENCIES)
        expected, smooth = (Oscillator.response(omega, damping=damping) for omega in (FREQUENCIES, fine))
        for i, (name, found) in enumerate({"amplitude": np.abs(u_0), "phase": np.angle(u_0)}.items()):
            claim(f"γ = {damping:g}: {name} over the whole curve", found, expected[i], curve)
            (line,) = axes[i].plot(fine, smooth[i], label=f"γ = {damping:g}")
            axes[i].plot(FREQUENCIES, found, ".", color=line.get_color())

    # Vertex of the parabola through 1/|u_0|² at three frequencies: exactly quadratic in ω² by K eq. 121.
    omega, expected = np.array([0.8, 0.9, 1.0]), Oscillator.resonance(damping=0.5)
    curvature, tilt, _ = np.polyfit(omega**2, 1 / np.abs(response(0.5, omega)) ** 2, 2)
    found = np.sqrt(-tilt / (2 * curvature))
    printed = np.sqrt(1 - 0.5**2 / 4)
    assert abs(found - printed) > 0.02, "K eq. 122 as printed is distinguishable from the measured maximum"
    vertex = within(1e-6, "rad/s", because="errors 1e-7 of amplitudes, divided by the parabola's curvature of about 1")
    claim(f"γ = 0.5: the maximum lies at √(ω_0²-γ²/2) = {expected:.4f} rad/s", found, expected, vertex)
    # K says "γ < 2 ω_0": at γ = 1.7 the amplitude must still rise somewhere.  It falls from the start.
    falling = np.diff(np.abs(response(1.7, (0.1, 0.3, 0.5, 0.7))))
    sign = within(0.0, "m", because="an inequality: it falls by at least 0.004 m from point to point")
    claim.below("γ = 1.7 > √2 ω_0: no resonance, the amplitude only falls", falling, 0.0, sign)
