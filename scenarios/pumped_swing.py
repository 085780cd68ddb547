"""A swing is pumped by its length alone: each crouch and rise multiplies 1 - cos θ_max by (l_low/l_high)³.

The operator prescribes the length of a Pendulum (M 8.1).  Sudden: short through the lowest point, long at the turning
points; θ and p_θ are continuous through each jump, which gives the growth in closed form and, by elliptic integrals,
the instants.  Smooth: l = 1 + 0.1 sin 2Ω_0 t from a Sinusoid FMU, against a high-order integration of
l θ'' = -g sin θ - 2 l' θ' and, for small swings, against the growth rate ¾ ε Ω_0 of the first Mathieu tongue.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import Pendulum

GRAVITY = 9.81
LOW, HIGH = 1.1, 1.0  # distance of the centre of mass from the pivot, crouched and standing [m]
AMPLITUDE, HALF_SWINGS = 0.3, 10
DEPTH, FREQUENCY = 0.1, 2 * np.sqrt(GRAVITY)  # of the smooth pumping, at twice the swing's own frequency
TOLERANCE = 1e-11


def main(figure: Path) -> list[Verdict]:
    instants, amplitudes = crouch_schedule()
    sudden = sudden_crouch(instants)
    smooth = smooth_pumping(theta_0=0.05, stop_time=20.0)
    reference = integrate(smooth.time, theta_0=0.05)
    verdicts = [
        *judge_sudden(sudden, instants, amplitudes),
        *judge_smooth(smooth, reference),
        judge_growth_rate(),
    ]
    draw(figure, sudden, instants, amplitudes=amplitudes, smooth=smooth, reference=reference)
    return verdicts


def crouch_schedule() -> tuple[NDArray, NDArray]:
    """Instants at which the length changes, alternately θ = 0 and a turning point, and |θ| at the turning points.

    Quarter periods of the pendulum: K(sin θ_max/2) √(l/g), falling with the long length, rising with the short one.
    """
    growth = Pendulum.crouch_growth(length_low=LOW, length_high=HIGH)
    versines = (1 - np.cos(AMPLITUDE)) * growth ** np.arange(HALF_SWINGS + 1)
    amplitudes = np.arccos(1 - versines)
    quarter = ellipk(np.sin(amplitudes / 2) ** 2)
    falls = quarter[:-1] * np.sqrt(LOW / GRAVITY)
    rises = quarter[1:] * np.sqrt(HIGH / GRAVITY)
    return np.cumsum(np.column_stack([falls, rises])), amplitudes


def sudden_crouch(instants: NDArray) -> Result:
    """Simulate with the length held between the instants, with ten communication points in each quarter swing."""
    knots = np.concatenate([[0.0], instants])
    times = np.append(np.concatenate([np.linspace(a, b, 10, endpoint=False) for a, b in pairwise(knots)]), knots[-1])

    def length(t: float) -> float:
        quarter = np.searchsorted(instants, t, side="right")  # at an instant the new length holds
        return LOW if quarter % 2 == 0 else HIGH

    return simulate(
        fmu_path("Pendulum"),
        times=times,
        tolerance=TOLERANCE,
        inputs={"length": length},
        theta_0=AMPLITUDE,
        length=LOW,
    )


def smooth_pumping(*, theta_0: float, stop_time: float) -> Result:
    system = System("pumped swing")
    swing = system.add("swing", fmu_path("Pendulum"), theta_0=theta_0, input_reconstruction=2)
    motor = system.add("operator", fmu_path("Sinusoid"), offset=1.0, amplitude=DEPTH, angular_frequency=FREQUENCY)
    system.connect(motor["y"], swing["length"])
    return system.simulate(stop_time=stop_time, step_size=0.02, tolerance=TOLERANCE)


def judge_sudden(result: Result, instants: NDArray, amplitudes: NDArray) -> list[Verdict]:
    turning = np.searchsorted(result.time, instants[1::2])
    lowest = np.searchsorted(result.time, instants[0::2])
    versine = 1 - np.cos(result["theta"][turning])
    scale = float(np.max(np.abs(result["energy"])))
    return [
        verdict(
            f"sudden: 1 - cos θ_max grows {LOW / HIGH:g}³-fold in each of {HALF_SWINGS} half swings",
            error=max_error(versine / (1 - np.cos(amplitudes[1:])), 1.0),
            tolerance=1e-8,
            reason="solver tolerance 1e-11 over 11 s, amplification below 100",
        ),
        verdict(
            "sudden: θ = 0 at the instants that elliptic integrals give",
            error=max_error(result["theta"][lowest], 0.0),
            tolerance=1e-8,
            unit="rad",
            reason="as above",
        ),
        verdict(
            "sudden: the energy gained is the operator's work, impulses included",
            error=float(np.max(np.abs(result["energy_balance"]))),
            tolerance=10 * TOLERANCE * scale * result.time[-1],
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
    ]


def integrate(times: NDArray, *, theta_0: float) -> NDArray:
    """θ(t) of the smoothly pumped swing by Newton's law and SciPy's DOP853 at 1e-13."""

    def rates(t: float, y: NDArray) -> NDArray:
        length, rate = 1 + DEPTH * np.sin(FREQUENCY * t), DEPTH * FREQUENCY * np.cos(FREQUENCY * t)
        return np.array([y[1], -(GRAVITY * np.sin(y[0]) + 2 * rate * y[1]) / length])

    return solve_ivp(rates, (0, times[-1]), [theta_0, 0.0], "DOP853", times, rtol=1e-13, atol=1e-13).y[0]


def judge_smooth(result: Result, reference: NDArray) -> list[Verdict]:
    scale = float(np.max(np.abs(result["swing.energy"])))
    return [
        verdict(
            "smooth: θ(t) against a 1e-13 integration",
            error=max_error(result["swing.theta"], reference),
            tolerance=1e-7,
            unit="rad",
            reason="σ interpolated over 0.02 s (error 1e-13 a step), amplified by the growth, about 100-fold",
        ),
        verdict(
            "smooth: the energy gained is the operator's work",
            error=float(np.max(np.abs(result["swing.energy_balance"]))),
            tolerance=10 * TOLERANCE * scale * result.time[-1],
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
    ]


def judge_growth_rate() -> Verdict:
    """Small swings grow by exp(2π/Ω_0 · rate) from one of their periods to the next, once the growing mode is alone."""
    result = smooth_pumping(theta_0=1e-6, stop_time=20.0)
    omega = np.sqrt(GRAVITY)
    period = 2 * np.pi / omega
    size = np.interp([6 * period, 9 * period], result.time, np.hypot(result["swing.theta"], result["swing.p_theta"]))
    rate = np.log(size[1] / size[0]) / (3 * period)
    expected = 0.75 * DEPTH * omega
    return verdict(
        f"smooth, small swings: growth rate {rate:.4f} /s is ¾ ε Ω_0",
        error=abs(rate / expected - 1),
        tolerance=DEPTH,
        reason="¾ ε Ω_0 is the leading term, the next is of relative size ε",
    )


def draw(
    figure: Path, sudden: Result, instants: NDArray, *, amplitudes: NDArray, smooth: Result, reference: NDArray
) -> None:
    turning, sign = instants[1::2], (-1.0) ** np.arange(1, HALF_SWINGS + 1)
    _, axes = plt.subplots(2, 2, figsize=(10, 5), sharex="col", height_ratios=[3, 1], layout="constrained")
    columns = (("sudden crouch and rise", sudden, ""), ("smooth, at twice the swing's frequency", smooth, "swing."))
    for (angle, length), (title, result, prefix) in zip(axes.T, columns, strict=True):
        angle.plot(result.time, np.degrees(result[f"{prefix}theta"]), label="θ from the FMU")
        drawstyle = "default" if prefix else "steps-post"
        length.plot(result.time, result[f"{prefix}length"], color="tab:orange", drawstyle=drawstyle)
        angle.set(title=title)
        length.set(xlabel="t [s]")
    axes[0, 0].plot(turning, np.degrees(sign * amplitudes[1:]), "k.", label="closed form, (l_low/l_high)³")
    axes[0, 0].set_ylabel("θ [deg]")
    axes[0, 1].plot(smooth.time[::20], np.degrees(reference[::20]), "k.", markersize=3, label="integration at 1e-13")
    for axis in axes[0]:
        axis.legend(loc="upper left")
    axes[1, 0].set_ylabel("length [m]")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
