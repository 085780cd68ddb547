"""A pendulum is held upright by moving its pivot, either with feedback (LQR) or by shaking it (Kapitza).

``hold`` linearises about θ = π, solves Riccati's equation of the sampled loop, and a Regulator FMU reads the states
every 20 ms.  The predicted matrix of the closed loop over one step is compared with that of the FMUs.  For comparison,
a Sinusoid shakes pivot_z, a sin Ωt, which keeps the pendulum near the top without any measurement, from the same 0.2
rad.  ∫ |P| dt is the work that an operator has to do if no energy is recovered.  The shaker, which moves the bob to and
fro, needs m a² Ω³ t/π cos² θ on average; feedback needs little more than the energy that lifts the bob.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import trapezoid

from liaisons import Result, hold, operator, simulate
from liaisons.scenarios import Claims, panels, scenario, within

STEP, STOP, TILT = 0.02, 10.0, 0.2
AMPLITUDE, SHAKING = 0.1, 60.0
TOLERANCE = 1e-10


def exchanged(run: Result, power: str) -> float:
    """∫ |P| dt [J]."""
    return float(trapezoid(np.abs(run[power]), run.time))


@scenario
def main(claim: Claims) -> None:
    upright, bounds = {"theta": np.pi, "pivot_x": 0.0}, {"pivot_x_ddot": (-20.0, 20.0)}
    regulator = hold("Pendulum", upright, "pivot_x", step_size=STEP, bounds=bounds)
    differences = within(1e-5, because="error of finite differences of 1e-5 about the equilibrium")
    claim("one step of the FMUs is the predicted matrix", regulator.measured(), regulator.loop, differences)
    radius = np.max(np.abs(regulator.floquet_multipliers))
    inside = within(1 - 1e-3, because="inside the unit circle; without feedback exp(√(g/l) H) = 1.065 is outside")
    claim("the largest multiplier", radius, 0.0, inside)

    held = regulator.simulate(STOP, theta_0=np.pi + TILT)
    theta, pivot = held["Pendulum.theta"], held["Pendulum.pivot_x"]
    back = within(1e-9, "rad", because="the 500th power of the largest multiplier is 3e-12; the pivot swings out first")
    claim("from 0.2 rad it comes back upright", theta[-1], np.pi, back)
    late = held.time > STOP / 2
    decay = np.abs(regulator.deviation(held)[:, late]).max(axis=0)
    rate = np.polyfit(held.time[late], np.log(decay), 1)[0] * STEP
    slope = within(0.1 * abs(np.log(radius)), because="two pairs of multipliers of nearly equal modulus beat")
    claim("it decays by the largest multiplier in each step", rate, np.log(radius), slope)

    lift = 9.81 * (1 - np.cos(TILT))
    rest = within(1e-6, "J", because="at rest again, up to the bound of an earlier claim")
    claim("feedback does the work that lifts the bob, m g l (1 - cos 0.2)", held["Pendulum.work"][-1], lift, rest)
    shaker = operator("Sinusoid", amplitude=AMPLITUDE, angular_frequency=SHAKING)
    shaken = simulate(
        "Pendulum", stop_time=STOP, step_size=0.0025, tolerance=TOLERANCE, pivot_z=shaker, theta_0=np.pi + TILT
    )
    spent, vibrated = exchanged(held, "Pendulum.pivot_x_power"), exchanged(shaken, "pivot_z_power")
    average = AMPLITUDE**2 * SHAKING**3 * STOP / np.pi * np.mean(np.cos(shaken["theta"]) ** 2)
    gravity = within(1e-3, because="(g/a Ω²)² = 7e-4, the weight relative to the shaking; error of ∫ |P| by trapezoids")
    claim("vibration exchanges ⟨cos² θ⟩ m a² Ω³ t/π", vibrated / average, 1.0, gravity)
    claim.below("feedback exchanges less: over vibration", spent / vibrated, 1e-3, within(0.0, because="inequality"))

    survived = regulator.survives("theta_force", 0.2, stop_time=STOP)
    weight = 9.81 * np.sin(TILT)
    text = f"it survives a torque of {survived:.3g} N m for 0.2 s, more than that of its weight at 0.2 rad"
    claim(text, float(survived <= weight), 0.0, within(0.0, because="inequality"))

    angle, moved, work = panels(
        ("upright is 0", "t [s]", "θ - π [rad]"),
        ("what feedback moves", "t [s]", "pivot_x [m]"),
        ("work exchanged", "t [s]", "∫ |P| dt [J]"),
    )
    labels = f"feedback, {spent:.2f} J", f"shaken, {vibrated:.0f} J"
    for run, label, prefix in zip((held, shaken), labels, ("Pendulum.", ""), strict=True):
        angle.plot(run.time, run[f"{prefix}theta"] - np.pi, linewidth=0.8, label=label)
        power = np.abs(run[f"{prefix}pivot_{'x' if prefix else 'z'}_power"])
        work.semilogy(run.time[1:], np.cumsum(power)[1:] * np.diff(run.time), label=label)
    moved.plot(held.time, pivot, linewidth=0.8)
