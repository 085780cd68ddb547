"""On a hoop that is turned at constant rate a bead is a pendulum: ψ'' = -(d/R) β'² sin ψ, elliptic functions.

M 8.4 for the circle about a point off its centre.  The operator (a Ramp FMU on the port beta) has to supply the torque
that balances the normal force's moment about O; the closed form gives it, and its power, too.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

from liaisons import System, Verdict, fmu_path, max_error, run_scenario, verdict
from liaisons.models import CircularHoop

RATE = 2.0  # rad/s
START = {"xi_0": 2.5, "xi_dot_0": 0.0}  # 143° from A, at rest on the hoop: a large swing


def main(figure: Path) -> list[Verdict]:
    system = System("driven hoop")
    hoop = system.add("hoop", fmu_path("CircularHoop"), **START)
    motor = system.add("motor", fmu_path("Ramp"), rate=RATE)
    system.connect(motor["y"], hoop["beta"])
    result = system.simulate(stop_time=60.0, step_size=0.02, tolerance=1e-10)

    exact = CircularHoop.exact(result.time, beta_dot=RATE, **START)
    tolerances = {"xi": 1e-7, "xi_dot": 1e-7, "normal_force": 1e-6, "beta_force": 1e-6, "beta_power": 1e-6}
    verdicts = [
        verdict(
            f"{name} against the closed form",
            error=max_error(result[f"hoop.{name}"], exact[name]),
            tolerance=tolerance,
            unit=result.units[f"hoop.{name}"],
            reason="solver tolerance 1e-10, amplification below 100 over 60 s; forces are 10 times as stiff",
        )
        for name, tolerance in tolerances.items()
    ]
    scale = float(max(abs(result["hoop.energy"])))
    verdicts.append(
        verdict(
            "energy - work of the operator stays where it was",
            error=float(max(abs(result["hoop.energy_balance"]))),
            tolerance=10 * 1e-10 * scale * 60.0,
            unit="J",
            reason="10 x tolerance x energy scale x time",
        )
    )

    shown = result.time <= 15
    t = result.time[shown]
    _, (path, motion, power) = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    path.plot(result["hoop.bead_x"][shown], result["hoop.bead_y"][shown], linewidth=0.8)
    path.plot(0, 0, "k+")
    path.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="the bead in the fixed frame")
    motion.plot(t, result["hoop.xi"][shown], label="FMU")
    motion.plot(t[::20], exact["xi"][shown][::20], "k.", markersize=4, label="elliptic functions")
    motion.set(xlabel="t [s]", ylabel="ξ [m]", title="on the hoop")
    motion.legend()
    power.plot(t, result["hoop.beta_force"][shown], label="torque [N.m]")
    power.plot(t, result["hoop.beta_power"][shown], label="power [W]")
    power.set(xlabel="t [s]", title="what the operator supplies")
    power.legend()
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
