"""Dry friction shortens each half swing by the same length; on belts, it causes stick-slip and drift.

On a belt at rest, each half swing of a mass on a spring loses 2 μ m g/K, until static friction holds the mass.  On a
belt at the speed v, the mass sticks for 2δ/v and slides for (2/ω)(π - arctan(δω/v)), with δ = (μ_s - μ_k) m g/K.  A
free block on a belt that is shaken, A sin ωt with Aω² ≫ μg, yields to any force F: its mean velocity is Aω
sin(πF/2μmg).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import operator, simulate
from liaisons.models import DryOscillator
from liaisons.scenarios import Claims, dots, panels, scenario, within

STATIC, SLIDING, SPEED, TOLERANCE = 0.2, 0.1, 0.2, 1e-12
RECORD = ("x", "x_dot", "energy_balance")
AMPLITUDE, SHAKING = 0.01, 200.0  # [m], [rad/s]: Aω² = 400 m/s2, μg = 1 m/s2


@scenario
def main(claim: Claims) -> None:
    decay, slips, drifts = panels(
        ("belt at rest", "t [s]", "x [m]"),
        ("belt at 0.2 m/s", "t [s]", "x [m]"),
        ("shaken, under a force", "F/μmg", "mean velocity [m/s]"),
    )
    exact = within(1e-9, "m", because="errors of solver (1e-12) and of instants of events, amplified < 100-fold")
    joule = within(1e-9, "J", because="errors at solver tolerance 1e-12 of energies of 5 J, amplified < 100-fold")
    friction: Any = {"mu_static": 0.05, "mu_sliding": 0.03}
    run = simulate("DryOscillator", stop_time=20.0, step_size=0.02, tolerance=TOLERANCE, record=RECORD, **friction)
    expected = DryOscillator.exact(run.time, **friction)
    claim(
        "belt at rest: half swings about the points where friction balances the spring", run["x"], expected["x"], exact
    )
    instants, turns = DryOscillator.turning_points(**friction)
    claim(f"it rests at {turns[-1]:.4f} m after {turns.size - 1} half swings", run["x"][-1], turns[-1], exact)
    claim("the lost energy is the work of friction", run["energy_balance"], 0.0, joule)
    decay.plot(run.time, run["x"], label="FMU")
    dots(decay, instants, turns, every=1, label="turning points")

    belt: Any = {"mu_static": STATIC, "mu_sliding": SLIDING, "belt_dot": SPEED}
    start = belt | {"x_0": 0.0, "x_dot_0": SPEED}
    moved = {"belt": lambda t: (SPEED * t, SPEED, 0.0)}
    begin: Any = {name: value for name, value in start.items() if name != "belt_dot"}
    run = simulate(
        "DryOscillator", stop_time=20.0, step_size=0.01, tolerance=TOLERANCE, inputs=moved, record=RECORD, **begin
    )
    expected = DryOscillator.exact(run.time, **start)
    claim("moving belt: the mass sticks and slides in turn", run["x"], expected["x"], exact)
    claim("the belt's work goes to friction and the spring", run["energy_balance"], 0.0, joule)
    slips.plot(run.time, run["x"], label="FMU")
    dots(slips, run.time, expected["x"], label="closed form")
    sticking, sliding = DryOscillator.stick_slip(**belt)
    shifted = DryOscillator.exact(run.time + sticking + sliding, **start)
    steady = run.time > 2.0
    text = f"its period is {sticking:.3f} s + {sliding:.3f} s"
    claim(text, run["x"][steady], shifted["x"][steady], exact)

    shares, means = np.array([0.0, 0.25, 0.5, 0.75]), []
    for share in shares:
        shaking = operator("Sinusoid", amplitude=AMPLITUDE, angular_frequency=SHAKING)
        force = share * SLIDING * 9.81
        drift = DryOscillator.drift(x_force=force, stiffness=0.0, amplitude=AMPLITUDE, angular_frequency=SHAKING)
        block = {"stiffness": 0.0, "x_0": 0.0, "x_dot_0": drift, "x_force": force}
        period = 2 * np.pi / SHAKING
        settings: Any = {"stop_time": 100 * period, "step_size": period / 40, "tolerance": 1e-10, "record": "x"}
        run = simulate("DryOscillator", belt=shaking, start_values=block, **settings)
        means.append((run["x"][-1] - run["x"][2000]) / (50 * period))
    leading = AMPLITUDE * SHAKING * np.sin(np.pi / 2 * shares)
    ratio = SLIDING * 9.81 / (AMPLITUDE * SHAKING**2)
    claim(
        "a shaken block drifts under any force",
        means,
        leading,
        within(2 * ratio, "m/s", because="the next term is of relative size μg/Aω²"),
    )
    every = np.linspace(0, 1, 101)
    drifts.plot(every, AMPLITUDE * SHAKING * np.sin(np.pi / 2 * every), label="Aω sin(πF/2μmg)")
    dots(drifts, shares, means, every=1, label="FMU")
