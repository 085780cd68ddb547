"""A hanging chain swings in as many modes as it has links, with Ω² = g/l times the zeros of a Laguerre polynomial.

K 2.2 for any number of links; D. Bernoulli solved the small motions in 1732.  All modes of ten links are excited at
once, with small amplitudes, and separated by projection.  A pivot that is shaken at the frequency of the second mode
then drives the chain to large motions; the energy gained is the operator's work.
"""

from __future__ import annotations

import numpy as np

from liaisons import fmu_path, frequencies, operator, simulate
from liaisons.models import PendulumChain
from liaisons.scenarios import Claims, panels, scenario, within

N, SMALL = 10, 1e-5  # links, of each mode [rad]
STEP = 0.1  # [s]; less than half the shortest period


@scenario
def main(claim: Claims) -> None:
    chain = fmu_path("PendulumChain", n=N)
    expected, modes = PendulumChain.normal_modes(n=N)
    modes = modes / np.max(np.abs(modes), axis=0)
    start = SMALL * modes.sum(axis=1)
    small = simulate(chain, stop_time=60.0, step_size=STEP, tolerance=1e-13, theta_0=start)
    found = frequencies(np.linalg.solve(modes, small["theta"].T), STEP)
    zeros = within(1e-6, "rad/s", because="(Nθ)² = 1e-8, and tolerance 1e-13 over 1e-5 rad, over h sin Ωh = 0.01")
    claim(f"{N} modes: Ω² l/g are the zeros of the Laguerre polynomial", found, expected, zeros)
    exact = PendulumChain.small_angles(small.time, theta_0=start)["theta"]
    linear = within(1e-5, because="relative error (Nθ)² = 1e-8, times a phase Ωt of 1000")
    claim("the motion is their sum", small["theta"] / SMALL, exact / SMALL, linear)

    shaken = operator("Sinusoid", amplitude=0.05, angular_frequency=expected[1])
    driven = simulate(chain, stop_time=20.0, step_size=0.02, tolerance=1e-10, theta_0=0.0, pivot_x=shaken)
    largest = np.degrees(np.max(np.abs(driven["theta"])))
    claim.energy(f"shaken, its links turn by up to {largest:.0f}°: the energy gained is work", driven, tolerance=1e-10)

    shapes, motion = panels(
        ("the four slowest modes", "Ω [rad/s]", "z [m]"),
        ("shaken at the second frequency: the last 4 s", "x [m]", "z [m]"),
    )
    for k in range(4):
        x = np.append(0.0, np.cumsum(modes[:, k]))
        shapes.plot(2.5 * k + x / np.max(np.abs(x)), -np.arange(N + 1), "o-", markersize=3)
    shapes.set_xticks(2.5 * np.arange(4), [f"{frequency:.2f}" for frequency in expected[:4]])
    for theta, pivot in zip(driven["theta"][-200::10], driven["pivot_x"][-200::10], strict=True):
        x, z = np.cumsum(np.sin(theta)) + pivot, -np.cumsum(np.cos(theta))
        motion.plot(np.append(pivot, x), np.append(0.0, z), color="tab:blue", alpha=0.4, linewidth=0.8)
