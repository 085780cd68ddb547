"""A swing that is watched by its own operator: SwingPump measures θ, θ' and moves the length, a loop of two FMUs.

The operator stands up (shortest length) while |θ| grows and crouches while it falls (M 8.1).  Crouches at once would
multiply 1 - cos θ_max by (l_high/l_low)³ each half swing; three filters of the given rate take the time τ = 3/rate, a
delay at instants where the gain is stationary, so that what is missing is of second order, (Ω τ)².
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.signal import argrelmax

from liaisons import Result, System, Verdict, fmu_path, run_scenario, slope, verdict

LOW, HIGH, GRAVITY = 1.0, 1.1, 9.81
RATES = (50.0, 100.0, 200.0, 400.0)
STOP, TOLERANCE = 12.0, 1e-9
GROWTH = (HIGH / LOW) ** 3

fmu = cache(fmu_path)  # asking for the path checks that the FMU is up to date


def pumped(rate: float) -> System:
    system = System("closed loop")
    swing = system.add("swing", fmu("Pendulum"), theta_0=0.1, length=HIGH)
    pump = system.add("pump", fmu("SwingPump"), low=LOW, high=HIGH, rate=rate)
    system.connect(swing["theta"], pump["theta"])
    system.connect(swing["theta_dot"], pump["theta_dot"])
    system.connect(pump["y"], swing["length"])
    return system


def amplitudes(result: Result) -> tuple[NDArray, NDArray]:
    """Instants and |θ| of the turning points."""
    theta = np.abs(result["swing.theta"])
    turning = argrelmax(theta)[0]
    return result.time[turning], theta[turning]


def growth(result: Result) -> float:
    """Mean factor of 1 - cos θ_max from one turning point to the next."""
    versines = 1 - np.cos(amplitudes(result)[1])
    return float((versines[-1] / versines[0]) ** (1 / (len(versines) - 1)))


def main(figure: Path) -> list[Verdict]:
    results = [pumped(rate).simulate(STOP, 0.25 / rate, tolerance=TOLERANCE) for rate in RATES]
    missing = [1 - growth(result) / GROWTH for result in results]
    order = slope(1 / np.array(RATES), missing)
    quick, delay = results[-1], np.sqrt(GRAVITY / LOW) * 3 / RATES[-1]
    adapted = pumped(RATES[-1]).simulate(STOP, 0.01, tolerance=TOLERANCE, coupling="implicit", error_tolerance=1e-5)
    balance = max(abs(quick["swing.energy_balance"]))
    why = "stationary: of second order in the delay, a factor of order 1"
    _, (motion, gain) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    motion.plot(quick.time, quick["swing.theta"], label=f"{len(quick.time)} points")
    motion.plot(adapted.time, adapted["swing.theta"], "k.", markersize=3, label=f"adapted, {len(adapted.time)} points")
    times, heights = amplitudes(quick)
    theory = np.arccos(1 - (1 - np.cos(heights[0])) * GROWTH ** np.arange(len(times)))
    motion.plot(times, theory, "r_", times, -theory, "r_")
    motion.set(xlabel="t [s]", ylabel="θ [rad]", title="pumped by what is measured")
    motion.legend()
    gain.loglog(RATES, missing, "o-", label=f"order {order:.2f}")
    gain.set(xlabel="rate of the filters [1/s]", ylabel="missing growth", title="against (l$_{high}$/l$_{low}$)³")
    gain.legend()
    plt.savefig(figure, dpi=150)
    bound, work_bound = 2 * delay**2, 10 * TOLERANCE * STOP * max(abs(quick["swing.energy"]))
    seen = abs(growth(adapted) / GROWTH - 1)
    rows = (
        ("growth a half swing is (l_high/l_low)³", abs(missing[-1]), bound, "", why),
        (f"what is missing falls with order {order:.2f}, 2", abs(order - 2), 0.2, "", why),
        ("adapted steps pump the same", seen, bound + 1e-3, "", "and turning points are seen between points only"),
        ("the energy gained is the operator's work", balance, work_bound, "J", "10 x tolerance x energy scale x time"),
    )
    return [verdict(c, error=e, tolerance=limit, unit=u, reason=reason) for c, e, limit, u, reason in rows]


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
