"""Two Pendulum FMUs, bob onto pivot, are the double pendulum: implicit coupling of fourth order, for any masses.

Explicit coupling hands the force of the lower pendulum over one sweep late.  Its effective mass at the pivot is
Θ = m_2 n nᵀ along its rod n (M eq. 50), the upper bob's mobility t tᵀ/m_1 across its own rod, so each sweep multiplies
an error of the force by -(m_2/m_1) sin²(θ_2 - θ_1): beyond 1 it fails, however short the step.  Newton's method with
the FMUs' own Θ does not care.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from liaisons import Result, System, Verdict, fmu_path, run_scenario, simulate, slope, verdict

SIZES = (0.02, 0.01, 0.005, 0.0025)
ORDERS: dict[Any, float] = {"jacobi": 1, "gauss-seidel": 1, "waveform": 4, "implicit": 4}
SMALL, LARGE, RIGHT_ANGLE = (0.02, 0.03), (0.3, 0.5), (0.0, np.pi / 2)  # angles at the begin

fmu = cache(fmu_path)  # asking for the path checks that the FMU is up to date


class Pair:
    """Two pendulums of lengths 1 m, the upper one of 1 kg."""

    def __init__(self, angles: tuple[float, float], mass: float = 1.0, rate: float = 0.0) -> None:
        names = ("theta_1_0", "theta_2_0", "theta_2_dot_0", "mass_2")
        self.starts: dict[str, Any] = dict(zip(names, (*angles, rate, mass), strict=True))
        self.system = System("coupled pendulums")
        upper = self.system.add("upper", fmu("Pendulum"), theta_0=angles[0])
        lower = self.system.add("lower", fmu("Pendulum"), theta_0=angles[1], mass=mass, theta_dot_0=rate)
        self.system.connect(upper["bob"], lower["pivot"])

    def run(self, time: float, step: float, coupling: Any = "implicit") -> tuple[Result, float]:
        """What comes out, and how far it is from the double pendulum [rad]."""
        two = self.system.simulate(time, step, tolerance=1e-12, coupling=coupling)
        one = simulate(fmu("DoublePendulum"), times=two.time, tolerance=1e-13, **self.starts)
        pairs = (("upper.theta", "theta_1"), ("lower.theta", "theta_2"))
        return two, max(float(np.max(np.abs(two[a] - one[b]))) for a, b in pairs)


def main(figure: Path) -> list[Verdict]:
    verdicts = []
    _, (orders, masses, motion) = plt.subplots(1, 3, figsize=(14, 4), layout="constrained")
    for (coupling, order), style in zip(ORDERS.items(), ("o-", "x--", "o-", "x--"), strict=True):
        errors = [Pair(LARGE).run(1.0, H, coupling)[1] for H in SIZES]
        found = slope(SIZES, errors)
        claim, reason = f"{coupling}: order {found:.2f} is {order:g}", "terms of higher order, rate · H < 0.1"
        verdicts.append(verdict(claim, error=abs(found - order), tolerance=0.05, reason=reason))
        orders.loglog(SIZES, errors, style, label=f"{coupling}, order {found:.2f}")
    long, error = Pair(SMALL).run(10.0, 0.001)
    handed = max(abs(long["upper.work"] + long["lower.work"]))
    verdicts.append(
        verdict("small angles, H = 1 ms, 10 s", error=error, tolerance=1e-8, unit="rad", reason="asked for")
    )
    reason = "interface tolerance 1e-13 of 10 N, 0.1 m/s, 10 s"
    claim = "the energy that one gives the other takes"
    verdicts.append(verdict(claim, error=handed, tolerance=1e-11, unit="J", reason=reason))
    for mass in (0.01, 0.1, 1.0, 10.0, 100.0):
        error = Pair(SMALL, mass).run(1.0, 0.002)[1]
        bound = 1e-12 + 0.002**4 / 720 * (19.62 * (1 + mass)) ** 2 * max(1.0, 9.81 * mass) * SMALL[1]
        reason = "H⁴/720 of the load's fourth derivative: rate² = 2 g (1 + m_2/m_1), size g m_2/m_1, angle"
        claim = f"implicit, m_2/m_1 = {mass:g}: stable"
        verdicts.append(verdict(claim, error=error, tolerance=bound, unit="rad", reason=reason))
        masses.loglog(mass, error, "ko")
    for mass in (0.8, 1.25):
        force = Pair(RIGHT_ANGLE, mass, 1.0).run(4e-5, 1e-5, "jacobi")[0]["lower.pivot_x_force"]
        gain = np.diff(force)[-1] / np.diff(force)[-2]
        claim = f"explicit, m_2/m_1 = {mass:g}, right angle: a sweep multiplies the force's error by -m_2/m_1"
        reason = "meanwhile the force itself moves by 1e-4"
        verdicts.append(verdict(claim, error=abs(gain + mass), tolerance=0.02, reason=reason))
    orders.set(xlabel="H [s]", ylabel="error [rad]", title="against DoublePendulum, 1 s")
    orders.set_xticks(SIZES, [f"{size:g}" for size in SIZES])
    orders.minorticks_off()
    orders.legend(loc="center left")
    masses.set(xlabel="m$_2$/m$_1$", ylabel="error [rad]", title="implicit, H = 2 ms, 1 s")
    motion.plot(long.time, long["upper.theta"], label="upper")
    motion.plot(long.time, long["lower.theta"], label="lower")
    motion.set(xlabel="t [s]", ylabel="θ [rad]", ylim=(-0.035, 0.045), title="two FMUs, H = 1 ms")
    motion.legend(loc="upper center", ncols=2)
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
