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
from functools import cached_property

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

    @cached_property
    def tip_slopes(self) -> tuple[ca.SX, ca.SX]:
        """F_q (d, f) and F_w (d, d)."""
        return ca.jacobian(self.tip, self.q), ca.jacobian(self.tip, self.w)

    @cached_property
    def tip_rate(self) -> ca.SX:
        """Ḟ (d,)."""
        return self.rate(self.tip)

    @cached_property
    def own_momenta(self) -> tuple[ca.SX, ca.SX]:
        """∂T/∂v (f,) and ∂T/∂ẇ (d,), without those of the links beyond."""
        return gradient(self.kinetic, self.v), gradient(self.kinetic, self.w_dot)

    @property
    def forces(self) -> tuple[ca.SX, ca.SX]:
        """Drives, loads at points by virtual work (K eq. 14) and contacts, on q (f,) and on w (d,)."""
        virtual_q, virtual_w = (ca.jacobian(self.points, x).T @ self.loads for x in (self.q, self.w))
        rates = self.v, self.w_dot
        touch_q, touch_w = (ca.jacobian(self.contact_rates, x).T @ self.contact_forces for x in rates)
        return self.drive - virtual_q + touch_q, touch_w - virtual_w


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
    (F_q, F_w), (p_v, p_w) = link.tip_slopes, link.own_momenta
    steps: list[Step] = [
        carry(link.w, base.w, link.tip),
        carry(link.w_dot, base.w_dot, link.tip_rate),
        carry(pi, _zeros_like(pi), p_w + F_w.T @ pi, inward=True),
    ]
    return steps, p_v + F_q.T @ pi


def mass_matrix_diagonal(link: ChainLink) -> tuple[list[Step], ca.SX]:
    """Diagonal of the mass matrix of the chain at one link (f, 1), from q and w, and the steps that it needs."""
    F_q, F_w = link.tip_slopes
    M, _ = ca.hessian(link.kinetic, ca.vertcat(link.v, link.w_dot))
    M_qq, M_ww = (M[part, part] for part in (slice(0, F_q.shape[1]), slice(F_q.shape[1], None)))
    entries, composite = _symbolic_symmetric("composite", M_ww.shape[0])  # inertia of all links beyond, moved as one
    carried = carry(entries, _zeros_like(entries), _lower_entries(M_ww + F_w.T @ composite @ F_w), inward=True)
    return [carried], ca.diag(M_qq + F_q.T @ composite @ F_q)


def link_motion(link: ChainLink, base: Base) -> LinkMotion:
    """Motion of all links from q, p, drives and loads, by sweeps along the chain."""
    beyond = _articulated_inertia(link)
    to_rates, pi = _rate_steps(link, base, beyond)
    to_gradient, momentum_rates = _momentum_rates(link, pi)
    accelerated = _accelerations(link, base, beyond)
    a, w_ddot = accelerated.own, accelerated.joint
    velocity = link.rate(link.points)
    acceleration = link.rate(velocity) + ca.jacobian(link.points, link.q) @ a
    total = _energies(link, velocity)
    return LinkMotion(
        steps=(*to_rates, to_gradient, *accelerated.steps, total.step),
        rates=link.v,
        momentum_rates=momentum_rates,
        accelerations=a,
        kinetic_energy=total.kinetic,
        potential_energy=total.potential,
        joint_accelerations=w_ddot,
        base_force=accelerated.base_force,
        power=total.power,
        dissipation=total.dissipation,
        points=link.points,
        point_rates=velocity,
        point_accelerations=acceleration + ca.jacobian(link.points, link.w) @ w_ddot,
    )


@dataclass(frozen=True, eq=False)
class _ArticulatedInertia:
    """Inertia of a link with all that is beyond its tip, where these links are free to move."""

    P: ca.SX  # of what is beyond, in symbols (d, d)
    D: ca.SX  # M_qq + F_qᵀ P F_q (f, f)
    U: ca.SX  # M_qw + F_qᵀ P F_w (f, d)
    G: ca.SX  # D⁻¹ U, in symbols (f, d)
    at_base: ca.SX  # P of the whole chain (d, d)
    steps: tuple[Step, Step]  # to P, and to G


def _articulated_inertia(link: ChainLink) -> _ArticulatedInertia:
    """Inertia of a link and those beyond, inward: P ← M_ww + F_wᵀ P F_w − Uᵀ G with D G = U."""
    (F_q, F_w), (p_v, p_w) = link.tip_slopes, link.own_momenta
    M_qq, M_qw, M_ww = ca.jacobian(p_v, link.v), ca.jacobian(p_v, link.w_dot), ca.jacobian(p_w, link.w_dot)
    entries, P = _symbolic_symmetric("P", link.w.shape[0])
    D, U, G = M_qq + F_q.T @ P @ F_q, M_qw + F_q.T @ P @ F_w, ca.SX.sym("G", *M_qw.shape)
    solved = solve_symmetric(D, U)
    weight = carry(entries, _zeros_like(entries), _lower_entries(M_ww + F_w.T @ P @ F_w - U.T @ solved), inward=True)
    steps = weight, Each(ca.vec(G), ca.vec(ca.densify(solved)))
    return _ArticulatedInertia(P, D, U, G, ca.substitute(P, entries, weight.last), steps)


def _rate_steps(link: ChainLink, base: Base, beyond: _ArticulatedInertia) -> tuple[list[Step], ca.SX]:
    """Steps to the rates v = D⁻¹ (p − F_qᵀ s) − G ẇ (M eq. 36), and the momentum π = P Ḟ + s beyond the tip (d,)."""
    (F_q, F_w), w_dot = link.tip_slopes, link.w_dot
    s, g = ca.SX.sym("s", link.w.shape[0]), ca.SX.sym("g", link.q.shape[0])
    solved = solve_symmetric(beyond.D, link.p - F_q.T @ s)
    rates = g - beyond.G @ w_dot
    steps: list[Step] = [
        carry(link.w, base.w, link.tip),
        *beyond.steps,
        carry(s, _zeros_like(s), F_w.T @ s + beyond.U.T @ solved, inward=True),
        Each(g, solved),
        carry(w_dot, base.w_dot, ca.substitute(link.tip_rate, link.v, rates)),
        Each(link.v, rates),
    ]
    return steps, beyond.P @ link.tip_rate + s


def _momentum_rates(link: ChainLink, pi: ca.SX) -> tuple[Step, ca.SX]:
    """Step to φ, inward, and ṗ = ∂L/∂q + F_qᵀ φ + Ḟ_qᵀ π + Q (f,) (M eq. 26)."""
    T, V, F_dot, phi = link.kinetic, link.potential, link.tip_rate, ca.SX.sym("phi", link.w.shape[0])
    parts = zip((link.q, link.w), (link.v, link.w_dot), link.tip_slopes, link.forces, strict=True)
    own, joint = (
        gradient(T - V, x) + Q - link.friction.forces_against(rate) + F_x.T @ phi + ca.jacobian(F_dot, x).T @ pi
        for x, rate, F_x, Q in parts
    )
    return carry(phi, _zeros_like(phi), joint, inward=True), own


@dataclass(frozen=True, eq=False)
class _Accelerations:
    steps: list[Step]
    own: ca.SX  # a (f,)
    joint: ca.SX  # ẅ (d,)
    base_force: ca.SX  # r at the base (d,)


def _accelerations(link: ChainLink, base: Base, beyond: _ArticulatedInertia) -> _Accelerations:
    """Accelerations a = D⁻¹ (f − F_qᵀ b) − G ẅ: forces inward, b = P β + c, then accelerations outward."""
    (F_q, F_w), G = link.tip_slopes, beyond.G
    c, w_ddot = (ca.SX.sym(name, link.w.shape[0]) for name in ("c", "w_ddot"))
    a, push = (ca.SX.sym(name, link.q.shape[0]) for name in ("a", "push"))
    f, h = _forces_at_zero_accelerations(link)
    bias = link.rate(link.tip_rate)
    b = beyond.P @ bias + c
    force = carry(c, _zeros_like(c), F_w.T @ b + G.T @ (f - F_q.T @ b) - h, inward=True)
    own = push - G @ w_ddot
    steps: list[Step] = [
        force,
        Each(push, solve_symmetric(beyond.D, f - F_q.T @ b)),
        carry(w_ddot, base.w_ddot, F_q @ own + F_w @ w_ddot + bias),
        Each(a, own),
    ]
    return _Accelerations(steps, a, w_ddot, beyond.at_base @ base.w_ddot + force.last)


def _forces_at_zero_accelerations(link: ChainLink) -> tuple[ca.SX, ca.SX]:
    """Forces Q + ∂L/∂x less the part of d/dt ∂T/∂ẋ without accelerations: f on q (f,), h on w (d,)."""
    T, V, rub = link.kinetic, link.potential, link.friction.forces_against
    parts = zip((link.q, link.w), (link.v, link.w_dot), link.own_momenta, link.forces, strict=True)
    f, h = (Q - rub(rate) - gradient(V, x) + gradient(T, x) - link.rate(p) for x, rate, p, Q in parts)
    return f, h


@dataclass(frozen=True, eq=False)
class _Energies:
    step: Sum
    kinetic: ca.SX
    potential: ca.SX
    power: ca.SX
    dissipation: ca.SX


def _energies(link: ChainLink, velocity: ca.SX) -> _Energies:
    """Energies of the chain, power of drives and loads, power that friction takes: sums over its links.

    :param velocity: of the points (m,).
    """
    power = ca.dot(link.drive, link.v) - ca.dot(link.loads, velocity)
    slips = ca.dot(link.contact_forces[link.gaps :, 0], link.contact_rates[link.gaps :, 0])
    loss = link.friction.power(ca.vertcat(link.v, link.w_dot)) - slips
    terms = ca.vertcat(link.kinetic, link.potential, power, *([] if loss.is_zero() else [loss]))
    totals = ca.SX.sym("total", terms.shape[0])
    dissipation = ca.SX(0) if loss.is_zero() else totals[3]
    return _Energies(Sum(totals, terms), totals[0], totals[1], totals[2], dissipation)


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
