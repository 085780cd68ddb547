"""Two operators lead a falling cat round a closed loop of shapes: it turns by a line integral, found in sixth order.

M 8.2.  Two Sinusoids move the limbs of a PlanarCat once round an ellipse of shapes while it falls.  Without angular
momentum φ' = -(J_1 ψ_1' + J_2 ψ_2')/I, so a closed loop turns the trunk by -∮ (J_1 dψ_1 + J_2 dψ_2)/I, whoever falls
where; a loop that is retraced turns it by nothing.  The triples of the operators give quintic polynomials of σ between
communication points: sixth order in H, twenty points a loop are plenty.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import quad

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, slope, verdict

CAT = {"mass_0": 2.0, "mass_1": 1.0, "mass_2": 1.0, "inertia_0": 0.05, "inertia_1": 0.02, "inertia_2": 0.02}
HINGE, ARM, FALL, SIZE = 0.2, 0.25, 0.8, 1.0  # lengths [m], time [s], half axes of the loop [rad]
CENTRE = (np.pi / 2, -np.pi / 2)
STEPS = (8, 12, 16, 24)

fmu = cache(fmu_path)  # asking for the path checks that the FMU is up to date


def turn_rate(psi: tuple[float, float], rate: tuple[float, float]) -> float:
    """φ' without angular momentum (M eq. 58): A, B, C from reduced masses, limbs alike."""
    mass = CAT["mass_0"] + 2 * CAT["mass_1"]
    reduced, both = CAT["mass_1"] * (mass - CAT["mass_1"]) / mass, CAT["mass_1"] ** 2 / mass
    A, C, own = HINGE * ARM * (reduced + both), ARM**2 * both, CAT["inertia_1"] + ARM**2 * reduced
    cosines = np.cos(psi[0]), np.cos(psi[1]), np.cos(psi[0] - psi[1])
    inertia = CAT["inertia_0"] + 2 * own + 2 * HINGE**2 * (reduced + both) + 2 * np.dot((A, A, C), cosines)
    return -sum((own + A * c + C * cosines[2]) * r for c, r in zip(cosines, rate, strict=False)) / inertia


def shapes(phase: float, t: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """ψ and ψ' on the loop; phase π/2 makes it an ellipse, 0 a line that is retraced."""
    w = 2 * np.pi / FALL
    psi = CENTRE[0] + SIZE * np.sin(w * t), CENTRE[1] + SIZE * np.sin(w * t + phase)
    return psi, (SIZE * w * np.cos(w * t), SIZE * w * np.cos(w * t + phase))


def fall(phase: float, steps: int) -> Result:
    system = System("falling cat")
    start = {"phi_0": 0.0, "phi_dot_0": turn_rate(*shapes(phase, 0.0)), "com_z_0": 0.0, "com_z_dot_0": 0.0}
    cat = system.add("cat", fmu("PlanarCat"), hinge=HINGE, arm_1=ARM, arm_2=ARM, **CAT, **start)
    for limb, (centre, shift) in enumerate(zip(CENTRE, (0.0, phase), strict=True), 1):
        motion = {"offset": centre, "amplitude": SIZE, "angular_frequency": 2 * np.pi / FALL, "phase": shift}
        system.connect(system.add(f"limb_{limb}", fmu("Sinusoid"), **motion)["y"], cat[f"psi_{limb}"])
    return system.simulate(FALL, FALL / steps, tolerance=1e-12, coupling="implicit")


def main(figure: Path) -> list[Verdict]:
    loop = quad(lambda t: turn_rate(*shapes(np.pi / 2, t)), 0, FALL, epsabs=1e-12)[0]
    results = [fall(np.pi / 2, steps) for steps in STEPS]
    errors = [abs(float(result["cat.phi"][-1]) - loop) for result in results]
    order, fine, flat = slope(1 / np.array(STEPS), errors), fall(np.pi / 2, 100), fall(0.0, 100)
    turned, spin = fine["cat.phi"][-1], max_error(fine["cat.angular_momentum"], 0.0)
    fallen = max_error(fine["cat.com_z"], -9.81 / 2 * fine.time**2)
    rows = (
        (f"order {order:.2f} is 6", abs(order - 6), 0.3, "", "terms of higher order at 8 to 24 points"),
        ("turn after the loop", abs(turned - loop), 1e-9, "rad", "(2π/100)⁶/720 of 1 rad, tolerance 1e-12"),
        ("turn on a line retraced", abs(flat["cat.phi"][-1]), 1e-9, "rad", "as above"),
        ("it falls like a stone", fallen, 1e-12, "m", "a parabola: rounding"),
        ("angular momentum stays 0", spin, 1e-12, "kg.m2/s", "p_φ is constant: rounding"),
    )
    _, (turn, convergence) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    turn.plot(fine.time, np.degrees(fine["cat.phi"]), label="once round")
    turn.plot(flat.time, np.degrees(flat["cat.phi"]), label="to and fro")
    turn.axhline(np.degrees(loop), color="k", linewidth=0.6)
    turn.set(xlabel="t [s]", ylabel="φ [deg]", title="the trunk")
    turn.legend()
    convergence.loglog(STEPS, errors, "o-", label=f"order {order:.2f}")
    convergence.set(xlabel="communication points a loop", ylabel="error of the turn [rad]")
    convergence.legend()
    plt.savefig(figure, dpi=150)
    return [verdict(c, error=e, tolerance=bound, unit=u, reason=reason) for c, e, bound, u, reason in rows]


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
