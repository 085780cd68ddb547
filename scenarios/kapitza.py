"""A pendulum stands upright on a pivot that is shaken fast enough: beyond a²ν² = 2gl, where the trace falls below 2.

A Sinusoid moves pivot_z of a Pendulum, z = a sin νt.  About the upright position (linear, φ = θ - π) the motion over
one period is a matrix of determinant 1; the rest is stable while the modulus of its trace is below 2.  The matrix comes
from the FMU, started beside the upright position, and from an integration of l φ'' = (g - a ν² sin νt) φ.  K_Y is not
constant here, unlike in the examples of M 8.1-8.3: its mean ¼ m a²ν² sin² θ is Kapitza's potential.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, verdict

GRAVITY, LENGTH, AMPLITUDE = 9.81, 1.0, 0.1
NEAR = 1e-4  # start beside the upright position; what is not linear is of relative size NEAR²
FREQUENCIES = np.array([40.0, 42.0, 43.0, 44.0, 45.0, 46.0, 48.0, 52.0, 60.0, 80.0, 100.0])


def shaken(frequency: float, *, stop_time: float, steps: int, **start: float) -> Result:
    system = System("Kapitza's pendulum")
    pendulum = system.add("pendulum", fmu_path("Pendulum"), input_reconstruction=2, **start)
    shaker = system.add("shaker", fmu_path("Sinusoid"), amplitude=AMPLITUDE, angular_frequency=frequency)
    system.connect(shaker["y"], pendulum["pivot_z"])
    return system.simulate(stop_time, stop_time / steps, tolerance=1e-12)


def trace_of_fmu(frequency: float) -> float:
    """Trace of the map of (φ, φ') over one period, by differences of runs on both sides of the upright position."""
    columns = []
    for name in ("theta_0", "theta_dot_0"):
        ends = []
        for sign in (1, -1):
            start = {"theta_0": np.pi, "theta_dot_0": 0.0}
            start[name] += sign * NEAR
            result = shaken(frequency, stop_time=2 * np.pi / frequency, steps=40, **start)
            ends.append([result["pendulum.theta"][-1], result["pendulum.theta_dot"][-1]])
        columns.append((np.array(ends[0]) - ends[1]) / (2 * NEAR))
    return float(np.trace(np.column_stack(columns)))


def trace_of_mathieu(frequency: float) -> float:
    def rates(t: float, y: NDArray) -> NDArray:
        pull = (GRAVITY - AMPLITUDE * frequency**2 * np.sin(frequency * t)) / LENGTH
        return np.array([y[1], pull * y[0], y[3], pull * y[2]])

    end = solve_ivp(rates, (0, 2 * np.pi / frequency), [1, 0, 0, 1], "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return float(end[0] + end[3])


def main(figure: Path) -> list[Verdict]:
    traces = np.array([trace_of_fmu(frequency) for frequency in FREQUENCIES])
    reference = np.array([trace_of_mathieu(frequency) for frequency in FREQUENCIES])
    leading = np.sqrt(2 * GRAVITY * LENGTH) / AMPLITUDE
    stable = traces < 2
    slow = np.arccos(traces[-1] / 2) * FREQUENCIES[-1] / (2 * np.pi)
    averaged = np.sqrt((AMPLITUDE * FREQUENCIES[-1] / LENGTH) ** 2 / 2 - GRAVITY / LENGTH)
    standing = shaken(60.0, stop_time=20.0, steps=8000, theta_0=np.pi - 0.2)
    falling = shaken(40.0, stop_time=20.0, steps=8000, theta_0=np.pi - 0.01)
    scale = float(np.max(np.abs(standing["pendulum.energy"])))
    draw(figure, traces, standing, falling)
    return [
        verdict(
            "trace of the motion over one period, ν = 40 to 100 rad/s",
            error=max_error(traces, reference),
            tolerance=1e-6,
            reason="NEAR² = 1e-8, solver and interpolation 1e-10 over NEAR",
        ),
        verdict(
            f"the upright position becomes stable between 44 and 45 rad/s; leading order says {leading:.2f}",
            error=float(np.sum(stable != (leading < FREQUENCIES))),
            tolerance=0,
            reason="a count; the traces at 44 and 45 differ from 2 by 4e-3",
        ),
        verdict(
            f"ν = 100: it swings about the top with √(a²ν²/2l² - g/l) = {averaged:.2f} rad/s",
            error=abs(slow / averaged - 1),
            tolerance=AMPLITUDE / LENGTH,
            reason="the averaged potential is the leading term, the next is of relative size a/l",
        ),
        verdict(
            "ν = 60: started 0.2 rad off the top it stays about it for 20 s",
            error=max_error(standing["pendulum.theta"], np.pi),
            tolerance=float(np.arccos(2 * GRAVITY * LENGTH / (AMPLITUDE * 60.0) ** 2)),
            unit="rad",
            reason="edge of the well of the averaged potential -mgl cos θ + ¼ m a²ν² sin² θ",
        ),
        verdict(
            "the energy gained is the shaker's work",
            error=float(np.max(np.abs(standing["pendulum.energy_balance"]))),
            tolerance=10 * 1e-12 * scale * 20.0,
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
    ]


def draw(figure: Path, traces: NDArray, standing: Result, falling: Result) -> None:
    fine = np.linspace(40, 100, 121)
    _, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    left.plot(fine, [trace_of_mathieu(frequency) for frequency in fine], label="Mathieu's equation")
    left.plot(FREQUENCIES, traces, "k.", label="FMU")
    left.axhline(2, color="gray", linewidth=0.8)
    left.set(xlabel="ν [rad/s]", ylabel="trace", title="stable below 2")
    left.legend()
    for label, result in (("ν = 60", standing), ("ν = 40", falling)):
        right.plot(result.time, np.degrees(result["pendulum.theta"]), linewidth=0.8, label=f"{label} rad/s")
    right.set(xlabel="t [s]", ylabel="θ [deg]", title="upright is 180°")
    right.legend()
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
