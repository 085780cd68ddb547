"""Motion of a chain by sweeps along its links: the articulated-body method, for links given by their energies.

A link has coordinates q with rates v, it begins at its joint w and ends at its tip F(q, w), which is the joint of the
next one.  Beyond the tip are momentum π and force r.  With T = ½ (v, ẇ)ᵀ M (v, ẇ)::

    p  = M_qq v + M_qw ẇ + F_qᵀ π       ∂L/∂q̇ of the whole chain                                     K eq. 78
    π  = P Ḟ + s                        P: articulated inertia beyond, s: momentum beyond where Ḟ = 0
    v  = D⁻¹ (p − F_qᵀ s) − G ẇ         with D = M_qq + F_qᵀ P F_q, U = M_qw + F_qᵀ P F_w, G = D⁻¹ U   M eq. 36
    ṗ  = ∂L/∂q + F_qᵀ φ + Ḟ_qᵀ π + Q    φ: ∂L/∂w of the links beyond                                 M eq. 26
    a  = D⁻¹ (f − F_qᵀ b) − G ẅ         r = P F̈ + c, b = P β + c with F̈ = F_q a + F_w ẅ + β
    λ  = B_sᵀ r                         at the base w = B(s)                                         M eq. 27

P, s, c and φ are carried inward, w, ẇ and ẅ outward.  Friction is −∂D/∂q̇ (K eq. 66), loads at points act by
virtual work (K eq. 14), forces of contacts by that of their rates.

Source of the method: R. Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 7; here it is written for momenta.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from liaisons.algebra import gradient, solve_symmetric, stack
from liaisons.chains.chain import Chain
from liaisons.chains.rows import Each, Step, Sum, carry
from liaisons.mechanics import Dissipation


@dataclass(frozen=True, eq=False)
class ChainLink:
    """The terms of one link: f coordinates, d axes of the joint, m point components; CasADi SX."""

    q: ca.SX  # coordinates (f,)
    v: ca.SX  # their rates
    p: ca.SX  # and momenta
    w: ca.SX  # joint (d,)
    w_dot: ca.SX
    drive: ca.SX  # q_force − q_load (f,)
    loads: ca.SX  # at the points (m,)
    bonded: ca.SX  # 0 for the first link of a free end, else 1
    tip: ca.SX  # F(q, w), the joint of the next link (d,)
    points: ca.SX  # (m,)
    kinetic: ca.SX  # T
    potential: ca.SX  # V
    friction: Dissipation
    last: ca.SX  # 1 for the last link, else 0
    contact_rates: ca.SX  # of unilateral liaisons, then of dry friction; 0 where only the last link has one (c,)
    contact_forces: ca.SX  # (c,)
    gaps: int  # so many contacts are unilateral liaisons

    def rate(self, expression: ca.SX) -> ca.SX:
        """Rate d/dt of a column at zero accelerations."""
        return ca.jtimes(expression, ca.vertcat(self.q, self.w), ca.vertcat(self.v, self.w_dot))


def link_of(m: Chain, inputs: Mapping[str, ca.SX] | None = None) -> ChainLink:
    """Terms of one link, from the methods of the component.

    :param inputs: forces and loads by name; None: symbols of their own.
    """
    bonded, points = ca.SX.sym("bonded"), m.point_components()
    drive, loads = ca.SX.sym("drive", m.q.shape[0]), ca.SX.sym("loads", len(points))
    if inputs is not None:
        drive = stack(inputs[f"{q.name}_force"] - inputs[f"{q.name}_load"] for q in m.coordinates)
        loads = stack(inputs[f"{name}_load"] for name in points)
    kinetic = ca.SX(m.kinetic_energy())
    rubbing = ca.SX(m.dissipation_function()) + bonded * ca.SX(m.bond_dissipation())
    last = ca.SX.sym("last")
    return ChainLink(
        q=m.q,
        v=m.q_dot,
        p=ca.SX.sym("p", m.q.shape[0]),
        w=m.w,
        w_dot=m.w_dot,
        drive=drive,
        loads=loads,
        bonded=bonded,
        tip=m.joint_column(m.tip()),
        points=stack(points.values()),
        kinetic=kinetic,
        potential=ca.SX(m.potential_energy()) + bonded * ca.SX(m.bond_energy()),
        friction=Dissipation(ca.SX(m.friction_coefficient()), kinetic, rubbing),
        last=last,
        contact_rates=m.contact_rates() * stack(last if item.last else ca.SX(1) for item in m.contact_formulas),
        contact_forces=m.contact_forces,
        gaps=len(m.unilaterals),
    )


@dataclass(frozen=True, eq=False)
class Base:
    """Joint of the first link and its motion, (d, 1) each; zero at a free end."""

    w: ca.SX
    w_dot: ca.SX
    w_ddot: ca.SX
    slope: ca.SX  # ∂w/∂s (d, a)


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """Motion of links with f coordinates and m point components each, as expressions that need some steps."""

    steps: tuple[Step, ...]
    rates: ca.SX  # (f, 1) of one link
    momentum_rates: ca.SX  # (f, 1)
    accelerations: ca.SX  # (f, 1)
    kinetic_energy: ca.SX
    potential_energy: ca.SX
    joint_accelerations: ca.SX  # (d, 1)
    base_force: ca.SX  # r at the base (d, 1)
    power: ca.SX  # of drives and loads
    dissipation: ca.SX  # of friction
    points: ca.SX  # (m, 1) of one link
    point_rates: ca.SX
    point_accelerations: ca.SX


def momenta(link: ChainLink, base: Base) -> tuple[list[Step], ca.SX]:
    """Momenta p = ∂L/∂q̇ of one link (f, 1), from q and v, and the steps that they need."""
    pi = ca.SX.sym("pi", link.w.shape[0])
    F_q, F_w = ca.jacobian(link.tip, link.q), ca.jacobian(link.tip, link.w)
    steps: list[Step] = [
        carry(link.w, base.w, link.tip),
        carry(link.w_dot, base.w_dot, link.rate(link.tip)),
        carry(pi, _zeros_like(pi), gradient(link.kinetic, link.w_dot) + F_w.T @ pi, inward=True),
    ]
    return steps, gradient(link.kinetic, link.v) + F_q.T @ pi


def mass_matrix_diagonal(link: ChainLink) -> tuple[list[Step], ca.SX]:
    """Diagonal of the mass matrix of the chain at one link (f, 1), from q and w, and the steps that it needs."""
    F_q, F_w = ca.jacobian(link.tip, link.q), ca.jacobian(link.tip, link.w)
    M, _ = ca.hessian(link.kinetic, ca.vertcat(link.v, link.w_dot))
    M_qq, M_ww = (M[part, part] for part in (slice(0, F_q.shape[1]), slice(F_q.shape[1], None)))
    entries, composite = _symbolic_symmetric("composite", M_ww.shape[0])  # inertia of all links beyond, moved as one
    carried = carry(entries, _zeros_like(entries), _lower_entries(M_ww + F_w.T @ composite @ F_w), inward=True)
    return [carried], ca.diag(M_qq + F_q.T @ composite @ F_q)


def link_motion(link: ChainLink, base: Base) -> LinkMotion:
    """Motion of all links from q, p, drives and loads, by sweeps along the chain."""
    q, v, w, w_dot, T, V, F = link.q, link.v, link.w, link.w_dot, link.kinetic, link.potential, link.tip
    F_q, F_w, F_dot = ca.jacobian(F, q), ca.jacobian(F, w), link.rate(F)
    p_v, p_w = gradient(T, v), gradient(T, w_dot)  # own momenta
    M_qq, M_qw, M_ww = ca.jacobian(p_v, v), ca.jacobian(p_v, w_dot), ca.jacobian(p_w, w_dot)
    s, phi, c, w_ddot = (ca.SX.sym(name, w.shape[0]) for name in ("s", "phi", "c", "w_ddot"))
    g, a, push = (ca.SX.sym(name, q.shape[0]) for name in ("g", "a", "push"))
    entries, P = _symbolic_symmetric("P", w.shape[0])
    G = ca.SX.sym("G", *M_qw.shape)

    # Inward: what the links beyond weigh.  Outward: rates.
    D, U = M_qq + F_q.T @ P @ F_q, M_qw + F_q.T @ P @ F_w
    G_solved, g_solved = solve_symmetric(D, U), solve_symmetric(D, link.p - F_q.T @ s)
    weight = carry(entries, _zeros_like(entries), _lower_entries(M_ww + F_w.T @ P @ F_w - U.T @ G_solved), inward=True)
    steps: list[Step] = [
        carry(w, base.w, F),
        weight,
        Each(ca.vec(G), ca.vec(ca.densify(G_solved))),
        carry(s, _zeros_like(s), F_w.T @ s + U.T @ g_solved, inward=True),
        Each(g, g_solved),
        carry(w_dot, base.w_dot, ca.substitute(F_dot, v, g - G @ w_dot)),
        Each(v, g - G @ w_dot),
    ]

    # Inward: forces.  f: those that act on q, h: those that act on the joint, both less what accelerations bring.
    pi = P @ F_dot + s
    virtual_q, virtual_w = (ca.jacobian(link.points, x).T @ link.loads for x in (q, w))
    touch_q, touch_w = (ca.jacobian(link.contact_rates, x).T @ link.contact_forces for x in (v, w_dot))
    Q, Q_w = link.drive - virtual_q + touch_q, touch_w - virtual_w
    rub, rub_w = link.friction.forces_against(v), link.friction.forces_against(w_dot)
    f = Q - rub - gradient(V, q) + gradient(T, q) - link.rate(p_v)
    h = Q_w - rub_w - gradient(V, w) + gradient(T, w) - link.rate(p_w)
    b = P @ link.rate(F_dot) + c
    slope = gradient(T - V, w) + Q_w - rub_w + F_w.T @ phi + ca.jacobian(F_dot, w).T @ pi
    force = carry(c, _zeros_like(c), F_w.T @ b + G.T @ (f - F_q.T @ b) - h, inward=True)
    steps += [
        carry(phi, _zeros_like(phi), slope, inward=True),
        force,
        Each(push, solve_symmetric(D, f - F_q.T @ b)),
    ]

    # Outward: accelerations.
    F_ddot = F_q @ (push - G @ w_ddot) + F_w @ w_ddot + link.rate(F_dot)
    steps += [carry(w_ddot, base.w_ddot, F_ddot), Each(a, push - G @ w_ddot)]

    velocity = link.rate(link.points)
    acceleration = link.rate(velocity) + ca.jacobian(link.points, q) @ a + ca.jacobian(link.points, w) @ w_ddot
    power = ca.dot(link.drive, v) - ca.dot(link.loads, velocity)
    slips = ca.dot(link.contact_forces[link.gaps :, 0], link.contact_rates[link.gaps :, 0])
    loss = link.friction.power(ca.vertcat(v, w_dot)) - slips
    terms = ca.vertcat(T, V, power, *([] if loss.is_zero() else [loss]))
    totals = ca.SX.sym("total", terms.shape[0])
    steps.append(Sum(totals, terms))
    P_0 = ca.substitute(P, entries, weight.last)
    return LinkMotion(
        steps=tuple(steps),
        rates=v,
        momentum_rates=gradient(T - V, q) + Q - rub + F_q.T @ phi + ca.jacobian(F_dot, q).T @ pi,
        accelerations=a,
        kinetic_energy=totals[0],
        potential_energy=totals[1],
        joint_accelerations=w_ddot,
        base_force=P_0 @ base.w_ddot + force.last,
        power=totals[2],
        dissipation=ca.SX(0) if loss.is_zero() else totals[3],
        points=link.points,
        point_rates=velocity,
        point_accelerations=acceleration,
    )


def _symbolic_symmetric(name: str, d: int) -> tuple[ca.SX, ca.SX]:
    """Symbols for the lower entries of a symmetric matrix as a column, and the matrix (d, d)."""
    entries = ca.SX.sym(name, d * (d + 1) // 2)
    return entries, ca.tril2symm(ca.SX(ca.Sparsity.lower(d), entries))


def _lower_entries(matrix: ca.SX) -> ca.SX:
    """Lower entries of a symmetric matrix as a column, in the order of :func:`_symbolic_symmetric`."""
    rows, columns = ca.Sparsity.lower(matrix.shape[0]).get_triplet()
    return stack(ca.densify(matrix)[i, j] for i, j in zip(rows, columns, strict=True))


def _zeros_like(symbols: ca.SX) -> ca.SX:
    """Zeros of the length of a column of symbols."""
    return ca.SX.zeros(symbols.shape[0])
