"""Foucault's pendulum: the floor of the Panthéon turns beneath a plane of swing that stays fixed.

An operator turns the floor about the vertical at the rate Ω = ω sin λ, where λ is the latitude.  A bob that is released
from rest relative to the floor has the speed Ω a in a frame that does not turn.  There it is a spherical pendulum: its
orbit is an ellipse with the half axes a and b = Ω a/n, n² = g/l, which itself turns at the rate 3/8 n a b/l² (Airy).
Relative to the floor, the plane of swing turns by

    -Ω t (1 - 3/8 (a/l)²).

Weight and wire exert no moment about the vertical, so the floor turns without a torque.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons import Linkage, simulate
from liaisons.joints import Body, BodyPoint, Revolute, Universal, ground
from liaisons.scenarios import Claims, dots, panels, scenario, within

LENGTH, MASS, GRAVITY, AMPLITUDE, STOP = 67.0, 28.0, 9.81, 3.0, 1800.0
TURN = 2 * np.pi / 86164.0905 * np.sin(np.deg2rad(48.846))  # sidereal day [s], latitude of the Panthéon


class FoucaultPendulum(Linkage):
    """Bob on a wire above a floor that an operator turns."""

    floor, bob = Body(), Body(mass=MASS, centre=(0, 0, -LENGTH))
    turn = Revolute(ground, floor, axis="z", prescribed=True)
    wire = Universal(floor, bob)
    centre = BodyPoint(bob, at=(0, 0, -LENGTH))


def spherical_pendulum(times: NDArray) -> NDArray:
    """Complex position [m] in the plane, of the bob in a frame that does not turn."""

    def rates(_: float, state: NDArray) -> NDArray:
        r, v = state[:3], state[3:]
        return np.concatenate([v, [0, 0, -GRAVITY] - (v @ v - GRAVITY * r[2]) / LENGTH**2 * r])

    start = [AMPLITUDE, 0, -np.sqrt(LENGTH**2 - AMPLITUDE**2), 0, TURN * AMPLITUDE, 0]
    x, y = solve_ivp(rates, times[[0, -1]], start, "DOP853", times, rtol=1e-13, atol=1e-13).y[:2]
    return x + 1j * y


@scenario
def main(claim: Claims) -> None:
    run = simulate(
        FoucaultPendulum,
        inputs={"turn": lambda t: (TURN * t, TURN, 0.0)},
        wire_y_0=-np.arcsin(AMPLITUDE / LENGTH),
        stop_time=STOP,
        step_size=0.2,
        tolerance=1e-13,
    )
    bob = run["centre_x"] + 1j * run["centre_y"]
    solver = "errors of two solvers, 1e-13 a step, over 110 swings"
    exact = spherical_pendulum(run.time)
    claim("motion in a frame that does not turn", bob, exact, within(1e-8, "m", because=solver))
    claim("torque of the floor", run["turn_force"], 0.0, within(1e-9, "N.m", because="rounding of m g l = 2e4 N.m"))

    on_floor = bob * np.exp(-1j * TURN * run.time)
    ends = np.flatnonzero(np.diff(np.sign(np.diff(np.abs(bob)))) < 0) + 1
    plane, t = np.angle(on_floor[ends] ** 2) / 2, run.time[ends]  # the square is the same at both ends of a swing
    law = -TURN * (1 - 3 / 8 * (AMPLITUDE / LENGTH) ** 2)
    nearest = "the end of a swing is known to h/2, and the angle to Ω h/2 = 5e-6 rad of 0.1 rad"
    claim(
        "rate of the plane, over that of the law", np.polyfit(t, plane, 1)[0] / law, 1.0, within(5e-5, because=nearest)
    )

    path, turned = panels(("on the floor", "x [m]", "y [m]"), ("the plane of swing", "t [min]", "turned by [°]"))
    path.plot(on_floor.real[::5], on_floor.imag[::5], linewidth=0.3)
    turned.plot(t / 60, np.rad2deg(law * t), label="-Ω t (1 - 3/8 (a/l)²)")
    dots(turned, t / 60, np.rad2deg(plane), label="ends of the swings")
