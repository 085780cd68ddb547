"""Motion of a chain by sweeps along its links: the articulated-body method, for links given by their energies.

A link has coordinates q with rates v, it begins at its joint w and ends at its tip F(q, w), which is the joint of the
next one.  Beyond the tip are momentum π and force r.  With T = ½ (v, ẇ)ᵀ M (v, ẇ)::

    p  = M_qq v + M_qw ẇ + F_qᵀ π       ∂L/∂q̇ of the whole chain                                     K eq. 79
    π  = P Ḟ + s                        P: articulated inertia beyond, s: momentum beyond where Ḟ = 0
    v  = D⁻¹ (p − F_qᵀ s) − G ẇ         with D = M_qq + F_qᵀ P F_q, U = M_qw + F_qᵀ P F_w, G = D⁻¹ U   M eq. 36
    ṗ  = ∂L/∂q + F_qᵀ φ + Ḟ_qᵀ π + Q    φ: ∂L/∂w of the links beyond                                 M eq. 26
    a  = D⁻¹ (f − F_qᵀ b) − G ẅ         r = P F̈ + c, b = P β + c with F̈ = F_q a + F_w ẅ + β
    λ  = B_sᵀ r                         at the base w = B(s)                                         M eq. 27

P, s, c and φ are carried inward, w, ẇ and ẅ outward.  Friction is Q = −η ∂T/∂q̇ (K eq. 64), loads at points act by
virtual work (K eq. 14).

Source of the method: R. Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 7; here it is written for momenta.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from liaisons.mechanics.algebra import gradient, solve_symmetric
from liaisons.mechanics.chains.chain import Link
from liaisons.mechanics.chains.sweeps import Carried, Columns, along_links, over_links


@dataclass(frozen=True, eq=False)
class Base:
    """Joint of the first link and its motion, (d, 1) each; zero at a free end."""

    w: ca.MX
    w_dot: ca.MX
    w_ddot: ca.MX


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of n links with f coordinates and m point components each."""

    rates: ca.MX  # (f, n)
    momentum_rates: ca.MX  # (f, n)
    accelerations: ca.MX  # (f, n)
    kinetic_energy: ca.MX
    potential_energy: ca.MX
    base_momentum: ca.MX  # π at the base (d, 1)
    base_force: ca.MX  # r at the base (d, 1)
    base_inertia: ca.MX  # P at the base (d, d)
    power: ca.MX  # of drives and loads
    points: ca.MX  # (m, n)
    point_rates: ca.MX
    point_accelerations: ca.MX


def momenta(link: Link, base: Base, known: Columns) -> ca.MX:
    """p = ∂L/∂q̇, (f, n); known are q and v."""
    pi = ca.SX.sym("pi", link.w.shape[0])
    F_q, F_w = ca.jacobian(link.tip, link.q), ca.jacobian(link.tip, link.w)
    (w,), _, _ = along_links(known, [Carried(link.w, base.w, link.tip)])
    known = known & [(link.w, w)]
    (w_dot,), _, _ = along_links(known, [Carried(link.w_dot, base.w_dot, link.rate(link.tip))])
    known = known & [(link.w_dot, w_dot)]
    beyond = Carried(pi, _zeros(pi), gradient(link.kinetic, link.w_dot) + F_w.T @ pi)
    _, _, (p,) = along_links(known, [beyond], gradient(link.kinetic, link.v) + F_q.T @ pi, inward=True)
    return p


def inertias(link: Link, base: Base, known: Columns) -> ca.MX:
    """The diagonal of the mass matrix of the whole chain, (f, n); known is q."""
    F_q, F_w = ca.jacobian(link.tip, link.q), ca.jacobian(link.tip, link.w)
    M, _ = ca.hessian(link.kinetic, ca.vertcat(link.v, link.w_dot))
    M_qq, M_ww = (M[part, part] for part in (slice(0, F_q.shape[1]), slice(F_q.shape[1], None)))
    composite = ca.SX.sym("composite", *M_ww.shape)  # inertia of all links beyond, moved as one
    (w,), _, _ = along_links(known, [Carried(link.w, base.w, link.tip)])
    carried = Carried(ca.vec(composite), _zeros(ca.vec(composite)), ca.vec(M_ww + F_w.T @ composite @ F_w))
    own = ca.diag(M_qq + F_q.T @ composite @ F_q)
    _, _, (diagonal,) = along_links(known & [(link.w, w)], [carried], own, inward=True)
    return diagonal


def motion(link: Link, base: Base, known: Columns) -> Motion:
    """Everything that moves; known are q, p, drives and loads."""
    q, v, w, w_dot, T, V, F = link.q, link.v, link.w, link.w_dot, link.kinetic, link.potential, link.tip
    F_q, F_w, F_dot = ca.jacobian(F, q), ca.jacobian(F, w), link.rate(F)
    p_v, p_w = gradient(T, v), gradient(T, w_dot)  # own momenta
    M_qq, M_qw, M_ww = ca.jacobian(p_v, v), ca.jacobian(p_v, w_dot), ca.jacobian(p_w, w_dot)
    P, s, pi, phi, c = (ca.SX.sym(name, *shape) for name, shape in _shapes(w.shape[0]).items())

    (joints,), _, _ = along_links(known, [Carried(w, base.w, F)])
    known = known & [(w, joints)]

    # Inward: what the links beyond weigh.
    D, U = M_qq + F_q.T @ P @ F_q, M_qw + F_q.T @ P @ F_w
    G = solve_symmetric(D, U)
    g = solve_symmetric(D, link.p - F_q.T @ s)
    inertia = Carried(ca.vec(P), _zeros(ca.vec(P)), ca.vec(M_ww + F_w.T @ P @ F_w - U.T @ G))
    momentum = Carried(s, _zeros(s), F_w.T @ s + U.T @ g)
    (inertias, beyond), (base_inertia, base_s), (gains, offsets) = along_links(
        known, [inertia, momentum], ca.vec(G), g, inward=True
    )

    # Outward: rates.
    gain, offset = ca.SX.sym("G", *G.shape), ca.SX.sym("g", *g.shape)
    at_tip = [(ca.vec(P), inertias), (s, beyond)]
    solved = offset - gain @ w_dot
    F_dot_solved = ca.substitute(F_dot, v, solved)
    (joint_rates,), _, (rates, momenta_beyond) = along_links(
        known & [(ca.vec(gain), gains), (offset, offsets), *at_tip],
        [Carried(w_dot, base.w_dot, F_dot_solved)],
        solved,
        P @ F_dot_solved + s,
    )
    known = known & [(v, rates), (w_dot, joint_rates), (pi, momenta_beyond)]

    # Inward: forces.  f: those that act on q, h: those that act on the joint, both less what accelerations bring.
    virtual_q, virtual_w = (ca.jacobian(link.points, x).T @ link.loads for x in (q, w))
    Q, Q_w = link.drive - virtual_q, -virtual_w
    f = Q - link.eta * p_v - gradient(V, q) + gradient(T, q) - link.rate(p_v)
    h = Q_w - link.eta * p_w - gradient(V, w) + gradient(T, w) - link.rate(p_w)
    b = P @ link.rate(F_dot) + c
    push = solve_symmetric(D, f - F_q.T @ b)
    force = Carried(c, _zeros(c), F_w.T @ b + U.T @ push - h)
    slope = Carried(
        phi,
        _zeros(phi),
        gradient(T - V, w) + Q_w + F_w.T @ phi + ca.jacobian(F_dot, w).T @ pi,
    )
    p_dot = gradient(T - V, q) + Q - link.eta * link.p + F_q.T @ phi + ca.jacobian(F_dot, q).T @ pi
    _, (base_c, _), (pushes, momentum_rates) = along_links(
        known & [(ca.vec(P), inertias)], [force, slope], push, p_dot, inward=True
    )

    # Outward: accelerations.
    w_ddot, a, shove = (ca.SX.sym(name, *like.shape) for name, like in (("w_ddot", w), ("a", v), ("push", push)))
    F_ddot = F_q @ (shove - gain @ w_ddot) + F_w @ w_ddot + link.rate(F_dot)
    (joint_accelerations,), _, (accelerations,) = along_links(
        known & [(ca.vec(gain), gains), (shove, pushes)],
        [Carried(w_ddot, base.w_ddot, F_ddot)],
        shove - gain @ w_ddot,
    )
    known = known & [(a, accelerations), (w_ddot, joint_accelerations)]

    velocity = link.rate(link.points)
    acceleration = link.rate(velocity) + ca.jacobian(link.points, q) @ a + ca.jacobian(link.points, w) @ w_ddot
    power = ca.dot(link.drive, v) - ca.dot(link.loads, velocity)
    totals = [ca.sum2(values) for values in over_links(known, T, V, power)]
    points = over_links(known, link.points, velocity, acceleration)
    P_0 = ca.reshape(base_inertia, *P.shape)
    return Motion(
        rates=rates,
        momentum_rates=momentum_rates,
        accelerations=accelerations,
        kinetic_energy=totals[0],
        potential_energy=totals[1],
        base_momentum=P_0 @ base.w_dot + base_s,
        base_force=P_0 @ base.w_ddot + base_c,
        base_inertia=P_0,
        power=totals[2],
        points=points[0],
        point_rates=points[1],
        point_accelerations=points[2],
    )


def _shapes(d: int) -> dict[str, tuple[int, int]]:
    return {"P": (d, d), "s": (d, 1), "pi": (d, 1), "phi": (d, 1), "c": (d, 1)}


def _zeros(symbol: ca.SX) -> ca.MX:
    return ca.MX(*symbol.shape)
