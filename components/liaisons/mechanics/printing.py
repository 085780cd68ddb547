"""Equations of a component in the form of the textbooks, for the documentation inside the FMU.

A second derivation from the Lagrangian: generalised forces and multipliers stay symbols, where
:mod:`liaisons.mechanics.equations` solves for them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import casadi as ca

from liaisons.expressions.algebra import gradient, stack
from liaisons.language.chain import Chain
from liaisons.language.declarations import ParameterArray
from liaisons.language.operator import Operator
from liaisons.mechanics.equations import Equations
from liaisons.mechanics.model import Equation


def of_mechanism(equations: Equations) -> tuple[Equation, ...]:
    """Lagrangian, momenta, motion, operators' forces, effective mass, constraints, points and outputs."""
    m = equations.mechanism
    names = [q.name for q in m.coordinates]
    rates = [f"{name}_dot" for name in names]
    momenta, momentum_rates = [f"p_{name}" for name in names], [f"p_{name}_dot" for name in names]
    for orientation in m.orientations:
        names, rates = [*names, *orientation.quaternion], [*rates, *orientation.rates]
        momenta = [*momenta, *orientation.momenta]
        momentum_rates += [f"{name}_dot" for name in orientation.momenta]
    actives = [s.name for s in m.actives]
    adapted = actives[: len(actives) - len(m.rheonomic_constraints)]
    turning = m.free.kinematics @ m.free.q_dot
    balances = _balances(equations)
    return (
        Equation("lagrangian", "L", equations.lagrangian),
        Equation("energy", "energy", equations.energy),
        *_friction("friction", equations.friction.function),
        *_rows("momenta", momenta, m.free.frame @ equations.momenta),
        *_rows("velocities", rates, equations.velocities),
        *_rows("velocities", [f"{name}_dot" for name in names[len(m.coordinates) :]], turning[len(m.coordinates) :, 0]),
        *_rows("motion", momentum_rates, m.free.frame @ balances[: len(rates), 0]),
        *_rows("internal", [f"{x.name}_dot" for x in m.internal_states], equations.internal_rates),
        *_constraints(equations),
        *_rows("operators", [f"{name}_force" for name in adapted], balances[len(rates) :, 0]),
        *_effective_mass(equations.effective_mass, actives),
        *_rows("points", equations.points, stack(equations.points.values())),
        *(Equation("outputs", item.name, ca.SX(getattr(m, item.name))) for item in m.outputs),
    )


def of_operator(operator: Operator, signal: ca.SX) -> tuple[Equation, ...]:
    """Signal and rates of the internal states."""
    rates = operator.internal_rates()
    internal = (Equation("internal", f"{x.name}_dot", ca.SX(rates[x.name])) for x in operator.internal_states)
    arrays = any(isinstance(p, ParameterArray) for p in operator.parameters)  # a choice among many is no formula
    return (*(() if arrays else (Equation("signal", "y", signal),)), *internal)


def of_chain(chain: Chain) -> tuple[Equation, ...]:
    """Energies of a link, and the joint of the next one."""
    base = chain.base() or {}
    dissipated = ca.SX(chain.friction_coefficient()) * ca.SX(chain.kinetic_energy())
    dissipated += ca.SX(chain.dissipation_function()) + ca.SX(chain.bond_dissipation())
    points = chain.point_components()
    return (
        Equation("link", "kinetic_energy", ca.SX(chain.kinetic_energy())),
        Equation("link", "potential_energy", ca.SX(chain.potential_energy()) + ca.SX(chain.bond_energy())),
        *_friction("link", dissipated),
        *(Equation("joints", f"joint_{axis}[i+1]", ca.SX(position)) for axis, position in chain.tip().items()),
        *(Equation("joints", f"joint_{axis}[1]", ca.SX(position)) for axis, position in base.items()),
        *_rows("points", points, stack(points.values())),
    )


def _friction(section: str, function: ca.SX) -> Iterator[Equation]:
    if not function.is_zero():
        yield Equation(section, "D", function)


def _balances(equations: Equations) -> ca.SX:
    """∂L/∂x + Q + Cᵀ λ, then d/dt ∂L/∂σ̇ − ∂L/∂s − Q_s, with ẍ and all λ as symbols; one row for each rate."""
    m, L = equations.mechanism, equations.lagrangian
    free, active, constraints = m.free, m.active, equations.constraints
    adapted = len(m.actives) - len(m.rheonomic_constraints)
    s, s_dot = active.s[:adapted, 0], active.s_dot[:adapted, 0]
    points = stack(equations.points.values())
    multipliers = ca.vertcat(m.multipliers, active.force[adapted:, 0])

    drives = ca.vertcat(equations.drives - equations.loads, ca.SX.zeros(free.q_dot.shape[0] - len(m.coordinates), 1))
    force = drives + constraints.matrix.T @ multipliers + free.kinematics.T @ _pulled(L, points, equations, free.q)
    force -= equations.friction.against(free.q_dot)
    on_operator = m.dot(gradient(L, s_dot)) - _pulled(L, points, equations, s)
    on_operator += equations.friction.against(s_dot)
    rigid = list(constraints.holonomic)
    on_operator -= ca.jacobian(constraints.residuals[rigid, 0], s).T @ multipliers[rigid, 0]
    return ca.vertcat(force, on_operator)


def _pulled(L: ca.SX, points: ca.SX, equations: Equations, where: ca.SX) -> ca.SX:
    """∂L/∂x less the generalised force of the loads at the points (K eq. 14)."""
    return gradient(L, where) - ca.jacobian(points, where).T @ equations.point_loads


def _effective_mass(theta: ca.SX, actives: list[str]) -> Iterator[Equation]:
    """Θ is symmetric: its upper triangle; a single one without subscripts."""
    for i, row in enumerate(actives):
        for k, column in enumerate(actives[i:], i):
            if theta.sparsity().has_nz(i, k):
                yield Equation("effective mass", f"Theta[{row},{column}]" if len(actives) > 1 else "Theta", theta[i, k])


def _constraints(equations: Equations) -> Iterator[Equation]:
    m = equations.mechanism
    for item in (*m.constraints, *m.non_holonomic):
        yield Equation("constraints", "0", ca.SX(getattr(m, item.name)))
    for item in m.rheonomic_constraints:
        yield Equation("constraints", item.name, ca.SX(getattr(m, item.name)))


def _rows(section: str, names: Iterable[str], column: ca.SX) -> Iterator[Equation]:
    return (Equation(section, name, row) for name, row in zip(names, ca.vertsplit(column), strict=True))
