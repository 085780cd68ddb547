"""A loop of two FMUs pumps a swing: SwingPump, its operator, measures θ and θ' and moves the length.

The operator stands up (shortest length, l_low) while |θ| grows and crouches (l_high) while it falls (M 8.1).  Sudden
crouches would multiply 1 - cos θ_max by (l_high/l_low)³ each half swing.  Three filters of the given rate cause the
delay τ = 3/rate.  Because the gain is stationary with respect to the instants of crouching, the loss is of second
order, (Ω τ)².
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import argrelmax

from liaisons import Result, System
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

LOW, HIGH = 1.0, 1.1  # shortest and longest [m]
RATES = np.array([50.0, 100.0, 200.0, 400.0])  # of the filters [1/s]
STOP, TOLERANCE = 12.0, 1e-9
GROWTH = Pendulum.crouch_growth(length_low=HIGH, length_high=LOW)


def pumped(rate: float) -> System:
    system = System("closed loop")
    swing = system.add("swing", "Pendulum", theta_0=0.1, length=HIGH)
    pump = system.add("pump", "SwingPump", low=LOW, high=HIGH, rate=rate)
    system.connect(swing["theta"], pump["theta"])
    system.connect(swing["theta_dot"], pump["theta_dot"])
    system.connect(pump["y"], swing["length"])
    return system


def turning(run: Result) -> tuple[NDArray, NDArray]:
    """Instants and 1 - cos θ of the turning points."""
    points = argrelmax(np.abs(run["swing.theta"]))[0]
    return run.time[points], 1 - np.cos(run["swing.theta"][points])


def growth(run: Result) -> float:
    """Mean factor of 1 - cos θ_max from one turning point to the next, over that of crouches at once."""
    _, versines = turning(run)
    return (versines[-1] / versines[0]) ** (1 / (versines.size - 1)) / GROWTH


@scenario
def main(claim: Claims) -> None:
    runs = [pumped(rate).simulate(STOP, 0.25 / rate, tolerance=TOLERANCE) for rate in RATES]
    missing, quick = [1 - growth(run) for run in runs], runs[-1]
    adapted = pumped(RATES[-1]).simulate(STOP, 0.01, tolerance=TOLERANCE, coupling="implicit", error_tolerance=1e-5)
    second, why = 2 * 9.81 / LOW * (3 / RATES[-1]) ** 2, "stationary: of second order in the delay, a factor of order 1"
    claim("growth per half swing is (l_high/l_low)³", growth(quick), 1.0, within(second, because=why))
    claim.order("the loss is of order 2 in the delay", 1 / RATES, missing, 2, within(0.2, because=why))
    between = within(second + 1e-3, because="as above, and turning points are seen between points only")
    claim("adapted steps give the same growth", growth(adapted), 1.0, between)
    claim.energy("the energy gained is the operator's work", quick, tolerance=TOLERANCE)

    motion, gain = panels(
        ("pumped by what is measured", "t [s]", "θ [rad]"),
        ("against (l$_{high}$/l$_{low}$)³", "rate of the filters [1/s]", "missing growth"),
    )
    motion.plot(quick.time, quick["swing.theta"], label=f"{quick.time.size} points")
    motion.plot(adapted.time, adapted["swing.theta"], "k.", markersize=3, label=f"adapted, {adapted.time.size} points")
    instants, versines = turning(quick)
    theory = np.arccos(1 - versines[0] * GROWTH ** np.arange(versines.size))
    motion.plot(instants, theory, "r_", label="sudden crouches")
    motion.plot(instants, -theory, "r_")
    gain.loglog(RATES, missing, "o-")
