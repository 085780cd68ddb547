"""Falls from all heights are similar: the trajectory is a parabola, and τ'/τ = √(L'/L).

K 2.5, eq. 59: the potential of the weight, +m g z (the printed sign lets things rise), is homogeneous of degree 1, so
that a scaling of lengths by λ scales times by λ^(1 - h/2).  Friction brings a length of its own, g/η², and the
similarity is lost: a fall from high up takes longer.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.interpolate import CubicHermiteSpline

from liaisons import Result, Verdict, fmu_path, max_error, run_scenario, simulate, slope, verdict
from liaisons.models import FreeParticle

GRAVITY = 9.81
HEIGHTS = np.array([0.1, 1.0, 10.0, 100.0, 1000.0])  # [m]
THROW = {"x_dot_0": 6.0, "z_dot_0": 8.0}
FRICTION = 0.5  # [1/s]


def fall(height: float, friction: float = 0.0) -> float:
    """Time at which the particle, let go at rest, passes z = 0 [s]: a root of the cubic spline through z and z_dot.

    Without friction the spline is the trajectory itself, else its error is of fourth order in the step.
    """
    longest = 2 * np.sqrt(2 * height / GRAVITY) + 2 * friction * height / GRAVITY
    result = simulate(
        fmu_path("FreeParticle"),
        stop_time=longest,
        step_size=longest / 1000,
        tolerance=1e-12,
        z_0=height,
        z_dot_0=0.0,
        friction=friction,
    )
    path = CubicHermiteSpline(result.time, result["z"], result["z_dot"])
    return float(path.roots(extrapolate=False)[0])


def thrown(**starts: Any) -> Result:
    return simulate(fmu_path("FreeParticle"), stop_time=2.0, step_size=0.02, tolerance=1e-12, **THROW, **starts)


def main(figure: Path) -> list[Verdict]:
    parabola, damped = thrown(), thrown(friction=FRICTION)
    # From x' = v_x, z' = v_z - g t: eliminate the time.
    z = parabola["x"] * THROW["z_dot_0"] / THROW["x_dot_0"] - GRAVITY / 2 * (parabola["x"] / THROW["x_dot_0"]) ** 2
    times = np.array([fall(height) for height in HEIGHTS])
    slowed = np.array([fall(height, FRICTION) for height in HEIGHTS])
    verdicts = [
        verdict(
            "z(x) of a throw is the parabola",
            error=max_error(parabola["z"], z),
            tolerance=1e-10,
            unit="m",
            reason="10 x solver tolerance 1e-12 x lengths of 10 m",
        ),
        verdict(
            "a throw with friction follows the exponential",
            error=max(
                max_error(damped[q], v) for q, v in FreeParticle.exact(damped.time, friction=FRICTION, **THROW).items()
            ),
            tolerance=1e-10,
            unit="m",
            reason="as above; no amplification",
        ),
        verdict(
            "the fall lasts √(2L/g), from 0.1 m to 1 km",
            error=max_error(times / np.sqrt(2 * HEIGHTS / GRAVITY), 1.0),
            tolerance=1e-10,
            reason="relative; the spline is exact for a parabola",
        ),
        verdict(
            "exponent of τ'/τ = (L'/L)^(1/2)",
            error=abs(slope(HEIGHTS, times) - 0.5),
            tolerance=1e-10,
            reason="a regression of logarithms, as the times",
        ),
        verdict(
            "with friction the exponent rises: no similarity",
            error=max(0.0, 0.6 - slope(HEIGHTS, slowed)),
            tolerance=0.0,
            reason="a sign, no number: at the terminal velocity g/η the exponent is 1",
        ),
    ]
    draw(figure, parabola, damped, times, slowed)
    return verdicts


def draw(figure: Path, parabola: Result, damped: Result, times: np.ndarray, slowed: np.ndarray) -> None:
    _, (path, law) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for label, result in (("no friction", parabola), (f"η = {FRICTION} /s", damped)):
        above = result["z"] >= 0
        path.plot(result["x"][above], result["z"][above], label=label)
    path.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="a throw")
    path.legend(loc="lower center")
    fine = np.geomspace(HEIGHTS[0], HEIGHTS[-1], 50)
    law.loglog(fine, np.sqrt(2 * fine / GRAVITY), color="0.6", label="√(2L/g)")
    law.loglog(HEIGHTS, times, "o", label="no friction")
    law.loglog(HEIGHTS, slowed, "s", label=f"η = {FRICTION} /s")
    law.set(xlabel="height L [m]", ylabel="time of the fall τ [s]", title="similarity, and its loss")
    law.legend()
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
