"""Two operators take a falling cat round a closed loop of shapes: it turns by a line integral, to sixth order.

M 8.2.  Two Sinusoids move the limbs of a PlanarCat once round an ellipse of shapes while it falls.  Without angular
momentum φ' = -(J_1 ψ_1' + J_2 ψ_2')/I, so a closed loop turns the trunk by -∮ (J_1 dψ_1 + J_2 dψ_2)/I, at any speed.  A
path that is retraced does not turn it.  From the operators' values, rates and accelerations, σ is reconstructed by
quintic polynomials between communication points.  This is of sixth order in H, so twenty points per loop suffice.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import quad

from liaisons import Result, operator, simulate
from liaisons.models import PlanarCat
from liaisons.scenarios import Claims, Lesson, panels, scenario, within

MASSES = {"mass_0": 2.0, "mass_1": 1.0, "mass_2": 1.0, "inertia_0": 0.05, "inertia_1": 0.02, "inertia_2": 0.02}
CAT: Any = {"hinge": 0.2, "arm_1": 0.25, "arm_2": 0.25, **MASSES}
FALL, W = 0.8, 2 * np.pi / 0.8  # time of the fall [s], in which the loop is run through once
STEPS = np.array([8, 12, 16, 24])


def turn_rate(t: float, phase: float) -> float:
    """φ' on the loop; phase π/2 makes it an ellipse, 0 a line that is retraced."""
    psi = np.pi / 2 + np.sin(W * t), -np.pi / 2 + np.sin(W * t + phase)
    return float(PlanarCat.turn_rate(*psi, W * np.cos(W * t), W * np.cos(W * t + phase), **CAT))


def fall(phase: float, steps: int) -> Result:
    limbs: Any = {
        "psi_1": operator("Sinusoid", offset=np.pi / 2, angular_frequency=W),
        "psi_2": operator("Sinusoid", offset=-np.pi / 2, angular_frequency=W, phase=phase),
    }
    start: Any = {"phi_0": 0.0, "phi_dot_0": turn_rate(0.0, phase), "com_z_0": 0.0, "com_z_dot_0": 0.0}
    return simulate("PlanarCat", stop_time=FALL, step_size=FALL / steps, tolerance=1e-12, **CAT, **start, **limbs)


def lesson() -> Lesson:
    return Lesson(
        "PlanarCat",
        question="A cat falls without spin.  Can it move its limbs so that, back in its first shape, it has turned?",
        predict="Its angular momentum stays 0.  Is the trunk back at its first angle after each round of the limbs?",
        try_out="Both limbs swing, a quarter of a period apart.  Then hold the first: set psi_1, and press Reset.",
        answer="It turns with each round, by the same angle at any speed: -∮ (J_1 dψ_1 + J_2 dψ_2)/I, an area in the "
        "space of shapes.  With one limb alone the path is retraced and encloses no area, so the cat does not turn.",
        controls=["psi_1", "psi_2"],
        plots=["phi"],
        start_values={
            **CAT,
            "gravity": 0.0,  # as seen by one who falls with it
            "phi_dot_0": PlanarCat.turn_rate(np.pi / 2 + 1, -np.pi / 2, 0.0, W, **CAT),
            "psi_1": operator("Sinusoid", offset=np.pi / 2, angular_frequency=W, phase=np.pi / 2),
            "psi_2": operator("Sinusoid", offset=-np.pi / 2, angular_frequency=W),
        },
    )


@scenario
def main(claim: Claims) -> None:
    loop = quad(turn_rate, 0, FALL, args=(np.pi / 2,), epsabs=1e-12)[0]
    errors = [abs(fall(np.pi / 2, steps)["phi"][-1] - loop) for steps in STEPS]
    fine, flat = fall(np.pi / 2, 100), fall(0.0, 100)
    sixth = within(0.3, because="terms of higher order in H, at 8 to 24 points a loop")
    claim.order("the error of the turn is of order 6 in H", 1 / STEPS, errors, 6, sixth)
    solver = within(1e-9, "rad", because="error of interpolating σ, (2π/100)⁶/720 times 1 rad; solver tolerance 1e-12")
    claim("turn after the loop", fine["phi"][-1], loop, solver)
    claim("turn on a path that is retraced", flat["phi"][-1], 0.0, solver)
    parabola = within(1e-12, "m", because="a parabola is integrated exactly up to rounding")
    claim("it falls freely", fine["com_z"], -9.81 / 2 * fine.time**2, parabola)
    constant = within(1e-12, "kg.m2/s", because="p_φ is constant up to rounding")
    claim("angular momentum stays 0", fine["angular_momentum"], 0.0, constant)

    turn, convergence = panels(
        ("the trunk", "t [s]", "φ [deg]"), ("sixth order", "communication points a loop", "error of the turn [rad]")
    )
    turn.plot(fine.time, np.degrees(fine["phi"]), label="once round")
    turn.plot(flat.time, np.degrees(flat["phi"]), label="to and fro")
    turn.axhline(np.degrees(loop), color="k", linewidth=0.6, label="line integral")
    convergence.loglog(STEPS, errors, "o", label="FMU")
    convergence.loglog(STEPS, errors[-1] * (STEPS[-1] / STEPS) ** 6.0, color="0.6", label="points⁻⁶")
