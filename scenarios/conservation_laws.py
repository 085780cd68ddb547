"""Each symmetry of the Lagrangian has a constant of the motion, and each constant A satisfies {H, A} = 0.

K 2.4, 3.2 and 3.3, for the Lagrangian and then along the motions of FMUs.  By Noether's theorem, rotations give the
angular momentum of a planet and the canonical one of a charge, and a translation along the field gives a momentum; a
rotation is not a symmetry of the pendulum.  Poisson brackets, with K's sign {p, q} = +1, show that the eccentricity
vector of the planet is also constant, although it belongs to no symmetry of space, and give the rate of other
quantities, dA/dt = {H, A}.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import LiaisonsError, Result, analysis, simulate
from liaisons.models import CartesianPendulum, ChargedParticle, KeplerOrbit, PolarOscillator
from liaisons.scenarios import Claims, panels, scenario, within

B = 2.0


def along(name: str, **start: Any) -> Result:
    return simulate(name, stop_time=20.0, step_size=0.02, tolerance=1e-11, **start)


def rotation(m: Any) -> dict[str, Any]:
    return {"x": -m.y, "y": m.x}


def is_refused() -> bool:
    try:
        analysis.noether(CartesianPendulum, lambda m: {"x": -m.z, "z": m.x})
    except LiaisonsError as error:
        return "is no symmetry" in str(error)
    return False


@scenario
def main(claim: Claims) -> None:
    solver = within(2e-9, because="10 times the solver tolerance 1e-11, times 20 s")
    planet = along("KeplerOrbit", x_0=1.0, y_dot_0=1.25)
    momentum = analysis.noether(KeplerOrbit, rotation).evaluate(**{q: planet[q] for q in ("x", "y", "x_dot", "y_dot")})
    claim("a planet, turned: x p_y - y p_x is constant", momentum, momentum[0], solver)
    twice = "rounding errors of two evaluations at the same states"
    angular = within(1e-14, "kg.m2/s", because=twice)
    claim("it equals the angular momentum of the FMU", momentum, planet["angular_momentum"], angular)

    charge = along("ChargedParticle", x_dot_0=1.0, z_dot_0=0.1, B_z=B)
    charged = {name: charge[name] for name in ("x", "y", "z", "x_dot", "y_dot", "z_dot")} | {"B_z": B}
    canonical = analysis.noether(ChargedParticle, rotation).evaluate(**charged)
    claim("a charge, turned: (r∧p)_z with canonical p", canonical, canonical[0], solver)
    lift = analysis.noether(ChargedParticle, lambda _: {"z": 1.0}).evaluate(**charged)
    claim("a charge, moved along the field: p_z", lift, lift[0], solver)
    claim("a pendulum, turned: refused, since it is no symmetry", is_refused(), True, within(0.0, because="yes or no"))
    cyclic, p_phi = set(analysis.cyclic_coordinates(PolarOscillator)), along("PolarOscillator")["p_phi"]
    kept = np.append(p_phi - p_phi[0], cyclic != {"phi"})
    never = within(0.0, "kg.m2/s", because="its rate is zero, not small")
    claim("φ of the polar oscillator is cyclic, and p_φ is constant", kept, 0.0, never)

    at = {name: planet[name] for name in ("x", "y", "p_x", "p_y")}
    H = analysis.hamiltonian(KeplerOrbit)
    vector = [analysis.observable(KeplerOrbit, lambda m, i=i: getattr(m, f"eccentricity_{i}")) for i in "xy"]
    brackets = [analysis.poisson_bracket(H, component).evaluate(**at) for component in vector]
    cancelled = within(1e-13, "1/s", because="rounding errors of terms of about 1 that cancel")
    claim("{H, eccentricity} = 0 along the orbit", brackets, 0.0, cancelled)
    p_r = analysis.observable(KeplerOrbit, lambda m: m.x * m.momentum(m.x) + m.y * m.momentum(m.y))
    virial = 2 * planet["kinetic_energy"] + planet["potential_energy"]
    rate = analysis.poisson_bracket(H, p_r).evaluate(**at)
    claim("d(p·r)/dt = {H, p·r} = 2T + V", rate, virial, within(1e-13, "J", because=twice))
    flow = analysis.hamilton_equations(KeplerOrbit).evaluate(**at)
    rates = [planet[name] for name in ("x_dot", "y_dot", "x_ddot", "y_ddot")]
    unit_mass = within(1e-13, because=f"mass 1 kg; {twice}")
    claim("q' = ∂H/∂p, p' = -∂H/∂q are the FMU's derivatives", flow, rates, unit_mass)
    velocities = [analysis.observable(ChargedParticle, lambda m, q=q: m.dot(getattr(m, q))) for q in "xy"]
    bracket = analysis.poisson_bracket(*velocities).evaluate(B_z=B)
    claim("{v_x, v_y} = -Q B/m²", bracket, -B, within(1e-15, because="the rounding error of one multiplication"))

    constants = {"x p_y - y p_x": momentum, "eccentricity, x": planet["eccentricity_x"], "energy": planet["energy"]}
    left, right = panels(
        ("a planet: what changes, and what does not", "t [s]", "J.s, or 1, or J"),
        ("the constants: rounding errors", "t [s]", "largest change so far [2⁻⁵²]"),
    )
    changing = {"x p_y": planet["x"] * planet["p_y"], "p·r": p_r.evaluate(**at)}
    for label, values in (changing | constants).items():
        left.plot(planet.time, values, label=label)
    for label, values in constants.items():
        change = np.maximum.accumulate(np.abs(values - values[0]))
        right.plot(planet.time, change / np.finfo(float).eps, label=label)
