"""A gyroscope in gimbals precesses steadily at two rates, (I_1 + B - C) Ω² cos θ - I_3 ω_3 Ω + m g l = 0.

Started with a rate of precession and the spin that satisfies this equation, the Gyroscope keeps its inclination.
Released without precession, it nods between two angles that follow from the energy and the two momenta.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import simulate
from liaisons.models import Gyroscope
from liaisons.scenarios import Claims, panels, scenario, within

THETA, TOLERANCE = 1.0, 1e-11


@scenario
def main(claim: Claims) -> None:
    steady = within(1e-8, "rad", because="errors at solver tolerance 1e-11 over 50 periods of nutation")
    (axis,) = panels(("inclination of the rotor", "t [s]", "θ [rad]"), size=(7, 4))
    for rate in (1.0, 3.0):
        spin = Gyroscope.steady_precession(THETA, rate)
        start: dict[str, Any] = {"nutation_0": THETA, "precession_dot_0": rate, "spin_dot_0": spin}
        run = simulate("Gyroscope", stop_time=2.0, step_size=0.002, tolerance=TOLERANCE, **start)
        claim(f"Ω = {rate} rad/s, spin {spin:.1f} rad/s: θ is constant", run["nutation"], THETA, steady)
        claim(f"Ω = {rate} rad/s: φ = Ω t", run["precession"], rate * run.time, steady)
        axis.plot(run.time, run["nutation"], label=f"steady, Ω = {rate} rad/s")
    run = simulate("Gyroscope", stop_time=2.0, step_size=0.001, tolerance=TOLERANCE, nutation_0=THETA)
    constant = within(1e-11, "kg.m2/s", because="no torque acts about either axis: rounding errors of sums")
    for name in ("precession", "spin"):
        claim(f"p of the {name} is constant", run[f"p_{name}"], run[f"p_{name}"][0], constant)
    claim.energy("energy", run, tolerance=TOLERANCE)
    axis.plot(run.time, run["nutation"], label="released without precession")
    axis.set_ylim(THETA - 0.05, np.max(run["nutation"]) + 0.05)
