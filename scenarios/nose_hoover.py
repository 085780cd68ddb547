"""A thermostat with inertia keeps m q'² = k_B T on average, and conserves an extended energy even in chaotic motion.

K 4.2: the friction ξ of Nosé and Hoover follows the temperature.  The thermostat of scenario ``thermostat`` fixes the
kinetic energy at every instant.
"""

from __future__ import annotations

import numpy as np

from liaisons import simulate
from liaisons.scenarios import Claims, panels, scenario, within

TOLERANCE, LONG = 1e-11, 2000.0


@scenario
def main(claim: Claims) -> None:
    run = simulate("NoseHooverOscillator", stop_time=LONG, step_size=0.05, tolerance=TOLERANCE, q_0=0.0, q_dot_0=5.0)
    extended = run["extended_energy"]
    scale = within(10 * TOLERANCE * run["energy"].max() * LONG, "J", because="10 times tolerance x energy x duration")
    claim(f"the extended energy is constant over {LONG:g} s of chaotic motion", extended, extended[0], scale)
    mean = np.trapezoid(2 * run["kinetic_energy"], run.time) / LONG
    ends = within(1e-3, "J", because="error h²/12 (m q'²)'' of trapezoids, h = 0.05 s; its integral is small")
    rest = (run["xi"][-1] - run["xi"][0]) / LONG
    claim("the mean of m q'² is k_B T + Q Δξ/τ, so k_B T in the end", mean, 1 + rest, ends)

    phase, energy = panels(("400 s in the chaotic sea", "q [m]", "q' [m/s]"), ("its energy", "t [s]", "energy [J]"))
    phase.plot(run["q"][:8000], run["q_dot"][:8000], linewidth=0.25)
    for name, label in (("energy", "T + V"), ("extended_energy", "with the thermostat")):
        energy.plot(run.time[:1201], run[name][:1201], label=label)
