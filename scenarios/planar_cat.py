"""A falling cat without angular momentum turns by moving its limbs: by an area in the space of shapes, at any speed.

M 8.2.  Two FourierSeries drive the limbs of a PlanarCat three times round a circle of shapes while its centre of mass
flies along a parabola (M eq. 59).  However long that takes, the trunk turns by the holonomy of the kinetic connection
(M 7), -3 ∮ (J_1 dψ_1 + J_2 dψ_2)/I = -3 ∬ curvature dψ_1 dψ_2; the circle is chosen so that this is half a turn.  Run
through backwards the loop turns the cat the other way, and a path that is retraced turns it not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from liaisons import Claims, Result, analysis, operator, panels, scenario, simulate, within
from liaisons.models import PlanarCat

CAT: Any = {"arm_1": 0.25, "arm_2": 0.25}  # longer limbs than by default
CENTRE = (np.pi / 2, -np.pi / 2)  # of the circle of shapes: both limbs stretched to the same side
ROUNDS, FALL = 3, 0.9  # rounds of the circle, and the duration of the jump [s]
FLIGHT: Any = {"com_z_dot_0": 9.81 * FALL / 2, "com_x_dot_0": 4.5}
DURATIONS = (FALL, 3.0, 10.0)  # of the three rounds; the longer ones are for weightless cats


def circle(r: float) -> Callable[[ca.SX], dict[str, ca.SX]]:
    return lambda a: {"psi_1": CENTRE[0] + r * ca.cos(a), "psi_2": CENTRE[1] + r * ca.sin(a)}


def fall(r: float, duration: float, direction: int = 1, *, retrace: bool = False) -> Result:
    """Three rounds of the circle of radius r, or to and fro on its diameter, without angular momentum."""
    frequency = direction * 2 * np.pi * ROUNDS / duration
    cosine, sine = (r, 0.0) if retrace else (0.0, r)
    spin = PlanarCat.turn_rate(CENTRE[0] + r, CENTRE[1] + cosine, 0.0, sine * frequency, **CAT)
    limbs: Any = {
        "psi_1": operator("FourierSeries", offset=CENTRE[0], angular_frequency=frequency, cos_1=r),
        "psi_2": operator("FourierSeries", offset=CENTRE[1], angular_frequency=frequency, cos_1=cosine, sin_1=sine),
    }
    times: Any = {"stop_time": duration, "step_size": duration / ROUNDS / 100, "tolerance": 1e-10}
    return simulate("PlanarCat", phi_0=np.pi, phi_dot_0=spin, **times, **limbs, **FLIGHT, **CAT)


@scenario
def main(claim: Claims) -> None:
    flight, shapes, turn = panels(
        ("a jump, without angular momentum", "x [m]", "z [m]"),
        ("the loop in the space of shapes", "ψ$_1$ [rad]", "ψ$_2$ [rad]"),
        ("the trunk turns by π, at any speed", "rounds", "φ [deg]"),
        size=(15, 4.5),
    )
    # of the circle that turns the cat by half a turn in three rounds
    r: Any = brentq(
        lambda r: ROUNDS * analysis.holonomy(PlanarCat, circle(r), **CAT)["phi"] + np.pi, 0.5, 2, xtol=1e-14
    )
    area = analysis.curvature_integral(PlanarCat, circle(r), **CAT)["phi"]
    nodes = within(1e-10, "rad", because="integration at 1e-12 over one turn, 24 Gauss nodes a radius")
    claim("the line integral of the connection is the area integral of its curvature", area, -np.pi / ROUNDS, nodes)
    why = "solver tolerance 1e-10, no amplification; σ interpolated over a 100th of a round, 1e-12"
    turned = within(1e-8, "rad", because=why)
    rounds = {f"three rounds in {duration:g} s": (fall(r, duration), -np.pi) for duration in DURATIONS}
    others = {"backwards": (fall(r, FALL, -1), np.pi), "a path that is retraced": (fall(r, FALL, retrace=True), 0.0)}
    for name, (run, expected) in (rounds | others).items():
        angle = run["phi"][-1] - run["phi"][0]
        claim(f"{name}: the trunk turns by {np.degrees(expected):.0f}°", angle, expected, turned)
    for (name, (run, _)), width in zip(rounds.items(), (5, 2.5, 1), strict=True):
        turn.plot(run.time / run.time[-1] * ROUNDS, np.degrees(run["phi"]), linewidth=width, label=name)
    jump, _ = rounds[f"three rounds in {FALL:g} s"]
    parabola = within(1e-12, "m", because="a polynomial of second degree: roundings of 1 m over some hundred steps")
    exact = PlanarCat.exact(jump.time, **FLIGHT)
    claim("the centre of mass flies along a parabola", jump, exact, parabola, names=("com_x", "com_z"))
    parts = within(1e-14, "kg.m2/s", because="φ is cyclic; roundings of the parts, some 0.5 kg.m2/s each")
    claim("the angular momentum stays 0", jump["angular_momentum"], 0.0, parts)

    flight.plot(jump["com_x"], jump["com_z"], color="tab:gray", linewidth=0.8)
    m, h = {p.name: p.start for p in PlanarCat.parameters}, PlanarCat.hinge.start
    for i in range(0, jump.time.size, 30):
        phi, psi, com = jump["phi"][i], [jump["psi_1"][i], jump["psi_2"][i]], jump["com_x"][i] + 1j * jump["com_z"][i]
        trunk, limbs = h * np.exp(1j * phi), 0.25 * np.exp(1j * (phi + np.array(psi))) * [1, -1]
        offset = (m["mass_1"] * (trunk + limbs[0]) + m["mass_2"] * (limbs[1] - trunk)) / sum(
            m[f"mass_{k}"] for k in range(3)
        )
        joints = com - offset + np.array([-trunk + 1.6 * limbs[1], -trunk, trunk, trunk + 1.6 * limbs[0]])
        for k, colour in enumerate(("tab:blue", "k", "tab:red")):
            flight.plot(np.real(joints[k : k + 2]), np.imag(joints[k : k + 2]), color=colour, linewidth=1.5)
    flight.set(aspect="equal")
    psi_1, psi_2 = np.meshgrid(*[np.linspace(-np.pi, np.pi, 200)] * 2, indexing="ij")
    curvature = analysis.curvature(PlanarCat).evaluate(psi_1=psi_1, psi_2=psi_2, **CAT)[2]
    shapes.pcolormesh(psi_1, psi_2, -curvature, cmap="RdBu", rasterized=True)
    shapes.plot(jump["psi_1"], jump["psi_2"], "k", linewidth=1)
