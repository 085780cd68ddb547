"""Friction proportional to the momentum, Q = -η ∂T/∂q', dissipates 2ηT: a swing decays as e^(-ηt/2).

K 2.6, eq. 61-67, and Ex. 6 with its sign corrected.  A pendulum released near the top loses energy at the rate 2ηT at
every instant, so that the sum of its energy and the dissipated energy is constant.  Small swings have the closed form
of the damped oscillator for any η, and a flywheel slows down exponentially.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import cumulative_simpson

from liaisons import simulate
from liaisons.models import Flywheel, Pendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

ETA = 0.4  # [1/s]
SMALL = 1e-4  # [rad]
REGIMES = {"under-damped": ETA, "critical": 2 * np.sqrt(9.81), "over-damped": 12.0}


@scenario
def main(claim: Claims) -> None:
    account, decay = panels(
        ("let go near the top: nothing is lost from the account", "t [s]", "energy [J]"),
        ("small swings", "t [s]", "θ/θ$_0$"),
    )
    settings: Any = {"stop_time": 20.0, "tolerance": 1e-12}
    large = simulate("Pendulum", theta_0=3.0, friction=ETA, step_size=0.005, **settings)
    loss = cumulative_simpson(2 * ETA * large["kinetic_energy"], x=large.time, initial=0)
    simpson = within(2e-7, "J", because="error of Simpson's rule: (2ωh)⁴/180 = 7e-8 with ω = 6 /s, times a few joules")
    claim("E(t) + ∫ 2ηT dt = E(0), released near the top", large["energy"] + loss, large["energy"][0], simpson)
    claim("the FMU's own account of the loss is this integral", large["dissipated"], loss, simpson)
    left = large["energy"] - np.min(large["energy"])
    account.stackplot(large.time, left, loss, labels=["left", "∫ 2ηT dt"], alpha=0.7)

    wheel = simulate("Flywheel", angle_dot_0=10.0, friction=ETA, step_size=0.01, **settings)
    running = Flywheel.exact(wheel.time, angle_dot_0=10.0, friction=ETA)
    angles = within(1e-10, "rad, rad/s", because="10 times the solver tolerance 1e-12, times angles of 25 rad")
    claim("a flywheel slows down exponentially", wheel, running, angles)

    why = "relative error: θ³/6 of the sine, 2e-9, times a phase Ωt of 60; tolerance 1e-12 over 1e-4 rad"
    for name, eta in REGIMES.items():
        small = simulate("Pendulum", theta_0=SMALL, friction=eta, step_size=0.01, **settings)
        found, exact = small["theta"], Pendulum.small_angle(small.time, theta_0=SMALL, friction=eta)["theta"]
        text = f"small swings, {name}: θ'' + ηθ' + Ω²θ = 0"
        claim(text, found / SMALL, exact / SMALL, within(1e-7, because=why))
        decay.plot(small.time[:500], found[:500] / SMALL, label=f"{name}, η = {eta:.3g} /s")
        dots(decay, small.time[:500], exact[:500] / SMALL, every=20)
