"""Geometry of active constraints π(x) = σ(t) in coordinates that need not be adapted to them (M 3.5, 6, 7).

Rates u are those of the active coordinates: of those that L has, and of the values σ of rheonomic constraints.  In
coordinates with passive constraints, too, all of them together are C ẋ + D u = 0.  A velocity is vertical where u = 0,
and horizontal where it has the least kinetic energy for its u, v = g⁻¹ dπᵀ Θ u.  A momentum of V*M is a class: p and
p + Cᵀ ν are the same.  In adapted coordinates C has no rows.
"""

from __future__ import annotations

import casadi as ca

from liaisons.algebra import hessian
from liaisons.errors import ComponentError
from liaisons.mechanics import Equations
from liaisons_motion.analysis.quantity import Source, all_rates, equations_of, require_no_contacts

PURPOSE = "the geometry of active constraints"


def equations_with_active_coordinates(source: Source) -> Equations:
    """Equations of a mechanism that has active coordinates.

    :raises ComponentError: if it has none; for non-holonomic constraints and contacts.
    """
    equations = equations_of(source)
    require_no_contacts(equations, PURPOSE)
    m = equations.mechanism
    for item in m.non_holonomic:
        raise ComponentError(f"{equations.name}: {PURPOSE} needs a submersion, and {item.name} constrains rates alone")
    if not m.actives:
        raise ComponentError(f"{equations.name}: it has no active coordinate; declare one as ActiveCoordinate")
    return equations


def horizontal_lift(equations: Equations) -> ca.SX:
    """Horizontal lift Γ, (f, a): ẋ = Γ u has the least kinetic energy for the rates u of the active coordinates."""
    rates = all_rates(equations)
    if ca.depends_on(hessian(equations.lagrangian, rates), rates):
        raise ComponentError(f"{equations.name}: a connection needs a Lagrangian that is quadratic in the rates")
    C, D = _constraint_jacobians(equations)
    mixed = ca.jacobian(equations.momenta, equations.mechanism.active.s_dot)
    free = -equations.dynamics.inertia.solve(mixed)
    return free if not C.shape[0] else free - _least_energy_velocity(equations, D + C @ free)


def vertical_velocity(equations: Equations) -> ca.SX:
    """Velocity ẋ at momentum p while active coordinates rest: A⁻¹ (p - b), projected onto the constraints; (f,)."""
    free, C = equations.mechanism.free, _constraint_jacobians(equations)[0]
    unconstrained = equations.dynamics.inertia.solve(free.frame.T @ free.p - momenta_at_rest(equations))
    return unconstrained if not C.shape[0] else unconstrained - _least_energy_velocity(equations, C @ unconstrained)


def momenta_at_rest(equations: Equations) -> ca.SX:
    """Momenta b at rest, of p = A ẋ + B u + b: those of a magnetic field; (f,)."""
    rates = all_rates(equations)
    return ca.substitute(equations.momenta, rates, ca.SX.zeros(rates.shape))


def effective_mass_matrix(equations: Equations) -> ca.SX:
    """Effective mass Θ, (a, a): ½ Θ(u, u) is the kinetic energy of the horizontal velocity (M eq. 50, 51)."""
    metric = hessian(equations.lagrangian, all_rates(equations))
    whole = ca.vertcat(horizontal_lift(equations), ca.SX.eye(len(equations.mechanism.actives)))
    return whole.T @ metric @ whole


def fibre_hamiltonian(equations: Equations) -> ca.SX:
    """Hamiltonian H̃_0(x, p) on V*M of the motion while the active coordinates rest (M 7) [J]."""
    m = equations.mechanism
    rates, velocity = all_rates(equations), vertical_velocity(equations)
    L = ca.substitute(equations.lagrangian, rates, ca.vertcat(velocity, ca.SX.zeros(m.active.s_dot.shape)))
    return ca.dot(velocity, m.free.frame.T @ m.free.p) - L


def dynamic_lift_generator(equations: Equations, u: ca.SX) -> ca.SX:
    """Function p·Γ u whose Hamiltonian field is the lift of rates u by the dynamic connection (M eq. 53) [J]."""
    free = equations.mechanism.free
    return ca.dot(free.frame.T @ free.p - momenta_at_rest(equations), horizontal_lift(equations) @ u)


def _constraint_jacobians(equations: Equations) -> tuple[ca.SX, ca.SX]:
    """Jacobians C (c, f) and D (c, a) of the rates C ẋ + D u of the holonomic constraints."""
    m, constraints = equations.mechanism, equations.constraints
    rates = constraints.rate_residuals
    return ca.jacobian(rates, m.free.q_dot), ca.jacobian(rates, m.active.s_dot)


def _least_energy_velocity(equations: Equations, rates: ca.SX) -> ca.SX:
    """Velocities ẋ of least kinetic energy with C ẋ = ``rates``: A⁻¹ Cᵀ (C A⁻¹ Cᵀ)⁻¹ rates, column by column."""
    C, squares, free = _constraint_jacobians(equations)[0], equations.constraints.squares, equations.mechanism.free
    A, zero = equations.dynamics.inertia, ca.SX.zeros(free.q_dot.shape)
    solved = [A.solve_constrained(C, zero, column, squares)[0] for column in ca.horzsplit(rates)]
    return ca.horzcat(*solved)
