"""A falling cat without angular momentum turns by moving its limbs; the angle is an area in the space of shapes.

M 8.2.  Two FourierSeries drive the limbs of a PlanarCat three times round a circle of shapes while its centre of mass
flies along a parabola (M eq. 59).  However long this takes, the trunk turns by the holonomy of the kinetic connection
(M 7), -3 ∮ (J_1 dψ_1 + J_2 dψ_2)/I = -3 ∬ curvature dψ_1 dψ_2; the circle is chosen so that this is half a turn.  If
the loop is traversed backwards, the cat turns the other way; if a path is retraced, the cat does not turn.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from liaisons import Result, analysis, operator, simulate
from liaisons.models import PlanarCat
from liaisons.scenarios import Claims, panels, scenario, within

CAT: Any = {"arm_1": 0.25, "arm_2": 0.25}  # longer limbs than by default
CENTRE = (np.pi / 2, -np.pi / 2)  # of the circle of shapes: both limbs stretched to the same side
FALL = 0.9  # duration of the jump [s], in which the circle is run through three times
FLIGHT: Any = {"com_z_dot_0": 9.81 * FALL / 2, "com_x_dot_0": 4.5}


def circle(r: float) -> Any:
    return lambda a: {"psi_1": CENTRE[0] + r * ca.cos(a), "psi_2": CENTRE[1] + r * ca.sin(a)}


def fall(r: float, duration: float, direction: int = 1, *, retrace: bool = False) -> Result:
    """Three rounds of the circle of radius r, or to and fro on its diameter, without angular momentum."""
    frequency = direction * 6 * np.pi / duration
    cosine, sine = (r, 0.0) if retrace else (0.0, r)
    spin = PlanarCat.turn_rate(CENTRE[0] + r, CENTRE[1] + cosine, 0.0, sine * frequency, **CAT)
    limbs: Any = {
        "psi_1": operator("FourierSeries", offset=CENTRE[0], angular_frequency=frequency, cos_1=r),
        "psi_2": operator("FourierSeries", offset=CENTRE[1], angular_frequency=frequency, cos_1=cosine, sin_1=sine),
    }
    times: Any = {"stop_time": duration, "step_size": duration / 300, "tolerance": 1e-10}
    return simulate("PlanarCat", phi_0=np.pi, phi_dot_0=spin, **times, **limbs, **FLIGHT, **CAT)


@scenario
def main(claim: Claims) -> None:
    flight, shapes, turn = panels(
        ("a jump: trunk (black) and limbs", "x [m]", "z [m]"),
        ("the loop and the curvature", "ψ$_1$ [rad]", "ψ$_2$ [rad]"),
        ("half a turn, at any speed", "rounds", "φ [deg]"),
    )
    # radius of the circle that turns the cat by half a turn in three rounds
    r: Any = brentq(lambda r: analysis.holonomy(PlanarCat, circle(r), **CAT)["phi"] + np.pi / 3, 0.5, 2, xtol=1e-14)
    area = analysis.curvature_integral(PlanarCat, circle(r), **CAT)["phi"]
    nodes = within(1e-10, "rad", because="errors of the integration at 1e-12 and of 24 Gauss nodes on each radius")
    claim("the line integral of the connection is the area integral of its curvature", area, -np.pi / 3, nodes)
    why = "errors of the solver at tolerance 1e-10, not amplified; interpolating σ over 1/100 of a round adds 1e-12"
    turned = within(1e-8, "rad", because=why)
    runs = {f"three rounds in {T:g} s": (fall(r, T), -np.pi) for T in (FALL, 3.0, 10.0)}
    jump, _ = runs[f"three rounds in {FALL:g} s"]
    runs |= {"backwards": (fall(r, FALL, -1), np.pi), "a path that is retraced": (fall(r, FALL, retrace=True), 0.0)}
    widths = (7, 4, 1.5, 1.5, 1.5)  # three curves lie on one another
    for (name, (run, expected)), width in zip(runs.items(), widths, strict=True):
        angle = run["phi"][-1] - run["phi"][0]
        claim(f"{name}: the trunk turns by {np.degrees(expected):.0f}°", angle, expected, turned)
        turn.plot(run.time / run.time[-1] * 3, np.degrees(run["phi"]), linewidth=width, label=name)
    parabola = within(1e-12, "m", because="rounding errors of lengths of about 1 m, over some hundred steps")
    exact = PlanarCat.exact(jump.time, **FLIGHT)
    claim("the centre of mass flies along a parabola", jump, exact, parabola, names=("com_x", "com_z"))
    parts = within(1e-14, "kg.m2/s", because="φ is cyclic; rounding errors of parts of about 0.5 kg.m2/s each")
    claim("the angular momentum stays 0", jump["angular_momentum"], 0, parts)

    com, phi, psi_1, psi_2 = (jump[name][::30] for name in ("com_x", "phi", "psi_1", "psi_2"))
    com, trunk = com + 1j * jump["com_z"][::30], 0.2 * np.exp(1j * phi)
    ends = (-2 * np.exp(1j * psi_2) - 1, -1, 1, 1 + 2 * np.exp(1j * psi_1))  # of limb, trunk, limb, about the middle
    for one, other, colour in zip(ends[:-1], ends[1:], ("tab:blue", "k", "tab:red"), strict=True):
        rods = np.array([com + one * trunk, com + other * trunk])
        flight.plot(rods.real, rods.imag, color=colour)
    flight.set(aspect="equal")
    psi = np.linspace(-3, 3, 200)
    curvature = analysis.curvature(PlanarCat).evaluate(psi_1=psi, psi_2=psi[:, None], **CAT)[2]
    shapes.pcolormesh(psi, psi, -curvature, cmap="RdBu")
    shapes.plot(jump["psi_1"], jump["psi_2"], "k")
