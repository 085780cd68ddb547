"""Leaning turns a swing although p_θ is constant: a quick lean ψ_1 → ψ_2 turns the rope by -∫ (J/I) dψ.

M 8.1 with two masses, where the posture is coupled to the swing, J ≠ 0.  A lean in the time τ changes θ by its
horizontal lift, up to the effect of gravity, which is of second order in τ.  Leaning at the swing's own frequency then
pumps it; the FMU is compared with an integration of p_θ' = -D sin θ_com, I θ' = p_θ - J ψ' (M eq. 54-56).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import operator, simulate
from liaisons.models import Swing
from liaisons.scenarios import Claims, dots, panels, scenario, within

UPRIGHT, BACK = np.pi, np.pi / 2  # leans: torso along the rope, and across it
DURATIONS = np.array([0.16, 0.08, 0.04, 0.02])
RATE, TOLERANCE = 9.81 / 2.0, 1e-11  # g/l [1/s2]


def quick_lean(T: float) -> float:
    """θ after leaning back from upright within a time, starting at rest where the centre of mass hangs lowest."""
    lean = operator("SmoothStep", start_value=UPRIGHT, end_value=BACK, duration=T)
    return simulate("Swing", stop_time=T, step_size=T / 50, tolerance=TOLERANCE, theta_0=0.0, lean=lean)["theta"][-1]


@scenario
def main(claim: Claims) -> None:
    lift = Swing.lift(BACK, lean=UPRIGHT)
    errors = [abs(quick_lean(T) - lift) for T in DURATIONS]
    falling = within(0.1, because="gravity shifts θ by D τ²/I and terms of higher order")
    text = f"quick lean: the rope ends {np.degrees(lift):.2f}° off; the error is of second order in τ"
    claim.order(text, DURATIONS, errors, 2, falling)
    gravity = within(RATE * DURATIONS[-1] ** 2, "rad", because="g/l τ², the effect of gravity within the time τ")
    claim("quick lean within 0.02 s: Δθ = -∫ (J/I) dψ", errors[-1], 0.0, gravity)

    leaning: Any = {"amplitude": np.pi / 4, "angular_frequency": np.sqrt(RATE)}
    lean = operator("Sinusoid", offset=3 * np.pi / 4, **leaning)
    run = simulate("Swing", stop_time=40.0, step_size=0.02, tolerance=TOLERANCE, theta_0=0.05, lean=lean)
    exact = Swing.leaning(run.time, theta_0=0.05, lean=3 * np.pi / 4, **leaning)
    why = "errors of solver (1e-11) and of σ interpolated over 0.02 s, amplified about 100-fold in 40 s"
    text = f"pumping: θ(t) grows {np.max(np.abs(run['theta'])) / 0.05:.0f}-fold, as in the integration"
    claim(text, run["theta"], exact["theta"], within(1e-7, "rad", because=why))
    scale = np.max(np.abs(run["energy"]))
    relative = within(1e-7, because=f"{why}; relative to the energy scale")
    claim("pumping: p_θ, which leaning does not change", run["p_theta"] / scale, exact["p_theta"] / scale, relative)
    claim.energy("the energy gained is the child's work", run, tolerance=TOLERANCE)

    order, pumping = panels(
        ("a quick lean is a horizontal lift", "duration τ [s]", "|Δθ + ∫(J/I) dψ| [rad]"),
        ("leaning at the swing's frequency", "t [s]", "θ [deg]"),
    )
    order.loglog(DURATIONS, errors, "ko-", markersize=4)
    order.set_xticks(DURATIONS, [f"{T:g}" for T in DURATIONS])
    order.minorticks_off()
    pumping.plot(run.time, np.degrees(run["theta"]), label="FMU")
    dots(pumping, run.time, np.degrees(exact["theta"]), label="integration at 1e-13")
