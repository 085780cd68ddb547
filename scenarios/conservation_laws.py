"""What the Lagrangian is blind to, the motion keeps: each symmetry has its constant, each constant {H, A} = 0.

K 2.4, 3.2 and 3.3, on the Lagrangian and then along FMUs.  Noether's theorem turns rotations into the angular momentum
of a planet and the canonical one of a charge, and a translation along the field into a momentum; a rotation is no
symmetry of the pendulum.  Poisson brackets, with K's sign {p, q} = +1, find that the eccentricity vector of the planet
is constant too, though it belongs to no symmetry of space, and give the rate of what is not constant, dA/dt = {H, A}.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from liaisons import LiaisonsError, Verdict, analysis, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import CartesianPendulum, ChargedParticle, KeplerOrbit, PolarOscillator

TOLERANCE, STOP = 1e-11, 20.0
REASON = f"10 x tolerance {TOLERANCE:g} x {STOP:g} s"
ORBIT = {"x_0": 1.0, "y_dot_0": 1.25}
HELIX = {"x_dot_0": 1.0, "z_dot_0": 0.1, "B_z": 2.0}


def along(name: str, step: float = 0.02, **start: Any) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Instants, and coordinates, rates and momenta of an FMU there."""
    result = simulate(fmu_path(name), stop_time=STOP, step_size=step, tolerance=TOLERANCE, **start)
    return result.time, {signal: result[signal] for signal in result.names}


def drift(values: np.ndarray) -> float:
    return float(np.max(np.abs(values - values[..., :1])))


def is_refused() -> bool:
    try:
        analysis.noether(CartesianPendulum, lambda m: {"x": -m.z, "z": m.x})
    except LiaisonsError as error:
        return "is no symmetry" in str(error)
    return False


def main(figure: Path) -> list[Verdict]:
    time, planet = along("KeplerOrbit", **ORBIT)
    _, charge = along("ChargedParticle", **HELIX)
    _, polar = along("PolarOscillator")

    def rotation(m: Any) -> dict[str, Any]:
        return {"x": -m.y, "y": m.x}

    at = {name: planet[name] for name in ("x", "y", "p_x", "p_y")}
    charged = {name: charge[name] for name in ("x", "y", "z", "x_dot", "y_dot", "z_dot")} | {"B_z": HELIX["B_z"]}
    H = analysis.hamiltonian(KeplerOrbit)
    momentum = analysis.noether(KeplerOrbit, rotation).evaluate(**{q: planet[q] for q in ("x", "y", "x_dot", "y_dot")})
    canonical = analysis.noether(ChargedParticle, rotation).evaluate(**charged)
    lift = analysis.noether(ChargedParticle, lambda _: {"z": 1.0}).evaluate(**charged)
    vector = [analysis.observable(KeplerOrbit, lambda m, i=i: getattr(m, f"eccentricity_{i}")) for i in "xy"]
    brackets = [analysis.poisson_bracket(H, component).evaluate(**at) for component in vector]
    swing = analysis.observable(KeplerOrbit, lambda m: m.x * m.momentum(m.x) + m.y * m.momentum(m.y))  # p·r
    rate = analysis.poisson_bracket(H, swing).evaluate(**at)
    virial = 2 * planet["kinetic_energy"] + planet["potential_energy"]
    flow = analysis.hamilton_equations(KeplerOrbit).evaluate(**at)
    velocities = [analysis.observable(ChargedParticle, lambda m, q=q: m.dot(getattr(m, q))) for q in "xy"]
    cyclic = set(analysis.cyclic_coordinates(PolarOscillator))
    verdicts = [
        verdict("a planet, turned: x p_y - y p_x is constant", error=drift(momentum), tolerance=2e-9, reason=REASON),
        verdict(
            "and it is the angular momentum of the FMU",
            error=max_error(momentum, planet["angular_momentum"]),
            tolerance=1e-14,
            unit="kg.m2/s",
            reason="two evaluations at the same states: roundings",
        ),
        verdict("a charge, turned: (r∧p)_z with canonical p", error=drift(canonical), tolerance=2e-9, reason=REASON),
        verdict("a charge, moved along the field: p_z", error=drift(lift), tolerance=2e-9, reason=REASON),
        verdict(
            "a pendulum, turned: no symmetry, refused",
            error=float(not is_refused()),
            tolerance=0,
            reason="a count",
        ),
        verdict(
            "φ of the polar oscillator is cyclic, and p_φ is constant",
            error=drift(polar["p_phi"]) + float(cyclic != {"phi"}),
            tolerance=0,
            unit="kg.m2/s",
            reason="its rate is zero, not small",
        ),
        verdict(
            "{H, eccentricity} = 0 along the orbit",
            error=float(np.max(np.abs(brackets))),
            tolerance=1e-13,
            unit="1/s",
            reason="cancellation of terms of size 1",
        ),
        verdict(
            "d(p·r)/dt = {H, p·r} = 2T + V",
            error=max_error(rate, virial),
            tolerance=1e-13,
            unit="J",
            reason="two evaluations at the same states: roundings",
        ),
        verdict(
            "q' = ∂H/∂p, p' = -∂H/∂q are the FMU's derivatives",
            error=max_error(flow, [planet[name] for name in ("x_dot", "y_dot", "x_ddot", "y_ddot")]),
            tolerance=1e-13,
            reason="mass 1 kg; as above",
        ),
        verdict(
            "{v_x, v_y} = -Q B/m²",
            error=max_error(analysis.poisson_bracket(*velocities).evaluate(B_z=HELIX["B_z"]), -HELIX["B_z"]),
            tolerance=1e-15,
            reason="one multiplication",
        ),
    ]
    changes = {"x p_y - y p_x": momentum, "eccentricity, x": planet["eccentricity_x"], "energy": planet["energy"]}
    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    for label, values in ({"x p_y": planet["x"] * planet["p_y"], "p·r": swing.evaluate(**at)} | changes).items():
        left.plot(time, values, label=label)
    for label, values in changes.items():
        right.semilogy(time, np.maximum(np.abs(values - values[0]), 1e-17), linewidth=0.7, label=label)
    left.set(xlabel="t [s]", title="a planet: what changes, and what does not")
    right.set(xlabel="t [s]", title="change of the constants since the start")
    for axis in (left, right):
        axis.legend(loc="upper right")
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
