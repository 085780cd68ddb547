"""Leaning back and forth turns a swing though p_θ stays: a quick lean ψ_1 → ψ_2 shifts the rope by -∫ (J/I) dψ.

M 8.1 with two masses, where the posture couples to the swing, J ≠ 0.  A lean within τ moves θ by its horizontal lift,
up to what gravity does meanwhile, of second order in τ.  Leaning with the swing's own frequency then pumps it: the FMU
against an integration of p_θ' = -D sin θ_com, I θ' = p_θ - J ψ' (M eq. 54-56).
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, slope, verdict

SEAT, TORSO, BODY, ROPE, GRAVITY = 20.0, 20.0, 0.5, 2.0, 9.81  # defaults of the component, in SI units
UPRIGHT, BACK = np.pi, np.pi / 2  # leans: torso along the rope, and across it
DURATIONS = np.array([0.16, 0.08, 0.04, 0.02])
TOLERANCE = 1e-11


def inertia(lean: float) -> float:
    return SEAT * ROPE**2 + TORSO * (ROPE**2 + BODY**2 + 2 * ROPE * BODY * np.cos(lean))


def coupling(lean: float) -> float:
    return TORSO * (BODY**2 + ROPE * BODY * np.cos(lean))


def torque(theta: float, lean: float) -> float:
    """-D sin θ_com, as the two weights give it."""
    return -GRAVITY * (SEAT * ROPE * np.sin(theta) + TORSO * (ROPE * np.sin(theta) + BODY * np.sin(theta + lean)))


def quick_lean(duration: float) -> float:
    """θ after leaning back from upright within a time, starting at rest where the centre of mass hangs lowest."""
    system = System("quick lean")
    swing = system.add("swing", fmu_path("Swing"), theta_0=0.0, lean=UPRIGHT, input_reconstruction=2)
    child = system.add("child", fmu_path("SmoothStep"), start_value=UPRIGHT, end_value=BACK, duration=duration)
    system.connect(child["y"], swing["lean"])
    return float(system.simulate(duration, duration / 50, tolerance=TOLERANCE)["swing.theta"][-1])


def pumping(frequency: float, stop_time: float) -> Result:
    system = System("torso pumping")
    swing = system.add("swing", fmu_path("Swing"), lean=3 * np.pi / 4, theta_0=0.05, input_reconstruction=2)
    child = system.add(
        "child", fmu_path("Sinusoid"), offset=3 * np.pi / 4, amplitude=np.pi / 4, angular_frequency=frequency
    )
    system.connect(child["y"], swing["lean"])
    return system.simulate(stop_time, 0.02, tolerance=TOLERANCE)


def integrate(result: Result, frequency: float) -> NDArray:
    def lean(t: float) -> tuple[float, float]:
        return (
            3 * np.pi / 4 + np.pi / 4 * np.sin(frequency * t),
            np.pi / 4 * frequency * np.cos(frequency * t),
        )

    def rates(t: float, y: NDArray) -> NDArray:
        psi, psi_dot = lean(t)
        return np.array([(y[1] - coupling(psi) * psi_dot) / inertia(psi), torque(y[0], psi)])

    psi, psi_dot = lean(0.0)
    start = [0.05, coupling(psi) * psi_dot]  # θ' = 0
    times = result.time
    return solve_ivp(rates, (0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-13).y


def main(figure: Path) -> list[Verdict]:
    lift = -quad(lambda lean: coupling(lean) / inertia(lean), UPRIGHT, BACK, epsabs=1e-13)[0]
    shifts = np.array([quick_lean(duration) for duration in DURATIONS])
    errors = np.abs(shifts - lift)

    frequency = np.sqrt(GRAVITY / ROPE)
    result = pumping(frequency, 40.0)
    theta, p_theta = integrate(result, frequency)
    scale = float(np.max(np.abs(result["swing.energy"])))
    growth = np.max(np.abs(result["swing.theta"])) / 0.05

    _, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    left.loglog(DURATIONS, errors, "ko-", markersize=4)
    left.set_xticks(DURATIONS, [f"{duration:g}" for duration in DURATIONS])
    left.minorticks_off()
    left.set(xlabel="duration τ [s]", ylabel="|Δθ + ∫(J/I) dψ| [rad]", title="a quick lean is a horizontal lift")
    right.plot(result.time, np.degrees(result["swing.theta"]), label="FMU")
    right.plot(result.time[::25], np.degrees(theta[::25]), "k.", markersize=3, label="integration at 1e-13")
    right.set(xlabel="t [s]", ylabel="θ [deg]", title="leaning at the swing's frequency")
    right.legend(loc="upper left")
    plt.savefig(figure, dpi=150)
    return [
        verdict(
            f"quick lean: the rope ends {np.degrees(lift):.2f}° off; the error is of second order in τ",
            error=abs(slope(DURATIONS, errors) - 2),
            tolerance=0.1,
            reason="gravity shifts θ by D τ²/I and higher orders",
        ),
        verdict(
            "quick lean within 0.02 s: Δθ = -∫ (J/I) dψ",
            error=float(errors[-1]),
            tolerance=GRAVITY / ROPE * DURATIONS[-1] ** 2,
            unit="rad",
            reason="g/l τ², what gravity can do in the time",
        ),
        verdict(
            f"pumping: θ(t) grows {growth:.0f}-fold, as the integration says",
            error=max_error(result["swing.theta"], theta),
            tolerance=1e-7,
            unit="rad",
            reason="solver 1e-11, σ interpolated over 0.02 s, amplified about 100-fold in 40 s",
        ),
        verdict(
            "pumping: p_θ, which the lean itself never changes",
            error=max_error(result["swing.p_theta"], p_theta) / scale,
            tolerance=1e-7,
            reason="as above, relative to the energy scale",
        ),
        verdict(
            "the energy gained is the child's work",
            error=float(np.max(np.abs(result["swing.energy_balance"]))),
            tolerance=10 * TOLERANCE * scale * 40.0,
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
    ]


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
