"""Friction in proportion to the momentum, Q = -η ∂T/∂q', takes energy at the rate 2ηT: a swing dies away as e^(-ηt/2).

K 2.6, eq. 61-67, and Ex. 6 with its sign put right.  A pendulum let go near the top gives up 2ηT at every instant, so
that energy and what is dissipated add up; small swings have the closed form of the damped oscillator, whatever η, and
a flywheel runs down exponentially.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import cumulative_simpson

from liaisons import Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import Flywheel, Pendulum

ETA = 0.4  # [1/s]
SMALL = 1e-4  # [rad]
REGIMES = {"under-damped": ETA, "critical": 2 * np.sqrt(9.81), "over-damped": 12.0}


def main(figure: Path) -> list[Verdict]:
    run: dict[str, Any] = {"stop_time": 20.0, "step_size": 0.01, "tolerance": 1e-12}
    fine: dict[str, Any] = run | {"step_size": 0.005}
    large = simulate(fmu_path("Pendulum"), theta_0=3.0, friction=ETA, **fine)
    loss = cumulative_simpson(2 * ETA * large["kinetic_energy"], x=large.time, initial=0)
    wheel = simulate(fmu_path("Flywheel"), angle_dot_0=10.0, friction=ETA, **run)
    running = Flywheel.exact(wheel.time, angle_dot_0=10.0, friction=ETA)
    verdicts = [
        verdict(
            "E(t) + ∫ 2ηT dt = E(0), let go near the top",
            error=max_error(large["energy"] + loss, large["energy"][0]),
            tolerance=2e-7,
            unit="J",
            reason="Simpson's rule, (2ωh)⁴/180 = 7e-8 with ω = 6 /s, times a few joule",
        ),
        verdict(
            "the FMU's own account of the loss is this integral",
            error=max_error(large["dissipated"], loss),
            tolerance=2e-7,
            unit="J",
            reason="as above",
        ),
        verdict(
            "a flywheel runs down exponentially",
            error=max(max_error(wheel[name], running[name]) for name in running),
            tolerance=1e-10,
            unit="rad, rad/s",
            reason="10 x tolerance 1e-12 x angles of 25 rad",
        ),
    ]
    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    for name, eta in REGIMES.items():
        small = simulate(fmu_path("Pendulum"), theta_0=SMALL, friction=eta, **run)
        exact = Pendulum.small_angle(small.time, theta_0=SMALL, friction=eta)
        verdicts.append(
            verdict(
                f"small swings, {name}: θ'' + ηθ' + Ω²θ = 0",
                error=max_error(small["theta"], exact["theta"]) / SMALL,
                tolerance=1e-7,
                reason="relative: θ³/6, 2e-9, and a phase Ωt of 60; tolerance 1e-12 of 1 rad over 1e-4 rad",
            )
        )
        right.plot(small.time[:500], small["theta"][:500] / SMALL, label=f"{name}, η = {eta:.3g} /s")
        right.plot(small.time[:500:20], exact["theta"][:500:20] / SMALL, "k.", markersize=3)
    left.stackplot(
        large.time, large["energy"] - np.min(large["energy"]), loss, labels=["energy", "∫ 2ηT dt"], alpha=0.7
    )
    left.set(xlabel="t [s]", ylabel="[J]", title="let go near the top: nothing is lost from the account")
    right.set(xlabel="t [s]", ylabel="θ/θ$_0$", title="small swings (dots: closed form)")
    left.legend(loc="lower right")
    right.legend()
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
