"""A bead leaves a sphere at cos θ = (2/3) cos θ_0, and Marle's hoop where the normal force changes sign.

A sphere can only push.  If the bead starts from rest at θ_0, the force m g (3 cos θ - 2 cos θ_0) falls to 0 at this
angle, and the bead continues along a parabola.  The hoop of M 8.4 holds its bead from both sides.  If a hoop can only
push, like the Ring of this file, the bead has the same motion up to the first zero of ``normal_force``, and then moves
on in a straight line.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from liaisons import ActiveCoordinate, Coordinate, Mechanism, Parameter, simulate, unilateral
from liaisons.models import BeadOnSphere, CircularHoop
from liaisons.scenarios import Claims, dots, panels, scenario, within

SETTINGS: Any = {"stop_time": 1.5, "step_size": 0.01, "tolerance": 1e-13}
OFFSET = 0.5  # R = 1 m, m = 1 kg
TURNING: Any = {"offset": OFFSET, "xi_0": 0.0, "xi_dot_0": -1.5, "beta_dot": 1.0}


class Ring(Mechanism):
    """Bead inside a ring that an operator turns about a point off its centre, in a horizontal plane."""

    mass = Parameter(1.0, "kg", "mass of the bead", above=0)
    radius = Parameter(1.0, "m", "radius of the ring", above=0)
    offset = Parameter(OFFSET, "m", "distance of its centre from the axis")
    x = Coordinate("m", "position of the bead", start=1 + OFFSET)
    y = Coordinate("m", "position of the bead, across")
    beta = ActiveCoordinate("rad", "angle of the centre")

    @unilateral("m", "distance of bead and ring")
    def gap(self) -> ca.SX:
        across = self.x - self.offset * ca.cos(self.beta), self.y - self.offset * ca.sin(self.beta)
        return self.radius - ca.norm_2(ca.vertcat(*across))

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y})

    def potential_energy(self) -> ca.SX:
        return ca.SX(0)


@scenario
def main(claim: Claims) -> None:
    slide, ring = panels(("off a sphere", "x [m]", "z [m]"), ("off a hoop", "t [s]", "force [N]"))
    metres = within(1e-10, "m", because="errors at solver tolerance 1e-13, amplified less than 100-fold")
    comparison = within(0.0, because="an inequality at all communication points")
    for theta in (0.1, 0.5, 1.0):
        start = {"x_0": np.sin(theta), "z_0": np.cos(theta)}
        run = simulate("BeadOnSphere", record=["x", "z", "gap", "gap_force"], start_values=start, **SETTINGS)
        expected = BeadOnSphere.exact(run.time, **start)
        claim(f"θ_0 = {theta}: x, z", run, {name: expected[name] for name in ("x", "z")}, metres)
        angle, instant = BeadOnSphere.leaves(**start)
        text = f"θ_0 = {theta}: it leaves at θ = {angle:.4f}, t = {instant:.4f} s"
        claim(text, run["gap_force"] > 0, run.time < instant, comparison)
        slide.plot(run["x"], run["z"], label=f"θ$_0$ = {theta}")
        dots(slide, expected["x"], expected["z"])
    slide.set_aspect("equal")

    end: Any = brentq(lambda t: float(CircularHoop.exact(t, **TURNING)["normal_force"]), 1.0, 1.3, xtol=1e-15)
    turned = {"beta": lambda t: (t, 1.0, 0.0)}
    run = simulate(Ring, inputs=turned, record=["x", "y", "gap", "gap_force"], **SETTINGS)
    held = CircularHoop.exact(run.time, **TURNING)
    on_it = run.time < end
    claim(f"the force of the hoop ends at {end:.4f} s", run["gap_force"] > 0, on_it, comparison)
    newton = within(1e-9, "N", because="errors at solver tolerance 1e-13, amplified less than 100-fold")
    claim("up to then it equals normal_force", run["gap_force"][on_it], held["normal_force"][on_it], newton)
    exact = CircularHoop.exact(np.append(run.time[on_it], end), **TURNING)
    angle = exact["xi"] + np.append(run.time[on_it], end)
    x, y = (OFFSET * f(np.append(run.time[on_it], end)) + f(angle) for f in (np.cos, np.sin))
    claim("the bead moves like the hoop's bead", [run["x"][on_it], run["y"][on_it]], [x[:-1], y[:-1]], metres)
    rates = (
        -OFFSET * np.sin(end) - np.sin(angle[-1]) * (exact["xi_dot"][-1] + 1),
        OFFSET * np.cos(end) + np.cos(angle[-1]) * (exact["xi_dot"][-1] + 1),
    )
    flown = run.time[~on_it] - end
    straight = [x[-1] + rates[0] * flown, y[-1] + rates[1] * flown]
    claim("then it moves in a straight line", [run["x"][~on_it], run["y"][~on_it]], straight, metres)
    ring.plot(run.time, run["gap_force"], label="ring that only pushes")
    ring.plot(run.time, held["normal_force"], "--", label="normal_force of the hoop")
