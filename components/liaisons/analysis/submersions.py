"""Geometry of active constraints π(x) = σ(t) in coordinates that need not be adapted to them (M 3.5, 6, 7).

Rates u are those of the active coordinates: of those that L has, and of the values σ of rheonomic constraints.  In
coordinates with passive constraints, too, all of them together are C ẋ + D u = 0.  A velocity is vertical where u = 0,
and horizontal where it has the least kinetic energy for its u, v = g⁻¹ dπᵀ Θ u.  A momentum of V*M is a class: p and
p + Cᵀ ν are the same.  In adapted coordinates C has no rows.
"""

from __future__ import annotations

import casadi as ca

from liaisons.analysis.quantity import Source, equations_of, require_quadratic, require_smooth
from liaisons.errors import ComponentError
from liaisons.expressions.algebra import solve_symmetric
from liaisons.mechanics.equations import Equations

PURPOSE = "the geometry of active constraints"


def submersion_of(source: Source) -> Equations:
    """The equations of a mechanism with active coordinates, without non-holonomic constraints and contacts.

    :raises ComponentError: for any other.
    """
    equations = equations_of(source)
    require_smooth(equations, PURPOSE)
    m = equations.mechanism
    for item in m.non_holonomic:
        raise ComponentError(f"{equations.name}: {PURPOSE} needs a submersion, and {item.name} constrains rates alone")
    if not m.actives:
        raise ComponentError(f"{equations.name}: it has no active coordinate; declare one as ActiveCoordinate")
    return equations


def horizontal_lift(equations: Equations) -> ca.SX:
    """Horizontal lift Γ, (f, a): ẋ = Γ u has the least kinetic energy for the rates u of the active coordinates."""
    require_quadratic(equations, "a connection")
    m, C = equations.mechanism, _constraint_jacobians(equations)[0]
    mixed = ca.jacobian(equations.momenta, m.active.s_dot)
    free = -_solve_mass_matrix(equations, mixed)
    if not C.shape[0]:
        return free
    away = -_constraint_jacobians(equations)[1] - C @ free
    return free + _least_energy_velocity(equations, away)


def vertical_velocity(equations: Equations) -> ca.SX:
    """Velocity ẋ for momentum p at u = 0 (f,): A⁻¹ (p − b) projected onto the constraints."""
    free, C = equations.mechanism.free, _constraint_jacobians(equations)[0]
    loose = _solve_mass_matrix(equations, free.frame.T @ free.p - momenta_at_rest(equations))
    return loose if not C.shape[0] else loose - _least_energy_velocity(equations, C @ loose)


def momenta_at_rest(equations: Equations) -> ca.SX:
    """Momentum b of p = A ẋ + B u + b at rest, which a magnetic field makes (f,)."""
    m = equations.mechanism
    rates = ca.vertcat(m.free.q_dot, m.active.s_dot)
    return ca.substitute(equations.momenta, rates, ca.SX.zeros(rates.shape))


def lifted_mass(equations: Equations) -> ca.SX:
    """Effective mass Θ, (a, a): Θ(u, u) is twice the kinetic energy of the horizontal velocity (M eq. 50, 51)."""
    m, lift = equations.mechanism, horizontal_lift(equations)
    metric = ca.hessian(equations.lagrangian, ca.vertcat(m.free.q_dot, m.active.s_dot))[0]
    whole = ca.vertcat(lift, ca.SX.eye(len(m.actives)))
    return whole.T @ metric @ whole


def fibre_hamiltonian(equations: Equations) -> ca.SX:
    """H̃_0(x, p) on V*M: energy of the motion while the active coordinates rest (M 7) [J]."""
    m = equations.mechanism
    rates, velocity = ca.vertcat(m.free.q_dot, m.active.s_dot), vertical_velocity(equations)
    at = ca.vertcat(velocity, ca.SX.zeros(m.active.s_dot.shape))
    L = ca.substitute(equations.lagrangian, rates, at)
    return ca.dot(velocity, m.free.frame.T @ m.free.p) - L


def dynamic_lift(equations: Equations, u: ca.SX) -> ca.SX:
    """Function p·Γ u that generates the lift of rates u by the dynamic connection on V*M (M eq. 53) [J]."""
    free = equations.mechanism.free
    return ca.dot(free.frame.T @ free.p - momenta_at_rest(equations), horizontal_lift(equations) @ u)


def _constraint_jacobians(equations: Equations) -> tuple[ca.SX, ca.SX]:
    """Jacobians C (c, f) and D (c, a) of the holonomic constraints' rates C ẋ + D u."""
    m, constraints = equations.mechanism, equations.constraints
    rates = constraints.rate_residuals
    return ca.jacobian(rates, m.free.q_dot), ca.jacobian(rates, m.active.s_dot)


def _solve_mass_matrix(equations: Equations, right: ca.SX) -> ca.SX:
    """Solution A⁻¹ right of the linear system with the mass matrix."""
    return solve_symmetric(equations.mass_matrix, right)


def _least_energy_velocity(equations: Equations, rates: ca.SX) -> ca.SX:
    """Velocity A⁻¹ Cᵀ (C A⁻¹ Cᵀ)⁻¹ rates, of least kinetic energy among all with C ẋ = rates."""
    C = _constraint_jacobians(equations)[0]
    towards = _solve_mass_matrix(equations, C.T)
    return towards @ solve_symmetric(C @ towards, rates)
