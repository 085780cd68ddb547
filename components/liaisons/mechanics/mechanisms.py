"""Model of a mechanism: its equations of motion as vectors and functions."""

from collections.abc import Iterable, Mapping
from functools import cache
from itertools import accumulate
from typing import Any

import casadi as ca
import numpy as np

from liaisons.algebra import closure, stack
from liaisons.base.array_names import suffixed_name
from liaisons.language import Layout, Mechanism
from liaisons.mechanics.constraints import KEPT, ROUNDS
from liaisons.mechanics.contacts import contact_functions, contact_method
from liaisons.mechanics.dynamics import method_of
from liaisons.mechanics.energy_accounting import memory_names, with_energy_accounting
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.legendre import CHOSEN, FULL
from liaisons.mechanics.model import Equation, Model, Reach, declared_fields, domain_conditions
from liaisons.mechanics.output_variables import contact_outputs, mechanical_outputs
from liaisons.mechanics.pictures import Drawing, mechanism_picture
from liaisons.mechanics.printing import mechanism_equations

CONSISTENT = 1e-6
"""Residual of a constraint, in its own unit, above which a start is refused."""

_STATES = 3
"""Number of states at which redundant constraints are looked for."""
_NEARBY = 0.01
"""Distance of these states from the start, in nominal values."""
_RANK = 1e-6
"""Singular values below this are 0, where rows of the constraints' matrix are of order 1."""


@cache
def mechanism_model(component: type[Mechanism]) -> Model:
    """Model of a mechanism, derived and laid out as variables and functions; names: docs/reference/fmu.md.

    :param component: a subclass of Mechanism.
    """
    equations = derive(component)
    m = equations.mechanism
    method, flat = contact_method(m.contact_formulas), m.layout().flat()
    symbols = {v.name: ca.SX.sym(v.name) for v in (*flat.parameters, *flat.inputs)} | equations.symbols
    vectors = _vectors(m, flat, symbols)
    lasting, at_start = _conditions(equations), _start_conditions(equations)
    contact_numbers = method.numbers(m) if method else {}
    read = _output_expressions(equations, flat, contact_numbers)
    reaches, reach = _reaches(equations)
    expressions = {
        **_initial_state(equations, symbols),
        "rates": equations.model_rates,
        "energy": equations.energy,
        "outputs": stack(ca.SX(read.get(v.name, 0)) for v in flat.outputs),  # 0: the energy balance, filled in below
        "nominals": _nominal_states(equations),
        "conditions": stack((lasting | at_start).values()),
        "landed": _landed(equations, vectors["y"]),
        "reach": reach,
        "independence": equations.independence,
    }
    columns = _as_functions_of_the_state(equations, expressions | contact_numbers)
    drawing = mechanism_picture(m, read | symbols)
    functions = contact_functions(
        method.contacts(m) if method else (),
        vectors=vectors,
        forced=_results(vectors, flat, columns, drawing),
        numbers={name: columns[name] for name in contact_numbers},
        layout=flat,
        memory=memory_names(flat),
        condition_texts=(*lasting, *at_start),
    )
    return Model(
        **declared_fields(m),
        **_with_redundancy(equations, vectors, flat, functions, columns["independence"], reaches=reaches),
        start_only=len(at_start),
        configuration=tuple(m.motion_names("quaternion")),
        equations=_printed(equations),
        picture=drawing.document,
        drawn=drawing.variables,
    )


def _vectors(m: Mechanism, layout: Layout, symbols: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
    """Vectors of the model's functions by letter: time, states, inputs, parameters, memory, contact forces."""
    y = ca.vertcat(m.free.q, m.free.p, m.internal, ca.SX.sym("work"), ca.SX.sym("dissipated"))
    u, k = (stack(symbols[v.name] for v in group) for group in (layout.inputs, layout.parameters))
    memory = ca.SX.sym("m", len(memory_names(layout)))
    return {"t": ca.SX.sym("t"), "y": y, "u": u, "k": k, "m": memory, "x": m.contact_forces}


def _landed(equations: Equations, y: ca.SX) -> ca.SX:
    """State after a jump of σ̇, which through a rheonomic constraint changes it; (0,) where it does not."""
    projection = equations.projection
    return ca.SX(0, 1) if projection is None else ca.vertcat(projection, y[projection.shape[0] :])


def _as_functions_of_the_state(equations: Equations, columns: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
    """Columns with the state in place of rates, all in one, so that what the expressions share stays shared."""
    together = ca.cse(equations.in_phase_space(ca.vertcat(*columns.values())))
    ends = [0, *accumulate(column.shape[0] for column in columns.values())]
    return dict(zip(columns, ca.vertsplit(together, ends), strict=True))


def _results(
    vectors: Mapping[str, ca.SX], layout: Layout, columns: Mapping[str, ca.SX], drawing: Drawing
) -> dict[str, Any]:
    """Results of the model's functions, with the energy accounted for; None for one that is not needed."""
    results = with_energy_accounting(
        vectors,
        layout,
        initial=columns["start"],
        rates=columns["rates"],
        energy=columns["energy"],
        outputs=ca.vertsplit(columns["outputs"]),
        nominals=columns["nominals"],
        landed=_unless_empty(columns["landed"]),
        energy_at_start=_unless_empty(columns["energy_at_start"]),
    )
    results |= {"conditions": columns["conditions"], "events": ca.SX(0, 1), "reach": _unless_empty(columns["reach"])}
    return results | {"draw": stack(drawing.expressions) if drawing.expressions else None}


def _unless_empty(column: ca.SX) -> ca.SX | None:
    """A column, or None if it has no rows."""
    return column if column.shape[0] else None


def _with_redundancy(
    equations: Equations,
    vectors: Mapping[str, ca.SX],
    layout: Layout,
    functions: Mapping[str, Any],
    independence: ca.SX,
    *,
    reaches: tuple[Reach, ...],
) -> dict[str, Any]:
    """Functions of the model, its constraints, and how many of these follow from the others: arguments of Model.

    :param independence: of each constraint from the others (c,).
    """
    starts = [[variable.start for variable in group] for group in (layout.inputs, layout.parameters)]
    point = [vectors[letter] for letter in "tyuk"]
    redundant = _count_redundant(equations, point, functions, starts)
    margin = _least(ca.vertsplit(independence), redundant)
    return {
        **functions,
        **({"reach": _loosened(functions["reach"], len(reaches))} if redundant else {}),
        "reaches": reaches,
        "redundant": redundant,
        "margin": None if margin.is_constant() else ca.Function("margin", point, [margin]),
    }


def _printed(equations: Equations) -> tuple[Equation, ...]:
    """Equations for the documentation, by the method of the mechanism if it has its own."""
    method = method_of(equations.mechanism)
    own = method.printed(equations) if method else None
    return mechanism_equations(equations) if own is None else own


def _least(values: Iterable[ca.SX], more: int) -> ca.SX:
    """The least of some values but for so many that are less; 1 if there are no others."""
    least = [ca.SX(1)] * (more + 1)
    for value in values:
        for i, other in enumerate(least):
            least[i], value = ca.fmin(other, value), ca.fmax(other, value)  # noqa: PLW2901 - it is handed on
    return least[-1]


def _loosened(reach: ca.Function, count: int) -> ca.Function:
    """Function ``reach`` that allows redundant constraints to contradict each other by what a start may."""
    arguments = reach.sx_in()
    (column,) = reach.call(arguments, True, False)
    return ca.Function("reach", arguments, [ca.vertcat(column[:count] * (KEPT / (3 * CONSISTENT)), column[count:])])


def _count_redundant(
    equations: Equations, point: list[ca.SX], functions: Mapping[str, ca.Function], starts: list[list[Any]]
) -> int:
    """Count of constraints that follow from the others wherever all of them hold, by their rank near the start.

    :param point: symbols (t, y, u, k).
    :param starts: of u and k.
    """
    constraints, sizes = equations.constraints, equations.mechanism.free.rate_sizes
    count = constraints.matrix.shape[0]
    if count < 2:
        return 0
    scaled = ca.diag(1 / ca.sqrt(constraints.squares @ sizes**2)) @ constraints.matrix @ ca.diag(sizes)
    both = [ca.densify(equations.in_phase_space(x)) for x in (scaled, constraints.residuals)]
    kept = ca.Function("kept", point, both)
    start, moved = np.array(functions["start"](0, *starts)[0]), np.random.default_rng(0)
    ranks = []
    for _ in range(_STATES):
        y = start + _NEARBY * np.array(functions["nominals"](0, start, *starts)) * moved.uniform(-1, 1, start.shape)
        for _ in range(ROUNDS):
            y = functions["project"](0, y, *starts)
        rows, residuals = map(np.array, kept(0, y, *starts))
        if np.abs(residuals).max() < CONSISTENT:
            ranks.append(np.linalg.matrix_rank(rows, _RANK))
    return count - max(ranks, default=count)


def _output_expressions(equations: Equations, layout: Layout, numbers: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
    """Expressions of the output variables by name, without those of the energy balance."""
    m, residuals = equations.mechanism, equations.constraints.residuals
    forces = equations.operator_forces, m.active.s_dot
    points = {name: (r, m.dot(r), m.dot(m.dot(r))) for name, r in equations.applied.points.items()}
    energies = equations.kinetic_energy, equations.potential_energy
    outputs = mechanical_outputs(m, layout, equations.model_rates, forces=forces, points=points, energies=energies)
    outputs |= contact_outputs(m, numbers["gap"], numbers["v"]) if numbers else {}
    outputs |= {f"{item.name}_residual": residuals[i] for i, item in enumerate(m.all_constraints)}
    return outputs | {f"lambda_{c.name}": equations.multipliers[i] for i, c in enumerate(m.passive_constraints)}


def _initial_state(equations: Equations, symbols: dict[str, ca.SX]) -> dict[str, ca.SX]:
    """Column of the states at the start, ``start``; and the energy there, ``energy_at_start``, (1,) or (0,) for not.

    Momenta are ∂L/∂q̇, or as set for an orientation; the energy is that of a linkage without constraints.
    """
    m, count = equations.mechanism, len(equations.mechanism.coordinates)

    def start(column: ca.SX) -> ca.SX:
        return stack(symbols.get(suffixed_name(str(x), "_0"), x) for x in ca.vertsplit(column))

    p = m.free.frame @ equations.momenta
    rows = [p[:count, 0]]
    for orientation, i in zip(m.orientations, range(count, p.shape[0], 3), strict=True):
        rows.append(start(m.free.p[i : i + 3, 0]) if orientation.start == "momentum" else p[i : i + 3, 0])
    # The energy at the same rates takes no inversion of the momenta, unless constraints change the rates.
    short = method_of(m) is not None and not equations.constraints.matrix.shape[0]
    both = ca.vertcat(*rows, equations.energy if short else ca.SX(0, 1))
    motion = ca.vertcat(m.free.q, m.free.q_dot)
    p_0, energy = ca.vertsplit(ca.substitute(both, motion, start(motion)), [0, p.shape[0], both.shape[0]])
    state = ca.vertcat(m.free.q, m.free.p, equations.given_rates)
    at_start = ca.vertcat(start(m.free.q), p_0, _given_rates(m, symbols))
    momenta = ca.substitute(equations.start_momenta, state, at_start)
    return {"start": ca.vertcat(start(m.free.q), momenta, start(m.internal), 0, 0), "energy_at_start": energy}


def _given_rates(m: Mechanism, symbols: dict[str, ca.SX]) -> ca.SX:
    """Column with 1 for each rate whose start value is not as declared, else 0; those of an orientation together."""
    declared = {v.name: v.start for v in m.layout().flat().parameters}

    def changed(column: ca.SX) -> list[ca.SX]:
        names = [suffixed_name(str(x), "_0") for x in ca.vertsplit(column)]
        return [symbols[name] != declared[name] for name in names]

    count, rates, momenta = len(m.coordinates), m.free.q_dot, m.free.p
    given = changed(rates[:count, 0])
    for orientation, i in zip(m.orientations, range(count, rates.shape[0], 3), strict=True):
        column = momenta if orientation.start == "momentum" else rates
        given += 3 * [ca.mmax(ca.vertcat(*changed(column[i : i + 3, 0])))]
    return ca.vertcat(*given)


def _nominal_states(equations: Equations) -> ca.SX:
    """Nominal values of the states: of q as declared, of p and energies at rates of one nominal q per second."""
    free, internal = equations.mechanism.free, equations.mechanism.internal
    sizes, inertia = free.rate_sizes, ca.diag(equations.mass_matrix)
    energy = ca.dot(inertia, sizes**2) / 2 if inertia.shape[0] else ca.SX(1)  # all coordinates may be prescribed
    return ca.vertcat(free.sizes, inertia * sizes, ca.SX.ones(internal.shape), energy, energy)


def _conditions(equations: Equations) -> dict[str, ca.SX]:
    """Expressions that must stay > 0, by the message for a violation."""
    m = equations.mechanism
    conditions = {item.description: m.expression_of(item) for item in m.assertions}
    for q in m.coordinates:
        conditions |= domain_conditions(q, m.symbols[q.name])
    convergence = equations.dynamics.convergence
    for rate, p, distance in zip(*map(ca.vertsplit, (m.free.q_dot, m.free.p, convergence)), strict=False):
        conditions[f"{rate} must follow from {p} by Newton's method, in its {CHOSEN + FULL} steps"] = distance
    return conditions


def _reaches(equations: Equations) -> tuple[tuple[Reach, ...], ca.SX]:
    """Constraints with the prescribed coordinates they depend on, and the result ``r`` of the function ``reach``."""
    m, residuals = equations.mechanism, equations.residuals_by_rounding
    ends, active = equations.constraints.residuals, m.active
    moves = np.array(ca.DM(ca.jacobian_sparsity(ends, active.s) + ca.jacobian_sparsity(ends, active.s_dot), 1)) != 0
    holds = np.array(ca.DM(equations.constraints.matrix.sparsity(), 1)) != 0
    coupled = holds.astype(int) @ holds.T > 0  # by a coordinate that both hold
    reaches, values = [], list[ca.SX]()
    for i, item in enumerate(m.all_constraints):
        together = closure(coupled, np.arange(len(coupled)) == i)
        moving = np.flatnonzero(moves[together].any(axis=0)).tolist()
        reaches.append(Reach(f"{item.name} ({item.description})", tuple(str(active.s[k]) for k in moving)))
        values += [active.s[k] for k in moving]
    return tuple(reaches), ca.vertcat(residuals, *values)


def _start_conditions(equations: Equations) -> dict[str, ca.SX]:
    """Expressions that must be > 0 at the start alone, for consistency with constraints, by message."""
    conditions: dict[str, ca.SX] = {}
    m, constraints = equations.mechanism, equations.constraints
    rates = ca.substitute(constraints.rate_residuals, m.free.q_dot, equations.dynamics.velocities)
    for i, item in enumerate(m.all_constraints):
        text = f"{item.name} ({item.description}) must be kept to {CONSISTENT:g} {item.unit}"
        conditions[text] = CONSISTENT - ca.fabs(constraints.residuals[i])
        if i in constraints.holonomic:
            conditions[f"the rate of {text}/s"] = CONSISTENT - ca.fabs(rates[i])
    for orientation in m.orientations:
        text = f"{', '.join(orientation.quaternion)} must be a unit quaternion, to {CONSISTENT:g}"
        conditions[text] = CONSISTENT - ca.fabs(ca.norm_2(getattr(m, orientation.name).quaternion) - 1)
    return conditions
