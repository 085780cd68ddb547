"""Two Pendulum FMUs, bob to pivot, are the double pendulum: implicit coupling is of fourth order for any masses.

Explicit coupling passes the force of the lower pendulum on one sweep late.  The effective mass of this pendulum at its
pivot is Θ = m_2 n nᵀ along its rod n (M eq. 50); the mobility of the upper bob is t tᵀ/m_1 across its own rod.  Each
sweep therefore multiplies an error of the force by -(m_2/m_1) sin²(θ_2 - θ_1).  If this factor exceeds 1, explicit
coupling fails, however short the step.  Newton's method, with Θ from the FMUs, converges for any factor.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Result, System, max_error, simulate
from liaisons.scenarios import Claims, panels, scenario, within

SIZES = (0.02, 0.01, 0.005, 0.0025)
SMALL, LARGE, RIGHT_ANGLE = (0.02, 0.03), (0.3, 0.5), (0.0, np.pi / 2)  # angles at the begin


def pair(angles: tuple[float, float], mass: float = 1.0, rate: float = 0.0) -> System:
    """Two pendulums of lengths 1 m, the upper one of 1 kg."""
    system = System("coupled pendulums")
    upper = system.add("upper", "Pendulum", theta_0=angles[0])
    lower = system.add("lower", "Pendulum", theta_0=angles[1], mass=mass, theta_dot_0=rate)
    system.connect(upper["bob"], lower["pivot"])
    return system


def compared(
    angles: tuple[float, float], time: float, step: float, coupling: Any = "implicit", mass: float = 1.0
) -> tuple[Result, float]:
    """What comes out, and how far it is from the double pendulum [rad]."""
    two = pair(angles, mass).simulate(time, step, tolerance=1e-12, coupling=coupling)
    start: Any = {"theta_1_0": angles[0], "theta_2_0": angles[1], "theta_2_dot_0": 0.0, "mass_2": mass}
    one = simulate("DoublePendulum", times=two.time, tolerance=1e-13, **start)
    return two, max_error([two["upper.theta"], two["lower.theta"]], [one["theta_1"], one["theta_2"]])


@scenario
def main(claim: Claims) -> None:
    orders, masses, motion = panels(
        ("against DoublePendulum, 1 s", "H [s]", "error [rad]"),
        ("implicit, H = 2 ms, 1 s", "m$_2$/m$_1$", "error [rad]"),
        ("two FMUs, H = 1 ms", "t [s]", "θ [rad]"),
        mosaic="ab;cc",
        size=(9.0, 7.0),
    )
    higher = within(0.05, because="terms of higher order in rate · H < 0.1")
    below: Any = {"marker": "o", "markersize": 9, "linewidth": 5, "alpha": 0.4}  # of two curves that coincide
    for coupling, order, style in (
        ("jacobi", 1, below),
        ("gauss-seidel", 1, {"marker": "x"}),
        ("waveform", 4, below),
        ("implicit", 4, {"marker": "x"}),
    ):
        errors = [compared(LARGE, 1.0, H, coupling)[1] for H in SIZES]
        claim.order(f"{coupling}: order {order}", SIZES, errors, order, higher)
        orders.loglog(SIZES, errors, label=coupling, **style)
    orders.set_xticks(SIZES, [f"{size:g}" for size in SIZES])
    orders.minorticks_off()

    long, error = compared(SMALL, 10.0, 0.001)
    claim("small angles, H = 1 ms, 10 s", error, 0.0, within(1e-8, "rad", because="the accuracy that is required"))
    interface = within(1e-11, "J", because="interface tolerance 1e-13, times 10 N, 0.1 m/s and 10 s")
    claim("the energy that one gives is what the other receives", long["upper.work"], -long["lower.work"], interface)
    for name in ("upper", "lower"):
        motion.plot(long.time, long[f"{name}.theta"], label=name)

    load = "H⁴/720 times the load's fourth derivative: rate² = 2 g (1 + m_2/m_1), times g m_2/m_1 and angle"
    for mass in (0.01, 0.1, 1.0, 10.0, 100.0):
        error = compared(SMALL, 1.0, 0.002, mass=mass)[1]
        bound = 1e-12 + 0.002**4 / 720 * (19.62 * (1 + mass)) ** 2 * max(1.0, 9.81 * mass) * SMALL[1]
        claim(f"implicit, m_2/m_1 = {mass:g}: stable", error, 0.0, within(bound, "rad", because=load))
        masses.loglog(mass, error, "ko")
    moving = within(0.02, because="between two steps the force itself changes by 1e-4")
    for mass in (0.8, 1.25):
        run = pair(RIGHT_ANGLE, mass, rate=1.0).simulate(4e-5, 1e-5, tolerance=1e-12, coupling="jacobi")
        change = np.diff(run["lower.pivot_x_force"])
        text = f"explicit, m_2/m_1 = {mass:g}, right angle: a sweep multiplies the force's error by -m_2/m_1"
        claim(text, change[-1] / change[-2], -mass, moving)
