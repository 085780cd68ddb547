"""A pendulum keeps time only for small swings: its period grows from 2π/Ω to 4K(sin θ_0/2)/Ω.

K Fig. 2: the linear and the true pendulum (Ω = 1, released at rest) at small and at large amplitude.  The FMU has to
follow Jacobi's elliptic functions in both cases, and its period, read off the zero crossings of θ, Legendre's K.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.special import ellipk

from liaisons import Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import Pendulum

SMALL, LARGE = 0.2, 3.0  # amplitudes [rad]
LENGTH = GRAVITY = 1.0  # Ω = 1 rad/s


def measured_period(time: NDArray, theta: NDArray, theta_dot: NDArray) -> float:
    """Mean distance of upward zero crossings; a cubic Hermite spline locates them to fourth order in the step."""
    crossings = CubicHermiteSpline(time, theta, theta_dot).roots(extrapolate=False)
    upward = crossings[np.interp(crossings, time, theta_dot) > 0]
    return float(np.mean(np.diff(upward)))


def main(figure: Path) -> list[Verdict]:
    verdicts = []
    picture, axes = plt.subplots(1, 2, figsize=(10, 4), sharex=True, layout="constrained")
    for axis, name, amplitude in zip(axes, ("small", "large"), (SMALL, LARGE), strict=True):
        result = simulate(
            fmu_path("Pendulum"),
            stop_time=60.0,
            step_size=0.02,
            tolerance=1e-10,
            theta_0=amplitude,
            length=LENGTH,
            gravity=GRAVITY,
        )
        t, theta = result.time, result["theta"]
        exact = Pendulum.exact(t, theta_0=amplitude, length=LENGTH, gravity=GRAVITY)
        period = measured_period(t, theta, result["theta_dot"])
        legendre = 4 * ellipk(np.sin(amplitude / 2) ** 2)
        linear = Pendulum.small_angle(t, theta_0=amplitude, length=LENGTH, gravity=GRAVITY)["theta"]
        verdicts += [
            verdict(
                f"{name} amplitude: θ(t) is Jacobi's elliptic function",
                error=max_error(theta, exact["theta"]),
                tolerance=1e-7,
                unit="rad",
                reason="amplification below 100 over 60 s, tolerance 1e-10",
            ),
            verdict(
                f"{name} amplitude: period {legendre:.4f} s is 4K/Ω",
                error=abs(period - legendre),
                tolerance=1e-7,
                unit="s",
                reason="spline error of the crossings, 0.02⁴/384, and the solver's",
            ),
        ]
        axis.plot(t, linear, color="tab:purple", label="linear")
        axis.plot(t, theta, color="tab:blue", label="FMU")
        axis.plot(t[::50], exact["theta"][::50], "k.", markersize=3, label="elliptic functions")
        axis.set(title=f"θ(0) = {amplitude} rad, period {period:.3f} s", xlabel="Ωt", xlim=(0, 40))
    # K Ex. 3, condition "θ ≪ 1": the relative period error of the linear pendulum is θ²/16 + O(θ⁴).
    stretch = 4 * ellipk(np.sin(SMALL / 2) ** 2) / (2 * np.pi) - 1
    verdicts.append(
        verdict(
            "small amplitude: the linear period is short by θ²/16",
            error=abs(stretch / (SMALL**2 / 16) - 1),
            tolerance=SMALL**2,
            reason="next term of the series, 11 θ²/192 relative",
        )
    )
    axes[0].set_ylabel("θ [rad]")
    picture.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
