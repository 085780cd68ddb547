"""A child that rises when the swing comes down and crouches when it turns pumps it, without a schedule: a closed loop.

M 8.1 with the SwingPump, which watches θ and θ' and moves the length through three filters, so that its rate and
acceleration are continuous.  The quicker the filters, the nearer is the growth of 1 - cos θ_max in a half swing to that
of sudden crouches, (l_low/l_high)³; what is lost goes as the delay of the filters, 3/rate.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from liaisons import Result, System, Verdict, fmu_path, run_scenario, slope, verdict
from liaisons.models import Pendulum

LOW, HIGH = 1.05, 1.0  # length crouched and standing [m]
RATES = np.array([50.0, 100.0, 200.0, 400.0])  # of the filters [1/s]
OMEGA = np.sqrt(9.81)  # of the swing, roughly [1/s]
STOP, TOLERANCE = 12.0, 1e-9


def pumped(rate: float) -> Result:
    system = System("closed loop")
    swing = system.add("swing", fmu_path("Pendulum"), theta_0=0.2, length=LOW)
    child = system.add("child", fmu_path("SwingPump"), low=HIGH, high=LOW, rate=rate)
    system.connect(child["y"], swing["length"])
    system.connect(swing["theta"], child["theta"])
    system.connect(swing["theta_dot"], child["theta_dot"])
    return system.simulate(STOP, 0.1 / rate, tolerance=TOLERANCE)


def growth(result: Result) -> float:
    """Of 1 - cos θ at the turning points, from one half swing to the next: the mean over all of them."""
    rate = CubicHermiteSpline(result.time, result["swing.theta_dot"], result["swing.theta_ddot"])
    turning = rate.roots(extrapolate=False)
    theta = CubicHermiteSpline(result.time, result["swing.theta"], result["swing.theta_dot"])(turning[turning > 0.5])
    versine = 1 - np.cos(theta)
    return float((versine[-1] / versine[0]) ** (1 / (versine.size - 1)))


def main(figure: Path) -> list[Verdict]:
    results = [pumped(rate) for rate in RATES]
    sudden = Pendulum.crouch_growth(length_low=LOW, length_high=HIGH)
    lost = sudden - np.array([growth(result) for result in results])
    scale = float(np.max(np.abs(results[0]["swing.energy"])))
    draw(figure, results, lost)
    return [
        verdict(
            f"the growth tends to that of sudden crouches, (l_low/l_high)³ = {sudden:.4f}",
            error=float(lost[-1]),
            tolerance=float((3 * OMEGA / RATES[-1]) ** 2),
            reason="(Ω · 3/rate)², the square of the delay in the phase of the swing",
        ),
        verdict(
            "what is lost goes as the square of the delay",
            error=abs(slope(1 / RATES, lost) - 2),
            tolerance=0.1,
            reason="regression over a factor of 8; the next order is Ω · 3/rate = 0.2 at the slowest",
        ),
        verdict(
            "the energy gained is the child's work",
            error=max(float(np.max(np.abs(result["swing.energy_balance"]))) for result in results),
            tolerance=10 * TOLERANCE * scale * STOP,
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
    ]


def draw(figure: Path, results: list[Result], lost: NDArray) -> None:
    _, axes = plt.subplot_mosaic("al;bl", figsize=(11, 4), layout="constrained", width_ratios=[2, 1])
    angle, length, law = (axes[panel] for panel in "abl")
    slow = results[0]
    angle.plot(slow.time, np.degrees(slow["swing.theta"]))
    angle.set(ylabel="θ [deg]", title=f"the child's filters at {RATES[0]:g} /s")
    length.plot(slow.time, slow["child.y"], color="tab:orange")
    length.set(xlabel="t [s]", ylabel="length [m]")
    law.loglog(RATES, lost, "ko-", markersize=4)
    law.set(xlabel="rate of the filters [1/s]", title="growth lost in a half swing: slope -2")
    law.set_xticks(RATES, [f"{rate:g}" for rate in RATES])
    law.minorticks_off()
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
