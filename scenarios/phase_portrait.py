"""The phase portrait of the pendulum: the FMU follows the velocity field of phase space, on closed orbits.

K Ex. 8, Fig. 5 and 6, in x_1 = θ and x_2 = p_θ/(m l² Ω), Ω = 1; K eq. 104, 105.  Released at θ = 10, the pendulum
oscillates about 4π.  Scenario ``phase_patch`` has the flow of a whole patch of phase space.
"""

from __future__ import annotations

import numpy as np

from liaisons import analysis, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

FAR, NEAR = 10.0, 1.0  # x_1(0) of Fig. 5 and of Fig. 6


@scenario
def main(claim: Claims) -> None:
    far, near = (
        simulate("Pendulum", stop_time=40.0, step_size=0.1, tolerance=1e-10, gravity=1.0, theta_0=x)
        for x in (FAR, NEAR)
    )
    field = analysis.phase_velocity(Pendulum).evaluate(theta=far["theta"], p_theta=far["p_theta"], gravity=1.0)
    twice = within(1e-13, "1/s, 1/s2", because="rounding errors of two evaluations of the equations at equal states")
    claim("the FMU moves along the velocity field V(X)", [far["theta_dot"], far["theta_ddot"]], field, twice)
    claim(
        "V is that of K eq. 104, 105",
        field,
        [far["p_theta"], -np.sin(far["theta"])],
        within(1e-13, because="rounding errors"),
    )
    sample = 2 * 0.05**2 * np.sin(8 * np.pi - FAR) / 2 + 1e-7
    beside = within(sample, "rad", because="turning points are up to half a step away from a sample: θ'' (h/2)²/2")
    off = abs(max(far["theta"]) - (8 * np.pi - FAR)) + abs(min(far["theta"]) - FAR)
    claim("released at 10 it swings about 4π, between 10 and 8π - 10", off, 0.0, beside)
    integrals = [run["p_theta"] ** 2 / 2 - np.cos(run["theta"]) for run in (far, near)]
    solver = within(40 * 10 * 1e-10, because="10 times the solver tolerance 1e-10, times the duration")
    text = "orbits are closed: x_2²/2 - cos x_1 is constant on both"
    claim(text, integrals, [[-np.cos(FAR)], [-np.cos(NEAR)]], solver)

    axes = panels(
        ("Fig. 5: pendulum", "x$_1$ = θ", "x$_2$ = p/(m l² Ω)"),
        ("Fig. 6: pendulum in the linearised field", "x$_1$ = θ", "x$_2$ = p/(m l² Ω)"),
    )
    extents = ((8, 17, 2.4), (-1.6, 1.6, 1.3))
    for axis, run, force, (left, right, height) in zip(axes, (far, near), (np.sin, np.asarray), extents, strict=True):
        x_1, x_2 = np.meshgrid(np.linspace(left, right, 19), np.linspace(-height, height, 15))
        axis.quiver(x_1, x_2, x_2, -force(x_1), angles="xy", color="0.6", width=0.003)
        axis.plot(run["theta"], run["p_theta"], color="tab:blue", label="FMU")
    turn = np.linspace(0, 2 * np.pi, 100)
    axes[1].plot(np.cos(turn), np.sin(turn), "--", color="tab:purple", label="linearised")
