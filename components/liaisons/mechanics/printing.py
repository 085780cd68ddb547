"""Equations of a component in the form of the textbooks, for the documentation inside the FMU.

A second derivation from the Lagrangian: generalised forces and multipliers stay symbols, where
:mod:`liaisons.mechanics.equations` solves for them.
"""

from collections.abc import Iterable, Iterator

import casadi as ca
import numpy as np

from liaisons.algebra import at_zero, gradient, solve_symmetric, stack
from liaisons.base.array_names import suffixed_name
from liaisons.errors import ComponentError
from liaisons.language import Mechanism, ParameterArray, Sampled, SignalComponent
from liaisons.mechanics.constraints import differentiated_constraints
from liaisons.mechanics.contacts import contact_method
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.model import Equation

_TOGETHER = 3
"""Largest number of constraints whose multipliers are solved for in symbols."""


def mechanism_equations(equations: Equations) -> tuple[Equation, ...]:
    """Equations of a mechanism: Lagrangian, momenta, motion, constraints, contacts, operators' forces, outputs."""
    m, applied, dynamics = equations.mechanism, equations.applied, equations.dynamics
    method = contact_method(m.contact_formulas)
    count, actives = len(m.coordinates), [s.name for s in m.actives]
    names, rates, momenta = (list(map(str, ca.vertsplit(x))) for x in (m.free.q, m.free.q_dot, m.free.p))
    turning = m.free.kinematics @ m.free.q_dot
    balances = _force_balances(equations)
    return (
        Equation("lagrangian", "L", equations.lagrangian),
        Equation("energy", "energy", equations.energy),
        *dissipation_equation("friction", applied.friction.function),
        *row_equations("momenta", momenta, m.free.frame @ equations.momenta),
        *(() if dynamics.convergence.shape[0] else row_equations("rates", rates, dynamics.velocities)),
        *row_equations("rates", [f"{name}_dot" for name in names[count:]], turning[count:, 0]),
        *row_equations("motion", [suffixed_name(p, "_dot") for p in momenta], m.free.frame @ balances[: len(rates), 0]),
        *row_equations("internal", [f"{x.name}_dot" for x in m.internal_states], equations.internal_rates),
        *constraint_equations(equations),
        *(method.equations(equations) if method else ()),
        *row_equations("forces", [f"{name}_force" for name in actives[: m.active.adapted]], balances[len(rates) :, 0]),
        *_effective_mass_equations(_effective_mass_matrix(equations, balances[len(rates) :, 0]), actives),
        *row_equations("points", applied.points, stack(applied.points.values())),
        *(Equation("outputs", item.name, m.expression_of(item)) for item in m.outputs),
    )


def of_signals(m: SignalComponent) -> tuple[Equation, ...]:
    """Equations of an operator or sampled component: signal, rates of internal states, updates at samples."""
    arrays = any(isinstance(p, ParameterArray) for p in m.parameters)  # a choice among many is not a formula
    names = (f"{x.name}_dot" for x in m.internal_states)
    return (
        *(Equation("signal", "y", y) for y in m.triple()[:1] if not arrays),
        *row_equations("internal", names, m.internal_rate_column()),
        *(Equation("update", name, ca.SX(x)) for name, x in (m.update() if isinstance(m, Sampled) else {}).items()),
    )


def further_equations(component: type[Mechanism]) -> tuple[tuple[Equation, ...], str]:
    """Equations of operators, accelerations and Hamilton's mechanics, which are for reading only.

    :returns: the equations, and why there are none of Hamilton's mechanics; empty if there are.
    """
    equations = derive(component)
    further = (*_operator_equations(equations), *_acceleration_equations(equations))
    try:
        return (*further, *_hamiltonian_equations(equations)), ""
    except ComponentError as reason:
        return further, str(reason)


def dissipation_equation(section: str, function: ca.SX) -> Iterator[Equation]:
    """Yield the dissipation function as an equation, unless it is 0."""
    if not function.is_zero():
        yield Equation(section, "D", function)


def _operator_equations(equations: Equations) -> tuple[Equation, ...]:
    """Equations of the operators: power of each, and multipliers of constraints as solved for."""
    m, lambdas = equations.mechanism, _solved_multipliers(equations)
    powers = row_equations("power", [f"{s.name}_power" for s in m.actives], m.active.force * m.active.s_dot)
    names = [f"lambda_{item.name}" for item in m.passive_constraints]
    names += [f"{item.name}_force" for item in m.rheonomic_constraints]
    return (*powers, *(() if lambdas is None else row_equations("multipliers", names, lambdas)))


def _solved_multipliers(equations: Equations) -> ca.SX | None:
    """Multipliers λ of all constraints, without stabilisation (c,); None if there are no constraints, or many."""
    A, C = equations.mass_matrix, equations.constraints.matrix
    if not 0 < C.shape[0] <= _TOGETHER:
        return None
    targets = differentiated_constraints(equations.mechanism, alpha=0).targets
    return solve_symmetric(C @ solve_symmetric(A, C.T), targets - C @ solve_symmetric(A, equations.forces))


def _acceleration_equations(equations: Equations) -> tuple[Equation, ...]:
    """Equations of accelerations, and of A and h in A ẍ + h = 0, with symbols λ, without drives and loads."""
    m, A = equations.mechanism, equations.mass_matrix
    C, lambdas = equations.constraints.matrix, ca.vertcat(m.multipliers, m.active.force[m.active.adapted :, 0])
    forces = at_zero(equations.forces + C.T @ lambdas, equations.applied.outer)
    names = [q.name for q in m.coordinates]
    turns = [rate for orientation in m.orientations for rate in orientation.rates]
    accelerations = [suffixed_name(name, "_ddot") for name in names] + [suffixed_name(rate, "_dot") for rate in turns]
    rows = [*names, *turns]
    matrix = (
        Equation("matrix", f"A[{row},{rows[k]}]", A[i, k])
        for i, row in enumerate(rows)
        for k in range(i, len(rows))
        if A.sparsity().has_nz(i, k)
    )
    return (
        *row_equations("accelerations", accelerations, _solved_accelerations(A, forces)),
        *matrix,
        *row_equations("matrix", [f"h[{row}]" for row in rows], -forces),
    )


def _solved_accelerations(A: ca.SX, forces: ca.SX) -> ca.SX:
    """Accelerations A⁻¹ forces; of two coupled rates by Cramer's rule, as on paper."""
    if A.shape != (2, 2) or not A.sparsity().has_nz(0, 1):
        return solve_symmetric(A, forces)
    over = ca.vertcat(A[1, 1] * forces[0] - A[0, 1] * forces[1], A[0, 0] * forces[1] - A[0, 1] * forces[0])
    return over / (A[0, 0] * A[1, 1] - A[0, 1] ** 2)


def _hamiltonian_equations(equations: Equations) -> tuple[Equation, ...]:
    """Equations of the Hamiltonian H of all coordinates, prescribed ones, too, and canonical ones (M eq. 36-38).

    :raises ComponentError: where Legendre's transformation does not exist.
    """
    m, L = equations.mechanism, equations.lagrangian
    for item in (*m.orientations, *m.rheonomic_constraints):
        raise ComponentError(f"{equations.name}: {item.name} is not a coordinate, of which the canonical equations are")
    names = [item.name for item in (*m.coordinates, *m.actives)]
    x, rates = ca.vertcat(m.free.q, m.active.s), ca.vertcat(m.free.q_dot, m.active.s_dot)
    momenta = gradient(L, rates)
    metric = ca.jacobian(momenta, rates)
    if ca.depends_on(metric, rates):
        raise ComponentError(f"{equations.name}: L is not quadratic in the rates, and not inverted here")
    if (rank := _generic_rank(metric)) < len(names):
        raise ComponentError(
            f"{equations.name}: L is not hyper-regular: its kinetic energy has rank {rank} in {len(names)} rates, so "
            "that no Hamiltonian of all momenta exists"
        )
    p = ca.vertcat(m.free.p, stack(ca.SX.sym(f"p_{s.name}") for s in m.actives))
    still = at_zero(ca.vertcat(momenta, L), rates)
    moving = p - still[:-1]
    solved, kinetic = _rates_and_energy(metric, moving, m.free.q.shape[0])
    pulled = ca.substitute(gradient(L, x), rates, solved)  # -∂H/∂x by Legendre's transformation
    applied = equations.applied_forces + ca.vertcat(ca.SX.zeros(m.free.q.shape), m.active.force)
    return (
        Equation("hamiltonian", "H", kinetic - still[-1]),
        *row_equations("canonical", [suffixed_name(name, "_dot") for name in names], solved),
        *row_equations("canonical", [suffixed_name(f"p_{name}", "_dot") for name in names], pulled + applied),
    )


def _rates_and_energy(metric: ca.SX, p: ca.SX, count: int) -> tuple[ca.SX, ca.SX]:
    """Rates A⁻¹ p and ½ pᵀ A⁻¹ p; of one prescribed coordinate by its effective mass, a symbol Θ (M eq. 50).

    :param count: number of free coordinates, which come first.
    """
    if not 0 < count == metric.shape[0] - 1:
        solved = solve_symmetric(metric, p)
        return solved, ca.dot(solved, p) / 2
    A, B, free = metric[:count, :count], metric[:count, count], p[:count]
    left, alone = p[count] - ca.dot(solve_symmetric(A, B), free), solve_symmetric(A, free)
    theta = ca.SX.sym("Theta")
    rate = left / theta
    return ca.vertcat(solve_symmetric(A, free - B * rate), rate), ca.dot(alone, free) / 2 + left**2 / (2 * theta)


def _generic_rank(matrix: ca.SX) -> int:
    """Rank of a matrix at almost all values of its symbols."""
    symbols = ca.symvar(matrix)
    values = np.random.default_rng(0).uniform(0.5, 1.5, len(symbols))
    return int(np.linalg.matrix_rank(np.array(ca.Function("matrix", symbols, [matrix]).call(list(values))[0])))


def _force_balances(equations: Equations) -> ca.SX:
    """Forces ∂L/∂x + Q on free coordinates; below, d/dt ∂L/∂σ̇ − ∂L/∂s − Q_s on active ones, with symbols ẍ and λ."""
    m, L = equations.mechanism, equations.lagrangian
    s, s_dot = m.active.adapted_columns
    count = m.free.q_dot.shape[0]
    on_free, on_active = equations.applied_forces[:count, 0], equations.applied_forces[count:, 0]
    force = m.free.kinematics.T @ gradient(L, m.free.q) + on_free
    return ca.vertcat(force, m.dot(gradient(L, s_dot)) - gradient(L, s) - on_active)


def _effective_mass_matrix(equations: Equations, forces: ca.SX) -> ca.SX:
    """Effective mass Θ = ∂λ/∂σ̈, from the forces on adapted coordinates with ẍ and λ as symbols."""
    m, lambdas = equations.mechanism, _solved_multipliers(equations)
    if lambdas is None:
        return equations.effective_mass
    symbols = ca.vertcat(m.multipliers, m.active.force[forces.shape[0] :, 0])
    accelerations = solve_symmetric(equations.mass_matrix, equations.forces + equations.constraints.matrix.T @ lambdas)
    solved = ca.substitute(ca.vertcat(forces, m.active.force[forces.shape[0] :, 0]), symbols, lambdas)
    return ca.jacobian(ca.substitute(solved, m.free.q_ddot, accelerations), m.active.s_ddot)


def _effective_mass_equations(theta: ca.SX, actives: list[str]) -> Iterator[Equation]:
    """Yield the upper triangle of Θ as equations; a single entry without subscripts."""
    for i, row in enumerate(actives):
        for k, column in enumerate(actives[i:], i):
            if theta.sparsity().has_nz(i, k):
                yield Equation("effective_mass", f"Theta[{row},{column}]" if len(actives) > 1 else "Theta", theta[i, k])


def constraint_equations(equations: Equations) -> Iterator[Equation]:
    """Yield the passive constraints, and the functions that operators prescribe, as equations."""
    m = equations.mechanism
    for item in m.passive_constraints:
        yield Equation("constraints", "0", m.expression_of(item))
    for item in m.rheonomic_constraints:
        yield Equation("constraints", item.name, m.expression_of(item))


def row_equations(section: str, names: Iterable[str], column: ca.SX) -> Iterator[Equation]:
    """Equations of a section, one for each name and row of a column."""
    return (Equation(section, name, row) for name, row in zip(names, ca.vertsplit(column), strict=True))
