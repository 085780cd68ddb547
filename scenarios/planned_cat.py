"""The optimal turn of a falling cat: its shape moves like a charge in a magnetic field on the space of shapes.

M 8.2 with M 2: at p_φ = 0 the trunk turns by -∮ (J_1 dψ_1 + J_2 dψ_2)/I.  The least ∫ ½ ψ'·Θψ' dt, Θ = g - J Jᵀ/I,
follows from Wong's equations: ψ moves like a charge in the field F = d(J/I) on the shape space with the metric Θ.  The
reference solves Wong's equations by shooting, from M eq. 58, with the momentum of φ as the charge.  A single loop costs
least.  Many loops, k in the time T, become Dido's circles about the point where the field B = F/√det Θ is strongest, at
the cost k 2π |Δφ|/(T B).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from liaisons import Plan, hamiltonian_flow, plan
from liaisons.scenarios import Claims, dots, panels, scenario, within

FALL, TURN, ROUNDS = 0.9, -0.08, np.array([1, 2, 4])
TRUNK, LIMB, HINGE, ARM = 0.05, 0.02, 0.2, 0.25
MU, MUTUAL = 0.75, 0.25  # of limbs of 1 kg in 4 kg: m (1 - m/M), m²/M
LIMBS = {"psi_1": (-3, 3), "psi_2": (-3, 3)}


def shape_space(one: Any, two: Any) -> Any:
    """J/I and the elements of Θ, of M eq. 58, for limbs alike."""
    A, B = (HINGE * ARM * (MU + MUTUAL) * np.cos(psi) for psi in (one, two))
    C, own = ARM**2 * MUTUAL * np.cos(one - two), LIMB + ARM**2 * MU
    inertia = TRUNK + 2 * own + 2 * HINGE**2 * (MU + MUTUAL) + 2 * (A + B + C)
    J, K = own + A + C, own + B + C
    return J / inertia, K / inertia, own - J**2 / inertia, C - J * K / inertia, own - K**2 / inertia


def wong(*z: Any) -> Any:
    """H = ½ (P - e J/I)·Θ⁻¹(P - e J/I) of (ψ_1, ψ_2, φ, P_1, P_2, e)."""
    a, b, xx, xy, yy = shape_space(z[0], z[1])
    u, v = z[3] - z[5] * a, z[4] - z[5] * b
    return (yy * u**2 - 2 * xy * u * v + xx * v**2) / (xx * yy - xy**2) / 2


def shot(motion: Plan) -> float:
    """Cost of the loop by Wong's equations, from the planned one as a guess."""
    begin = motion.sigma(0.0)
    psi, rate = (np.array([begin[f"psi_{k}{end}"] for k in (1, 2)]) for end in ("", "_dot"))
    a, b, xx, xy, yy = shape_space(*psi)
    e = motion.multipliers["phi"]

    def left(unknown: NDArray) -> NDArray:
        start = np.insert(unknown, 2, 0.0)
        way = hamiltonian_flow(wong, start, motion.duration) - start
        return np.append(way[:5] - [0, 0, motion.problem.end.low[0], 0, 0], unknown[0] - psi[0])

    P = np.array([[xx, xy], [xy, yy]]) @ rate + e * np.array([a, b])
    found = least_squares(left, [*psi, *P, e], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    return motion.duration * wong(*np.insert(found, 2, 0.0))


def field() -> float:
    """The strongest |F|/√det Θ within the joints."""
    one, two = np.meshgrid(*[np.linspace(-3, 3, 1201)] * 2)
    _, _, xx, xy, yy = shape_space(one, two)
    F = np.imag(shape_space(one + 1e-30j, two)[1] - shape_space(one, two + 1e-30j)[0]) / 1e-30
    return float(np.max(np.abs(F) / np.sqrt(xx * yy - xy**2)))


@scenario
def main(claim: Claims) -> None:
    loops, circle = panels(
        ("a loop of k", "ψ$_1$ [rad]", "ψ$_2$ [rad]"), ("towards Dido's circle", "k", "cost/k [J s]")
    )
    cat: Any = {"start": {"phi": 0}, "closed": True, "bounds": LIMBS, "arm_1": ARM, "arm_2": ARM}
    motions: list[Plan] = []
    for k in ROUNDS:
        warm: Any = {"guess": motions[-1]} if motions else {"tries": 3}
        motions.append(plan("PlanarCat", end={"phi": TURN / k}, duration=FALL / k, **warm, **cat))
    costs = np.array([motion.cost for motion in motions])
    shooting = within(1e-9, because="relative error; the shooting has tolerance 1e-13")
    claim("each loop costs what Wong's equations give", costs / [shot(motion) for motion in motions], 1.0, shooting)
    claim.verdicts += motions[0].verify()
    dido = 2 * np.pi * abs(TURN) / (FALL * field())
    claim.below("one loop costs less than two", costs[0], 2 * costs[1], within(0, "J.s", because="an inequality"))
    next_term = within(0.05, because="the next term is smaller by Δφ/k")
    claim.order("k loops cost k 2π |Δφ|/(T B), up to a term in Δφ/k", ROUNDS, costs / dido - 1, -1, next_term)
    for k, motion in zip(ROUNDS, motions, strict=True):
        sigma = motion.sigma(np.linspace(0, motion.duration, 200))
        loops.plot(sigma["psi_1"], sigma["psi_2"], label=f"k = {k}")
    dots(circle, ROUNDS, costs, label="planned")
    circle.axhline(dido, label="Dido's circle")
