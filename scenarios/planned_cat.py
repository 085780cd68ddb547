"""The falling cat that turns with least motion of its limbs: a charge in a magnetic field on the space of its shapes.

M 8.2 with M 2: at p_φ = 0 the trunk turns by -∮ (J_1 dψ_1 + J_2 dψ_2)/I, and the least ∫ ½ ψ'·Θψ' dt, Θ = g - J Jᵀ/I,
is what Wong's equations say: ψ moves as a charge in the field F = d(J/I) on the shape space with the metric Θ.  They
are solved here by shooting, from M eq. 58.  As the turn tends to 0 the loop becomes Dido's circle about the place where
the field B = F/√det Θ is strongest, at the cost 2π |Δφ|/(T B).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from liaisons import Claims, Plan, dots, panels, plan, scenario, within

FALL, LARGE, SMALL = 0.9, -0.1, (-0.04, -0.02, -0.01)
MASSES, INERTIAS, HINGE, ARM = (2.0, 1.0, 1.0), (0.05, 0.02, 0.02), 0.2, 0.25
LIMBS = {"psi_1": (-3, 3), "psi_2": (-3, 3)}


def shape_space() -> tuple[ca.SX, ca.SX, ca.SX]:
    """ψ, J/I and Θ of M eq. 58, for limbs alike."""
    psi, total = ca.SX.sym("psi", 2), sum(MASSES)
    mu, mutual = MASSES[1] * (total - MASSES[1]) / total, MASSES[1] * MASSES[2] / total
    A, C = HINGE * ARM * (mu + mutual), ARM**2 * mutual * ca.cos(psi[0] - psi[1])
    own = INERTIAS[1] + ARM**2 * mu
    inertia = INERTIAS[0] + 2 * own + 2 * HINGE**2 * (mu + mutual) + 2 * (A * ca.sum1(ca.cos(psi)) + C)
    J = own + A * ca.cos(psi) + C
    g = ca.vertcat(ca.horzcat(own, C), ca.horzcat(C, own))
    return psi, J / inertia, g - J @ J.T / inertia


def shot(motion: Plan) -> float:
    """Cost of the loop by Wong's equations, from the planned one as a guess."""
    psi, a, theta = shape_space()
    P, charge = ca.SX.sym("P", 2), ca.SX.sym("charge")
    v = ca.solve(theta, P - charge * a)
    H = ca.dot(P - charge * a, v) / 2
    rates = ca.Function("wong", [ca.vertcat(psi, P), charge], [ca.vertcat(v, -ca.gradient(H, psi), -ca.dot(a, v))])

    def left(unknown: NDArray) -> NDArray:
        def rate(_: float, y: NDArray) -> NDArray:
            return np.array(rates(y[:4], unknown[4])).ravel()

        way = solve_ivp(rate, (0, FALL), [*unknown[:4], 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        return np.append(way - [*unknown[:4], motion.problem.end.low[0]], unknown[0] - begin[0])

    now = motion.sigma(0.0)
    begin, rate = (np.array([now[f"psi_{k}{end}"] for k in (1, 2)]) for end in ("", "_dot"))
    e = motion.multipliers["phi"]
    momenta = np.array(ca.Function("m", [psi], [theta @ rate + e * a])(begin)).ravel()
    found = least_squares(left, [*begin, *momenta, e], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    return FALL * float(ca.Function("H", [ca.vertcat(psi, P), charge], [H])(found[:4], found[4]))


def field() -> float:
    """The strongest |F|/√det Θ within the joints."""
    psi, a, theta = shape_space()
    F = ca.jacobian(a[1], psi[0]) - ca.jacobian(a[0], psi[1])
    B = ca.Function("B", [psi], [F / ca.sqrt(ca.det(theta))])
    grid = np.array(np.meshgrid(*[np.linspace(-3, 3, 1201)] * 2)).reshape(2, -1)
    return float(np.max(np.abs(np.array(B(grid)))))


@scenario
def main(claim: Claims) -> None:
    loops, circle = panels(
        ("loops", "ψ$_1$ [rad]", "ψ$_2$ [rad]"), ("towards Dido's circle", "turn [rad]", "cost T B/(2π |Δφ|)")
    )
    cat: Any = {"start": {"phi": 0}, "closed": True, "duration": FALL, "bounds": LIMBS, "arm_1": ARM, "arm_2": ARM}
    large = plan("PlanarCat", end={"phi": LARGE}, tries=3, **cat)
    shooting = within(1e-9, because="relative; the shooting integrates at 1e-12")
    claim("the cost is that of Wong's equations, by shooting", large.cost / shot(large), 1.0, shooting)
    claim.verdicts += large.verify()
    motion, ratios = large, []
    for turn in SMALL:
        motion = plan("PlanarCat", end={"phi": turn}, guess=motion, **cat)
        ratios.append(motion.cost * FALL * field() / (2 * np.pi * abs(turn)) - 1)
        sigma = motion.sigma(np.linspace(0, FALL, 200))
        loops.plot(sigma["psi_1"], sigma["psi_2"], label=f"{turn:g} rad")
    first = within(0.05, because="the next term is smaller by Δφ")
    claim.order("small loops cost 2π |Δφ|/(T B), but for a term in Δφ", np.abs(SMALL), ratios, 1, first)
    claim("... which leaves Dido's circle", 2 * ratios[-1] - ratios[-2], 0.0, within(1e-4, because="0.01²"))
    dots(circle, np.abs(SMALL), np.array(ratios) + 1, label="planned")
    circle.axhline(1.0, label="Dido's circle")
