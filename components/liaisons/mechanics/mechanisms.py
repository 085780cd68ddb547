"""Model of a mechanism: its equations of motion as vectors and functions."""

from __future__ import annotations

from functools import cache
from itertools import accumulate

import casadi as ca

from liaisons.base.array_names import suffixed
from liaisons.expressions.algebra import stack
from liaisons.language.layout import Layout
from liaisons.language.mechanism import Mechanism
from liaisons.mechanics.energy_accounting import definitions, memory_of
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.functions import model_functions
from liaisons.mechanics.model import Model, described
from liaisons.mechanics.output_variables import mechanical_outputs
from liaisons.mechanics.pictures import mechanism_picture
from liaisons.mechanics.printing import of_mechanism
from liaisons.mechanics.unilateral import contact_expressions, contacts_of, relaxed_layout, with_modes

CONSISTENT = 1e-6
"""Residual of a constraint, in its own unit, from which on a start is refused."""


@cache
def mechanism_model(component: type[Mechanism]) -> Model:
    """Model of a mechanism, derived and laid out as variables and functions; names: docs/reference/fmu.md.

    :param component: a subclass of Mechanism.
    """
    equations = derive(component)
    m = equations.mechanism
    contacts, layout = contacts_of(m), m.layout()
    if contacts:
        layout = relaxed_layout(m, layout)
    flat = layout.flat()
    symbols = {v.name: ca.SX.sym(v.name) for v in flat.parameters} | equations.symbols
    symbols |= {c.variable("multiplier"): m.contact_force(c.name) for c in contacts}

    # The vectors of Model.
    t, work, dissipated = (ca.SX.sym(name) for name in ("t", "work", "dissipated"))
    y = ca.vertcat(m.free.q, m.free.p, m.internal, work, dissipated)
    u, k = (stack(symbols[v.name] for v in group) for group in (flat.inputs, flat.parameters))
    memory = memory_of(flat)
    vectors = {"t": t, "y": y, "u": u, "k": k, "m": ca.SX.sym("m", len(memory))}

    rates = ca.vertcat(equations.state_rates, equations.internal_rates, equations.power, equations.dissipation)
    # A jump of σ̇ through a rheonomic constraint changes the state.
    projection = equations.projection
    landed = ca.SX(0, 1) if projection is None else ca.vertcat(projection, m.internal, work, dissipated)
    lasting, at_start = _conditions(m), _start_conditions(equations)
    read = _outputs(equations, flat, rates)
    z = stack(ca.SX(read.get(v.name, 0)) for v in flat.outputs)  # 0: the energy balance, filled in below
    distances, initial = stack((lasting | at_start).values()), ca.vertcat(*_initial(equations, symbols), 0, 0)
    # All in one: what the expressions share stays shared.
    columns = [initial, rates, equations.energy, z, _nominals(equations), distances, landed]
    together = ca.cse(equations.in_phase_space(ca.vertcat(*columns)))
    ends = [0, *accumulate(column.shape[0] for column in columns)]
    initial, rates, energy, z, sizes, distances, landed = ca.vertsplit(together, ends)
    shown = mechanism_picture(m, read | symbols)
    results = definitions(
        vectors,
        flat,
        initial=initial,
        rates=rates,
        energy=energy,
        outputs=ca.vertsplit(z),
        nominals=sizes,
        landed=None if projection is None else landed,
    )
    results |= {"conditions": distances, "events": ca.SX(0, 1)}
    results["draw"] = stack(shown.expressions) if shown.expressions else None
    model = Model(
        **(described(m) | vars(layout)),
        memory=memory,
        **model_functions(vectors, results),
        condition_texts=(*lasting, *at_start),
        start_only=len(at_start),
        equations=of_mechanism(equations),
        picture=shown.document,
        drawn=shown.variables,
        contacts=contacts,
    )
    return with_modes(model) if contacts else model


def _outputs(equations: Equations, layout: Layout, rates: ca.SX) -> dict[str, ca.SX]:
    """Expressions by the names of variables, without those of the energy balance."""
    m, residuals = equations.mechanism, equations.constraints.residuals
    forces = ((equations.operator_forces[i], m.active.s_dot[i]) for i in range(len(m.actives)))
    points = {name: (r, m.dot(r), m.dot(m.dot(r))) for name, r in equations.points.items()}
    energies = equations.kinetic_energy, equations.potential_energy
    passive = [item.name for item in (*m.constraints, *m.non_holonomic)]
    names = [*passive, *(item.name for item in m.rheonomic_constraints)]
    outputs = mechanical_outputs(m, layout, rates, forces=forces, points=points, energies=energies)
    outputs |= {f"{name}_residual": residuals[i] for i, name in enumerate(names)}
    outputs |= contact_expressions(m)
    return outputs | {f"lambda_{name}": equations.multipliers[i] for i, name in enumerate(passive)}


def _initial(equations: Equations, symbols: dict[str, ca.SX]) -> list[ca.SX]:
    """Configuration, momenta p = ∂L/∂q̇ (or as set) and internal states at the start."""
    m = equations.mechanism
    count = len(m.coordinates)
    names = [q.name for q in m.coordinates]
    rates = [suffixed(name, "_dot") for name in names]
    p = m.free.frame @ equations.momenta
    unknown: list[ca.SX] = []  # rates of an orientation that starts from its momentum
    for orientation in m.orientations:
        names += orientation.quaternion
        if orientation.start == "rate":
            rates += orientation.rates
        else:
            unknown = ca.vertsplit(m.free.q_dot[count:])
            p = ca.vertcat(p[:count, 0], *(symbols[f"{name}_0"] for name in orientation.momenta))
    q_0 = stack(symbols[suffixed(name, "_0")] for name in names)
    v_0 = stack([*(symbols[suffixed(name, "_0")] for name in rates), *unknown])
    p_0 = ca.substitute(p, ca.vertcat(m.free.q, m.free.q_dot), ca.vertcat(q_0, v_0))
    return [q_0, p_0, stack(symbols[f"{state.name}_0"] for state in m.internal_states)]


def _nominals(equations: Equations) -> ca.SX:
    """Nominal values of the states: of q as declared, of p and of the energies at that rate a second."""
    m = equations.mechanism
    count, orientations, internal = len(m.coordinates), len(m.orientations), len(m.internal_states)
    sizes = ca.SX([*(q.nominal for q in m.coordinates), *([1.0] * 3 * orientations)])
    inertia = ca.diag(equations.mass_matrix)
    energy = ca.dot(inertia, sizes**2) / 2 if inertia.shape[0] else ca.SX(1)  # all coordinates may be prescribed
    positions = ca.vertcat(sizes[:count, 0], ca.SX.ones(4 * orientations, 1))
    return ca.vertcat(positions, inertia * sizes, ca.SX.ones(internal, 1), energy, energy)


def _conditions(m: Mechanism) -> dict[str, ca.SX]:
    """Expressions that must stay positive, by the message for a violation."""
    conditions = {item.description: ca.SX(getattr(m, item.name)) for item in m.assertions}
    for q in m.coordinates:
        if q.minimum is not None:
            conditions[f"{q.name} must stay > {q.minimum:g} {q.unit}"] = m.symbols[q.name] - q.minimum
        if q.maximum is not None:
            conditions[f"{q.name} must stay < {q.maximum:g} {q.unit}"] = q.maximum - m.symbols[q.name]
    return conditions


def _start_conditions(equations: Equations) -> dict[str, ca.SX]:
    """Same for the start alone: consistency with the constraints, onto which later states are projected."""
    conditions: dict[str, ca.SX] = {}
    m, constraints = equations.mechanism, equations.constraints
    rates = ca.substitute(constraints.rate_residuals, m.free.q_dot, equations.unconstrained_velocities)
    for i, item in enumerate((*m.constraints, *m.non_holonomic, *m.rheonomic_constraints)):
        text = f"{item.name} ({item.description}) must be kept to {CONSISTENT:g} {item.unit}"
        conditions[text] = CONSISTENT - ca.fabs(constraints.residuals[i])
        if i in constraints.holonomic:
            conditions[f"the rate of {text}/s"] = CONSISTENT - ca.fabs(rates[i])
    for orientation in m.orientations:
        text = f"{', '.join(orientation.quaternion)} must be a unit quaternion, to {CONSISTENT:g}"
        conditions[text] = CONSISTENT - ca.fabs(ca.norm_2(getattr(m, orientation.name).quaternion) - 1)
    return conditions
