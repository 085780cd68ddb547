"""Over 10⁵ s, symplectic steps keep a pendulum's energy within the error of one swing; without them it drifts.

The same FMU makes 47 000 swings from 1 rad with `symplectic_steps` (Gauss's method of order 6, steps of 100 ms), and
with the error-controlled solver.  The energy error of a symplectic method of order r stays of the order h^r for
exponentially long times (Hairer, Lubich, Wanner, Geometric Numerical Integration, IX.8).  Only the error of the phase
grows, linearly, at a rate given by the error constant of the method.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Result, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

DURATION, H, STEPS = 1e5, 10.0, 100  # [s], communication step [s], and symplectic steps in it: 100 ms each
AMPLITUDE = 1.0  # [rad]


def run(**options: Any) -> tuple[Result, np.ndarray]:
    """With the energy error at all instants but the first."""
    signals: Any = {"record": ["theta", "energy"], "theta_0": AMPLITUDE}
    result = simulate("Pendulum", stop_time=DURATION, step_size=H, **signals, **options)
    return result, np.abs(result["energy"] - result["energy"][0])[1:]


@scenario
def main(claim: Claims) -> None:
    swing, symplectic = run(symplectic_steps=STEPS)
    loose, tight = (run(tolerance=tolerance)[1] for tolerance in (1e-8, 1e-10))
    time, tenth = swing.time[1:], symplectic.size // 10
    periodic = within(1.2, because="both numbers are the largest of a thousand points of one periodic function")
    growth = symplectic[-tenth:].max() / symplectic[:tenth].max()
    claim("energy error of the last 10⁴ s, compared with the first 10⁴ s", growth, 0.0, periodic)

    # Of a harmonic oscillator the method changes the frequency by this part, to first order.
    relative = (np.sqrt(9.81) * H / STEPS) ** 6 / 100800
    why = "ten times (ωh)⁶/100800, the relative error for a harmonic oscillator, times the energy of the swing"
    energy = within(10 * relative * 9.81 * (1 - np.cos(AMPLITUDE)), "J", because=why)
    claim("energy error of the symplectic solver", symplectic, 0.0, energy)
    phase = 10 * relative * 2 * np.pi * DURATION / Pendulum.period(theta_0=AMPLITUDE)
    exact = Pendulum.exact(swing.time, theta_0=AMPLITUDE)["theta"]
    late = within(phase, "rad", because="ten times the phase error (ωh)⁶/100800 of a harmonic oscillator")
    claim("angle after 10⁵ s against elliptic functions", swing["theta"], exact, late)
    even = within(0.1, because="each step loses the same energy; the exponent is fitted over one decade")
    drift = "the energy error of the error-controlled solver grows in proportion to time"
    claim.order(drift, time[tenth:], loose[tenth:], 1.0, even)

    energies, angles = panels(
        ("energy", "t [s]", "largest energy error so far [J]"),
        ("phase of the symplectic solver", "t [s]", "largest angle error so far [rad]"),
    )
    curves = {"symplectic, steps of 100 ms": symplectic, "tolerance 1e-08": loose, "tolerance 1e-10": tight}
    for label, error in curves.items():
        energies.loglog(time, np.maximum.accumulate(error), label=label)
    energies.legend(loc="lower right")
    angles.loglog(time, np.maximum.accumulate(np.abs(swing["theta"] - exact))[1:], label="symplectic")
    angles.loglog(time, phase * time / DURATION, "k--", linewidth=1, label="allowed, as the time")
    angles.legend(loc="lower right")
