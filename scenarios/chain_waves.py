"""In a chain of masses and springs, long waves travel at c = √(κ/m) Δx; shorter waves are slower, and none is faster.

K 5.3, eq. 159-165.  Displacing one mass of a free chain excites all modes at once; their frequencies, read off the
simulated motion mode by mode, are Ω_k = 2 √(κ/m) sin(kπ/2N).  Then an operator moves the end of a driven chain.  The
motion agrees with the modal sum for a prescribed end.  A slow push arrives at mass j at the time j Δx/c.  Ahead of a
sudden push there is next to no motion: the response of the chain to a step is the integral of 2j J_2j(2 √(κ/m) t)/t.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from liaisons import fmu_path, frequencies, operator, simulate
from liaisons.models import DrivenChain, OscillatorChain
from liaisons.scenarios import Claims, panels, scenario, within

N, SPACING = 64, 0.25
SPRINGS: Any = {"mass": 0.5, "stiffness": 2.0}
BODY: Any = {**SPRINGS, "spacing": SPACING}
OMEGA, C = 2.0, 2.0 * SPACING  # √(κ/m) [rad/s], √(κ/m) Δx [m/s]
J = np.arange(1, N + 1)
PUSH = 12.0  # duration of the slow push [s]
REACHED, ECHO = 24, 48.0  # masses that it has passed before its echo comes back to them [s]
AHEAD = 0.85  # part of the time of arrival at which the sudden push is looked for


@scenario
def main(claim: Claims) -> None:
    chain, grip = (fmu_path(name, n=N) for name in ("OscillatorChain", "DrivenChain"))
    displaced = np.eye(N)[0]  # the first mass, by 1 m
    free = simulate(chain, stop_time=100.0, step_size=0.5, tolerance=1e-12, u_0=displaced, **BODY)
    expected, modes = OscillatorChain.normal_modes(n=N, **SPRINGS)
    found = frequencies((np.linalg.inv(modes) @ free["u"].T)[1:], 0.5)
    cosines = within(1e-7, "rad/s", because="errors of 1e-11 in amplitudes of 1e-3, divided by h sin Ωh = 0.02")
    claim(f"{N - 1} normal modes: Ω_k = 2 √(κ/m) sin(kπ/2N)", found, expected[1:], cosines)
    exact = OscillatorChain.exact(free.time, u_0=displaced, **SPRINGS)["u"]
    phase = within(1e-9, "m", because="solver tolerance 1e-12 times a phase Ωt of 400")
    claim("the free chain is the sum of its modes", free["u"], exact, phase)
    pairs = within(1e-12, "kg.m/s", because=f"the forces of a spring on its ends cancel: rounding errors of {N} terms")
    claim("the total momentum is constant", np.sum(free["p_u"], axis=1), 0.0, pairs)
    group = np.diff(found) / (np.pi / (N * SPACING))
    differences = within(1e-6, because="the error of Ω_k above, divided by the distance of two frequencies")
    claim.below("no group velocity exceeds c", group / C, 1.0, differences)

    sine: Any = {"amplitude": 0.1, "angular_frequency": 1.3}
    run = simulate(grip, stop_time=60.0, step_size=0.05, tolerance=1e-10, drive=operator("Sinusoid", **sine), **BODY)
    driven = within(1e-8, "m", because="tolerance 1e-10 times a phase Ωt of 240; error of interpolating σ, 1e-10")
    modal = DrivenChain.exact(run.time, n=N, **SPRINGS, **sine)["u"]
    claim("driven by a sine: the modal sum with a prescribed end", run["u"], modal, driven)

    push = operator("SmoothStep", duration=PUSH)
    slow = simulate(grip, stop_time=80.0, step_size=0.05, tolerance=1e-10, drive=push, **BODY)
    before = slow.time <= ECHO
    # ∫ t u' dt = ∫ (1 - u) dt, the mean time at which a push by 1 m passes each of the masses; before its echo
    passing = trapezoid(1 - slow["u"][before, :REACHED], slow.time[before], axis=0) - PUSH / 2
    ripples = within(1e-5, "s", because="the mean time is that of long waves; the ripples behind the front are cut off")
    text = f"a push of {PUSH:g} s passes masses 1 to {REACHED} at j Δx/c: c = {C:g} m/s"
    claim(text, passing, J[:REACHED] / OMEGA, ripples)

    sudden = simulate(grip, stop_time=40.0, step_size=0.05, tolerance=1e-12, drive=1.0, **BODY)
    masses = np.arange(20, N + 1, 10)
    times = AHEAD * masses / OMEGA
    early = [np.max(np.abs(sudden["u"][sudden.time <= t, j - 1])) for j, t in zip(masses, times, strict=True)]
    part = early / DrivenChain.forerunner(times, masses, **SPRINGS)
    series = within(1.0, because="a part of J_2j(x)/√(1 - (x/2j)²), which is 4e-3 at mass 20 and 4e-8 at mass 60")
    claim(f"a sudden push: at {AHEAD} j Δx/c the motion is J_2j alone", part, 0.0, series)

    law, front = panels(("dispersion", "q [rad/m]", "Ω [rad/s]"), ("a slow push at the left end", "t [s]", "x [m]"))
    q, place = J[:-1] * np.pi / (N * SPACING), J * SPACING
    law.plot(q, 2 * OMEGA * np.sin(q * SPACING / 2), color="0.6", label="2 √(κ/m) sin(qΔx/2)")
    law.plot(q, C * q, "k--", linewidth=0.8, label="c q")
    law.plot(q, found, ".", markersize=4, label="FMU, mode by mode")
    law.set(ylim=(0, 2.6 * OMEGA))
    colours = front.pcolormesh(slow.time, place, slow["u"].T, cmap="Blues", rasterized=True)
    front.figure.colorbar(colours, ax=front, label="u [m]")
    front.plot(place / C + PUSH / 2, place, "k--", linewidth=0.8, label="x = c (t - 6 s)")
