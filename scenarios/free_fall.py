"""Falls from all heights are similar: the trajectory is a parabola, and τ'/τ = √(L'/L).

K 2.5, eq. 59: the potential of the weight, +m g z (with the printed sign, bodies would rise), is homogeneous of degree
h = 1, so that scaling lengths by λ scales times by λ^(1 - h/2).  Friction introduces a length of its own, g/η², and the
similarity is lost: falls from great heights take longer.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import crossings, simulate
from liaisons.models import FreeParticle
from liaisons.scenarios import Claims, panels, scenario, slope, within

GRAVITY, FRICTION = 9.81, 0.5  # [m/s2], [1/s]
HEIGHTS = np.array([0.1, 1.0, 10.0, 100.0, 1000.0])  # [m]
THROW: Any = {"x_dot_0": 6.0, "z_dot_0": 8.0}


def fall(height: float, friction: float = 0.0) -> float:
    """Time at which the particle, let go at rest, passes z = 0 [s].

    Without friction the spline is the trajectory itself, else its error is of fourth order in the step.
    """
    longest = 2 * np.sqrt(2 * height / GRAVITY) + 2 * friction * height / GRAVITY
    start: Any = {"z_0": height, "z_dot_0": 0.0, "friction": friction}
    run = simulate("FreeParticle", stop_time=longest, step_size=longest / 1000, tolerance=1e-12, **start)
    return crossings(run.time, run["z"], run["z_dot"])[0]


@scenario
def main(claim: Claims) -> None:
    parabola, damped = (
        simulate("FreeParticle", stop_time=2.0, step_size=0.02, tolerance=1e-12, friction=eta, **THROW)
        for eta in (0.0, FRICTION)
    )
    solver = within(1e-10, "m", because="10 times the solver tolerance 1e-12, times lengths of 10 m; not amplified")
    # From x' = v_x, z' = v_z - g t: eliminate the time.
    t = parabola["x"] / THROW["x_dot_0"]
    claim("z(x) of a throw is the parabola", parabola["z"], THROW["z_dot_0"] * t - GRAVITY / 2 * t**2, solver)
    exact = FreeParticle.exact(damped.time, friction=FRICTION, **THROW)
    claim("a throw with friction follows the exponential", damped, exact, solver)

    times, slowed = ([fall(height, eta) for height in HEIGHTS] for eta in (0.0, FRICTION))
    spline = within(1e-10, because="relative error; the spline is exact for a parabola")
    claim("the fall lasts √(2L/g), from 0.1 m to 1 km", times / np.sqrt(2 * HEIGHTS / GRAVITY), 1.0, spline)
    claim.order("exponent of τ'/τ = (L'/L)^(1/2)", HEIGHTS, times, 0.5, spline)
    sign = within(0.0, because="an inequality: at the terminal velocity g/η the exponent is 1")
    claim.below("with friction the exponent grows: no similarity", 0.6, slope(HEIGHTS, slowed), sign)

    path, law = panels(
        ("a throw", "x [m]", "z [m]"), ("similarity, and its loss", "height L [m]", "time of the fall τ [s]")
    )
    for label, run, durations, marker in (("no friction", parabola, times, "o"), ("η = 0.5 /s", damped, slowed, "s")):
        above = run["z"] >= 0
        path.plot(run["x"][above], run["z"][above], label=label)
        law.loglog(HEIGHTS, durations, marker, label=label)
    path.set(aspect="equal")
    fine = np.geomspace(HEIGHTS[0], HEIGHTS[-1], 50)
    law.loglog(fine, np.sqrt(2 * fine / GRAVITY), color="0.6", label="√(2L/g)")
