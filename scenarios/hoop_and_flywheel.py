"""A bead runs on a hoop that sits on the shaft of a free flywheel: what it does to the one it does to the other.

The hoop's port β takes the flywheel's angle, and its torque λ = dp_β/dt (M eq. 27) goes back as the flywheel's load.
With the moment of the tangent a = R + d cos ψ and b = d² sin² ψ (ψ = ξ/R) both together have

    p_β = m a (ξ' + a β') + (I + I_f + m b) β',    E = ½ m (ξ' + a β')² + ½ (I + I_f + m b) β'²    (M eq. 61, 62)

both constant, which leaves one equation of first order for ξ: the reference.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons import System, Verdict, fmu_path, max_error, run_scenario, verdict

RADIUS, OFFSET, MASS, INERTIA, WHEEL = 1.0, 0.5, 1.0, 0.1, 0.3
START = {"xi_0": 0.0, "xi_dot_0": 1.5}
STOP, TOLERANCE = 20.0, 1e-11


def moments(xi: NDArray) -> tuple[NDArray, NDArray]:
    """a [m] and I + I_f + m b [kg.m2]."""
    psi = xi / RADIUS
    return RADIUS + OFFSET * np.cos(psi), INERTIA + WHEEL + MASS * (OFFSET * np.sin(psi)) ** 2


def reference(times: NDArray) -> NDArray:
    """ξ, β from Hamilton's equations of the whole with p_β as it was: ξ'' follows from p_ξ = m (ξ' + a β')."""

    def rates(_: float, y: NDArray) -> list[float]:
        xi, _, p = y
        a, whole = moments(xi)
        turn = (angular_momentum - a * p) / whole
        slopes = -OFFSET / RADIUS * np.sin(xi / RADIUS), OFFSET**2 / RADIUS * np.sin(2 * xi / RADIUS)
        return [p / MASS - a * turn, turn, slopes[0] * p * turn + MASS / 2 * slopes[1] * turn**2]

    a, _ = moments(np.array(START["xi_0"]))
    p = MASS * START["xi_dot_0"]
    angular_momentum = float(a * p)  # the flywheel is at rest
    return solve_ivp(rates, (0, STOP), [START["xi_0"], 0.0, p], "DOP853", times, rtol=1e-13, atol=1e-13).y


def main(figure: Path) -> list[Verdict]:
    system = System("hoop and flywheel")
    hoop = system.add("hoop", fmu_path("CircularHoop"), radius=RADIUS, offset=OFFSET, hoop_inertia=INERTIA, **START)
    wheel = system.add("wheel", fmu_path("Flywheel"), inertia=WHEEL, angle_dot_0=0.0)
    system.connect(wheel["angle"], hoop["beta"])
    result = system.simulate(STOP, 0.01, tolerance=TOLERANCE)

    a, whole = moments(result["hoop.xi"])
    turn = result["wheel.angle_dot"]
    momentum = a * MASS * (result["hoop.xi_dot"] + a * turn) + whole * turn
    energy = result["hoop.energy"] + result["wheel.energy"]
    handed = result["hoop.work"] + result["wheel.work"]
    xi, beta, _ = reference(result.time)
    why = f"solver tolerance {TOLERANCE:g} and H⁴/720 of the torque, 20 s, amplification below 100"
    figures, (motion, parts) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    motion.plot(result.time, result["hoop.xi"], label="ξ [m], bead")
    motion.plot(result.time, result["wheel.angle"], label="β [rad], flywheel")
    motion.plot(result.time[::100], xi[::100], "k.", markersize=4, label="one system")
    parts.plot(result.time, WHEEL * turn, label="flywheel")
    parts.plot(result.time, momentum - WHEEL * turn, label="hoop and bead")
    parts.plot(result.time, momentum, "k", label="both")
    for axis, title in ((motion, "motion"), (parts, "angular momentum [kg.m2/s]")):
        axis.set(xlabel="t [s]", title=title)
        axis.legend()
    figures.savefig(figure, dpi=150)
    return [
        verdict("angular momentum of both", error=np.ptp(momentum), tolerance=1e-8, unit="kg.m2/s", reason=why),
        verdict("energy of both", error=np.ptp(energy), tolerance=1e-8, unit="J", reason=why),
        verdict("work on one is taken from the other", error=max(abs(handed)), tolerance=1e-8, unit="J", reason=why),
        verdict("ξ, one system", error=max_error(result["hoop.xi"], xi), tolerance=1e-7, unit="m", reason=why),
        verdict("β, one system", error=max_error(result["wheel.angle"], beta), tolerance=1e-7, unit="rad", reason=why),
    ]


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
