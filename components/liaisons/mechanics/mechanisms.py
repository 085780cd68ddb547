"""From equations of motion to the Model that an FMU back end takes: vectors and functions."""

from __future__ import annotations

import inspect
from functools import cache
from itertools import pairwise

import casadi as ca

from liaisons.expressions.algebra import stack
from liaisons.language import names
from liaisons.language.mechanism import Mechanism
from liaisons.mechanics import variables
from liaisons.mechanics.bookkeeping import MEMORY, Vectors, function, functions
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.model import ActiveInput, Model
from liaisons.mechanics.printing import checked_against, of_mechanism

CONSISTENT = 1e-6
"""Residual of a constraint, in its own unit, at which a start is refused."""


@cache
def mechanism_model(component: type[Mechanism]) -> Model:
    """Derive a mechanism and lay it out as variables and functions (DESIGN: names in an FMU).

    :param component: a subclass of Mechanism.
    """
    equations = derive(component)
    m = equations.mechanism
    parameters, inputs = names.parameters(component), variables.inputs(component, equations)
    outputs = variables.outputs(component, equations)
    symbols = {variable.name: ca.SX.sym(variable.name) for variable in parameters} | equations.symbols

    # The vectors of Model.
    t, work, dissipated = (ca.SX.sym(name) for name in ("t", "work", "dissipated"))
    motion = ca.vertcat(m.free.q, m.free.p)
    y = ca.vertcat(motion, m.internal, work, dissipated)
    u = stack(symbols[variable.name] for variable in inputs)
    k = stack(symbols[variable.name] for variable in parameters)

    rates = ca.vertcat(equations.state_rates, equations.internal_rates, equations.power, equations.dissipation)
    # A jump of σ̇ through a submersion changes the state.
    projection = equations.projection
    landed = None if projection is None else ca.vertcat(projection, m.internal, work, dissipated)
    lasting, at_start = _conditions(component, equations), _start_conditions(component, equations)
    conditions = lasting | at_start
    mismatches = names.mismatches(component.actives)
    initial = ca.vertcat(*_initial(component, equations, symbols), 0, 0)
    sizes, distances = _nominals(component, equations), stack(conditions.values())
    z = stack(ca.SX(expression) for _, expression in outputs)
    # All in one: what the expressions share stays shared.
    columns = [initial, rates, equations.energy, z, sizes, distances, ca.SX(0, 1) if landed is None else landed]
    initial, rates, energy, z, sizes, distances, landed = _in_phase_space(equations, columns)

    return Model(
        name=component.__name__,
        module=component.__module__,
        description=component.summary(),
        documentation=inspect.getdoc(component) or component.__name__,
        parameters=parameters,
        inputs=inputs,
        outputs=tuple(variable for variable, _ in outputs),
        states=variables.states(component),
        memory=(*MEMORY, *mismatches),
        **functions(
            Vectors(t, y, u, k),
            initial=initial,
            rates=rates,
            energy=energy,
            outputs=[(variable, z[i]) for i, (variable, _) in enumerate(outputs)],
            nominals=sizes,
            landed=None if projection is None else landed,
            mismatches=mismatches,
        ),
        conditions=function("conditions", [t, y, u, k], distances),
        condition_texts=tuple(conditions),
        start_only=len(at_start),
        events=ca.Function("events", [k], [ca.SX(0, 1)]),
        active=tuple(ActiveInput(s.name, f"{s.name}_dot", f"{s.name}_ddot") for s in component.actives),
        ports=variables.ports(component, equations),
        experiment=component.experiment,
        equations=of_mechanism(equations),
        closed_form=checked_against(component),
    )


def _in_phase_space(equations: Equations, columns: list[ca.SX]) -> list[ca.SX]:
    ends = [0]
    for column in columns:
        ends.append(ends[-1] + column.shape[0])
    together = ca.cse(equations.in_phase_space(ca.vertcat(*columns)))
    return [together[start:end] for start, end in pairwise(ends)]


def _initial(component: type[Mechanism], equations: Equations, symbols: dict[str, ca.SX]) -> list[ca.SX]:
    """Configuration, momenta p = ∂L/∂q̇ (or given), and internal states at the start."""
    m, count = equations.mechanism, len(component.coordinates)
    names = [q.name for q in component.coordinates]
    rates = [f"{name}_dot" for name in names]
    p = m.free.frame @ equations.momenta
    unknown: list[ca.SX] = []  # rates of an orientation that starts from its momentum
    for turn in component.orientations:
        names += turn.quaternion
        if turn.start == "rate":
            rates += turn.rates
        else:
            unknown = ca.vertsplit(m.free.q_dot[count:])
            p = ca.vertcat(p[:count, 0], *(symbols[f"{name}_0"] for name in turn.momenta))
    q_0 = stack(symbols[f"{name}_0"] for name in names)
    v_0 = stack([*(symbols[f"{name}_0"] for name in rates), *unknown])
    p_0 = ca.substitute(p, ca.vertcat(m.free.q, m.free.q_dot), ca.vertcat(q_0, v_0))
    return [q_0, p_0, stack(symbols[f"{state.name}_0"] for state in component.internal_states)]


def _nominals(component: type[Mechanism], equations: Equations) -> ca.SX:
    """Sizes of the states: of q as declared, of p and of the energies what that size a second amounts to."""
    count, turns, internal = len(component.coordinates), len(component.orientations), len(component.internal_states)
    sizes = ca.SX([*(q.nominal for q in component.coordinates), *([1.0] * 3 * turns)])
    inertia = ca.diag(equations.mass_matrix)
    energy = ca.dot(inertia, sizes**2) / 2
    positions = ca.vertcat(sizes[:count, 0], ca.SX.ones(4 * turns, 1))
    return ca.vertcat(positions, inertia * sizes, ca.SX.ones(internal, 1), energy, energy)


def _conditions(component: type[Mechanism], equations: Equations) -> dict[str, ca.SX]:
    """What must stay positive, by the message to give when it does not."""
    m = equations.mechanism
    found = {condition.description: ca.SX(getattr(m, condition.name)) for condition in component.conditions}
    for q in component.coordinates:
        if q.minimum is not None:
            found[f"{q.name} must stay > {q.minimum:g} {q.unit}"] = m.symbols[q.name] - q.minimum
        if q.maximum is not None:
            found[f"{q.name} must stay < {q.maximum:g} {q.unit}"] = q.maximum - m.symbols[q.name]
    return found


def _start_conditions(component: type[Mechanism], equations: Equations) -> dict[str, ca.SX]:
    """The same, asked of the start alone: afterwards the state is put back onto its constraints."""
    found: dict[str, ca.SX] = {}
    kept, q_dot = equations.constraints, equations.mechanism.free.q_dot
    rates = ca.substitute(kept.rate_residuals, q_dot, equations.loose_velocities)
    for i, item in enumerate((*component.constraints, *component.non_holonomic, *component.submersions)):
        text = f"{item.name} ({item.description}) must be kept to {CONSISTENT:g} {item.unit}"
        found[text] = CONSISTENT - ca.fabs(kept.residuals[i])
        if i not in kept.of_position:
            continue  # a constraint on rates has no other
        found[f"the rate of {text}/s"] = CONSISTENT - ca.fabs(rates[i])
    for turn in component.orientations:
        text = f"{', '.join(turn.quaternion)} must be a unit quaternion, to {CONSISTENT:g}"
        found[text] = CONSISTENT - ca.fabs(ca.norm_2(getattr(equations.mechanism, turn.name).quaternion) - 1)
    return found
