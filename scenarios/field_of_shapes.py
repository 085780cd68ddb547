"""If an operator follows a field Y on the space of shapes, ṡ = Y(s), the motion follows a field D_Y on V*M.

M 6.  Y(s) = (μ - |s|²) s + ω J s is drawn on the shapes (ψ_1, ψ_2) of a PlanarCat: all shapes but 0 approach the circle
|s|² = μ, r² = μ/(1 + (μ/r_0² - 1) e^{-2μt}).  The FMU moves along the integral curves of D_Y = D_0 - X_K + H(Y), as
``analysis`` derives it, at any time.  On the circle each round turns the cat by the holonomy.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from liaisons import InternalState, Operator, Parameter, Result, analysis, operator, simulate
from liaisons.models import PlanarCat
from liaisons.scenarios import Claims, panels, scenario, within

GROWTH, TURNING = 0.49, 4.0  # μ [1/s], ω [rad/s]; shapes are in radians
ROUND = 2 * np.pi / TURNING  # [s]
SPIN = 0.3  # rate of the trunk at the start [rad/s]


class FirstShape(Operator):
    """A shape that follows Y."""

    growth = Parameter(GROWTH, "1/s", "rate of growth at rest", minimum=0)
    radius = Parameter(GROWTH**0.5, "1", "radius of the circle", minimum=1e-3)
    turning = Parameter(TURNING, "rad/s", "angular velocity about rest")
    a = InternalState("1", "first shape", start=0.1)
    b = InternalState("1", "second shape")

    def internal_rates(self) -> Mapping[str, ca.SX]:
        growing = self.growth * (1 - (self.a**2 + self.b**2) / self.radius**2)
        return {"a": growing * self.a - self.turning * self.b, "b": growing * self.b + self.turning * self.a}

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002
        return self.a


class SecondShape(FirstShape):
    """The other one."""

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002
        return self.b


def fall(start: tuple[float, float], phi: float, spin: float, rounds: float) -> Result:
    shapes: Any = {"a_0": start[0], "b_0": start[1]}
    limbs: Any = {"psi_1": operator(FirstShape, **shapes), "psi_2": operator(SecondShape, **shapes)}
    times: Any = {"stop_time": rounds * ROUND, "step_size": ROUND / 200, "tolerance": 1e-11}
    return simulate("PlanarCat", phi_0=phi, phi_dot_0=spin, **limbs, **times)


@scenario
def main(claim: Claims) -> None:
    fields, turns = panels(
        ("shapes follow Y to the circle |s|² = μ", "ψ$_1$ [rad]", "ψ$_2$ [rad]"),
        ("turn of the trunk while it is reached", "rounds", "φ [rad]"),
    )
    run = fall((0.1, 0.0), 0.0, SPIN, 16)
    radius = np.sqrt(GROWTH / (1 + (GROWTH / 0.01 - 1) * np.exp(-2 * GROWTH * run.time)))
    spiral = radius * np.exp(1j * TURNING * run.time)
    shape = run["psi_1"] + 1j * run["psi_2"]
    solved = within(1e-9, "rad", because="100 times tolerance 1e-11; errors decay, since the circle attracts")
    claim("shapes follow the integral curve of Y", shape, spiral, solved)

    state: Any = {name: run[name] for name in ("phi", "p_phi", "psi_1", "psi_2", "psi_1_dot", "psi_2_dot")}
    D_Y = analysis.dynamic_field(PlanarCat).evaluate(**state)
    identity = within(1e-12, "rad/s", because="an identity at every state: rounding errors of terms of about 10")
    claim("φ' of the FMU, the third coordinate, is that of D_0 - X_K + H(Y)", D_Y[2], run["phi_dot"], identity)

    k = 400  # a state on the way, after two rounds
    later = fall((run["psi_1"][k], run["psi_2"][k]), run["phi"][k], run["phi_dot"][k], 14)
    curve = within(1e-8, "rad", because="100 times the solver tolerance, and the rounding error of the second start")
    claim("from a later state it moves in the same way: no time in D_Y", later["phi"], run["phi"][k:], curve)

    r = GROWTH**0.5
    around = fall((r, 0.0), 0.0, float(PlanarCat.turn_rate(r, 0.0, 0.0, r * TURNING)), 3)
    turn = analysis.holonomy(PlanarCat, lambda a: {"psi_1": r * ca.cos(a), "psi_2": r * ca.sin(a)})["phi"]
    turned = within(1e-9, "rad", because="errors at tolerance 1e-11, not amplified, and of σ interpolated, 1e-12")
    text = "on the circle, without angular momentum, a round turns by the holonomy"
    claim(text, np.diff(around["phi"][::200]), turn, turned)

    for start, motion in (((0.1, 0.0), run), ((0.0, 1.1), fall((0.0, 1.1), 0.0, SPIN, 16))):
        fields.plot(motion["psi_1"][:1600], motion["psi_2"][:1600])
        turns.plot(motion.time / ROUND, motion["phi"], label=f"from ψ = {start}")
    fields.plot(np.real(spiral)[:1600:40], np.imag(spiral)[:1600:40], "k.", label="closed form")
    fields.set(aspect="equal")
