"""The motion of mechanisms as a model."""

from collections.abc import Iterator
from functools import partial

import casadi as ca

from liaisons.algebra import stack
from liaisons.base import units
from liaisons.errors import ComponentError
from liaisons.language import Mechanism
from liaisons.mechanics import Equations, derive, mechanism_equations
from liaisons_exchange.modelica_text.contacts import add_contacts
from liaisons_exchange.modelica_text.text import (
    MOTION,
    Section,
    bound_assertions,
    component_clause,
    declaration,
    filled_lines,
    identifier,
    model_lines,
    parameters,
    string_literal,
    units_of,
)
from liaisons_pages.formulas import Notation


def motion_model(component: type[Mechanism]) -> list[str]:
    """Return lines of the model ``Motion``: coordinates, rates, accelerations and outer forces are unknowns."""
    if component().layout().dimensions:
        raise ComponentError(f"{component.__name__}: Modelica text takes no arrays of a mechanism; import its FMU")
    e = derive(component)
    if e.dynamics.convergence.shape[0]:
        text = "Modelica text takes no Lagrangian that is not quadratic in the rates; import its FMU"
        raise ComponentError(f"{component.__name__}: {text}")
    m, section = e.mechanism, Section(Notation.from_component(component))
    conditions = bound_assertions((*m.parameters, *m.actives, *m.coordinates))
    for item in m.assertions:
        if distance := section.write_expression(getattr(m, item.name), readable=True):
            conditions.append(f"assert({distance} > 0, {string_literal(item.description)});")
        else:
            section.unsaid.append(item.name)
    _add_laws(e, section)
    _add_constraints(e, section)
    unit = units_of(m)
    discrete, contact_starts, clauses = add_contacts(e, section, unit, partial(_with_outer_forces, e))
    for item in m.calculated_parameters:
        section.add(item.name, m.expression_of(item), readable=True)
    section.add("kinetic_energy", e.kinetic_energy)
    section.add("potential_energy", e.potential_energy)
    section.add("energy", ca.SX.sym("kinetic_energy") + ca.SX.sym("potential_energy"))
    outputs = {item.name for item in (*m.outputs, *m.assertions, *m.calculated_parameters)}
    if missing := [name for name in section.unsaid if name not in outputs]:
        raise ComponentError(
            f"{component.__name__}: {missing[0]} has a function or a number that Modelica has not, such as "
            "an interpolant or inf; write it by formulas, or import its FMU"
        )
    constants, initial = parameters(m)
    declarations = [*constants, *discrete, *_declarations(e, section, unit), *section.comment]
    equations = [*filled_lines([*conditions, *section.statements]), *clauses]
    return model_lines(MOTION, declarations, equations, [*initial, *contact_starts])


def _add_laws(e: Equations, section: Section) -> None:
    """Write the component's laws of motion, with outer forces Q in place of drives and loads."""
    m, rates = e.mechanism, ca.vertsplit(e.mechanism.dot(e.momenta))
    names = [f"p_{v}".removesuffix("_dot") for v in map(str, ca.vertsplit(m.free.q_dot))]
    momenta = stack(map(ca.SX.sym, names))
    quaternions = {f"{name}_dot" for o in m.orientations for name in o.quaternion}
    section.add_rows(names, e.momenta)
    section.statements += [f"der({identifier(q.name)}) = {q.name}_dot;" for q in m.coordinates]
    count, forces = len(m.coordinates), list[ca.SX]()
    accelerated = dict(zip(names[:count], rates, strict=False))
    for law in mechanism_equations(e):
        right, name = _with_outer_forces(e, law.right), law.left.removesuffix("_dot")
        if law.section in ("motion", "internal") or law.left in quaternions:
            section.add(f"der({name})", right)
        if law.section == "motion":
            forces.append(right)
            if name in accelerated:
                section.add(f"der({name})", accelerated[name])
        if law.section in ("forces", "points", "outputs"):
            section.add(law.left, right, readable=law.section == "outputs")
    for i, o in enumerate(m.orientations):  # H = R p; the rate of p in the body frame is p × ω + Rᵀ Ḣ
        attitude, own = getattr(m, o.name), slice(count + 3 * i, count + 3 * i + 3)
        p = momenta[own]
        section.add_rows(o.momenta, attitude.matrix @ p)
        balance = ca.cross(p, attitude.rate) + attitude.matrix.T @ ca.vertcat(*forces[own])
        section.add_rows((f"{section.write_expression(rate)}" for rate in rates[own]), balance)


def _with_outer_forces(e: Equations, expression: ca.SX) -> ca.SX:
    """Return an expression with outer forces Q in place of drives and loads."""
    applied = [ca.SX.sym(f"Q_{q.name}") for q in e.mechanism.coordinates]
    attached = [-ca.SX.sym(f"Q_{name}") for name in e.applied.points]
    outside = ca.vertcat(*applied, *[0] * len(applied), *attached)
    return ca.substitute(expression, e.applied.outer, outside)


def _add_constraints(e: Equations, section: Section) -> None:
    """Write the residuals r of constraints and their decay: r̈ + 2α ṙ + α² r = 0, non-holonomic ṙ + α r = 0."""
    m, constraints = e.mechanism, e.constraints
    for i, item in enumerate((*m.constraints, *m.non_holonomic, *m.rheonomic_constraints)):
        name, rate, alpha = f"{item.name}_residual", constraints.rate_residuals[i], constraints.alpha
        section.add(name, constraints.residuals[i])
        decay = f"-{alpha:g}*{name}"
        if i in constraints.holonomic:
            section.add(f"{name}_dot", rate)
            decay = f"-{2 * alpha:g}*{name}_dot - {alpha**2:g}*{name}"
        section.add(decay, m.dot(rate))


def _declarations(e: Equations, section: Section, unit: dict[str, str]) -> Iterator[str]:
    """Yield declarations of active and free coordinates with their rates, then of all further variables."""
    m = e.mechanism
    unit |= {f"p_{name}": "kg.m2/s" for o in m.orientations for name in o.rates}
    unit |= {f"{name}_dot": units.rate(of) for name, of in unit.items() if name.endswith("_residual")}
    described = (*m.actives, *m.coordinates, *m.internal_states, *m.outputs, *m.calculated_parameters)
    texts = {item.name: item.description for item in described}
    starts = {x: f"{x}_0" for x in map(str, ca.vertsplit(m.free.q))}
    if m.constraints or m.non_holonomic:  # without a guess of the momenta multipliers are sought where they do nothing
        motion = ca.vertcat(m.free.q, m.free.q_dot)
        at_start = ca.vertcat(*(ca.SX.sym(f"{x}_0") for x in ca.vertsplit(motion)))
        for q, momentum in zip(m.coordinates, ca.vertsplit(e.momenta), strict=False):
            starts[f"p_{q.name}"] = section.write_expression(ca.substitute(momentum, motion, at_start)) or ""
    groups = [[s.name, f"{s.name}_dot", f"{s.name}_ddot"] for s in m.actives]
    groups += [[q.name, f"{q.name}_dot", f"{q.name}_ddot", f"p_{q.name}"] for q in m.coordinates]
    without = [p.name for p in m.layout().parameters] + [name for group in groups for name in group]
    for group in (*groups, section.variables_except(*without)):
        yield from component_clause(
            "Real", (declaration(x, unit.get(x, ""), texts.get(x, ""), start=starts.get(x, "")) for x in group)
        )
