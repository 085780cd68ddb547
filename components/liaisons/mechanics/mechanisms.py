"""From equations of motion to the Model that an FMU back end takes: vectors and functions."""

from __future__ import annotations

from functools import cache
from itertools import accumulate
from typing import Any

import casadi as ca

from liaisons.expressions.algebra import stack
from liaisons.language.layout import Layout
from liaisons.language.mechanism import Mechanism
from liaisons.mechanics.energy_accounting import definitions, function, memory_of
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.model import Model, described
from liaisons.mechanics.pictures import mechanism_picture
from liaisons.mechanics.printing import of_mechanism

CONSISTENT = 1e-6
"""Residual of a constraint, in its own unit, at which a start is refused."""


@cache
def mechanism_model(component: type[Mechanism]) -> Model:
    """Derive a mechanism and lay it out as variables and functions (DESIGN: names in an FMU).

    :param component: a subclass of Mechanism.
    """
    equations = derive(component)
    m = equations.mechanism
    layout = m.layout()
    symbols = {v.name: ca.SX.sym(v.name) for v in layout.parameters} | equations.symbols

    # The vectors of Model.
    t, work, dissipated = (ca.SX.sym(name) for name in ("t", "work", "dissipated"))
    y = ca.vertcat(m.free.q, m.free.p, m.internal, work, dissipated)
    u, k = (stack(symbols[v.name] for v in group) for group in (layout.inputs, layout.parameters))

    rates = ca.vertcat(equations.state_rates, equations.internal_rates, equations.power, equations.dissipation)
    # A jump of σ̇ through a rheonomic constraint changes the state.
    projection = equations.projection
    landed = ca.SX(0, 1) if projection is None else ca.vertcat(projection, m.internal, work, dissipated)
    lasting, at_start = _conditions(m), _start_conditions(equations)
    read = _readable(equations, layout, rates)
    z = stack(ca.SX(read.get(v.name, 0)) for v in layout.outputs)  # what is booked is filled in below
    distances, initial = stack((lasting | at_start).values()), ca.vertcat(*_initial(equations, symbols), 0, 0)
    # All in one: what the expressions share stays shared.
    columns = [initial, rates, equations.energy, z, _nominals(equations), distances, landed]
    together = ca.cse(equations.in_phase_space(ca.vertcat(*columns)))
    ends = [0, *accumulate(column.shape[0] for column in columns)]
    initial, rates, energy, z, sizes, distances, landed = ca.vertsplit(together, ends)
    booked = definitions(
        [t, y, u, k],
        layout,
        initial=initial,
        rates=rates,
        energy=energy,
        outputs=ca.vertsplit(z),
        nominals=sizes,
        landed=None if projection is None else landed,
    )
    functions: dict[str, Any] = {
        name: of and function(name.removesuffix("_function"), *of) for name, of in booked.items()
    }
    shown = mechanism_picture(m, read | symbols)
    return Model(
        **described(m),
        memory=memory_of(layout),
        **functions,
        conditions=function("conditions", [t, y, u, k], distances),
        condition_texts=(*lasting, *at_start),
        start_only=len(at_start),
        events=ca.Function("events", [k], [ca.SX(0, 1)]),
        equations=of_mechanism(equations),
        picture=shown.document,
        drawn=shown.variables,
        draw=function("draw", [t, y, u, k], stack(shown.expressions)) if shown.expressions else None,
    )


def _readable(equations: Equations, layout: Layout, rates: ca.SX) -> dict[str, ca.SX]:
    """What can be read, by name, but for what is booked."""
    m, kept = equations.mechanism, equations.constraints
    found = dict(zip((state.derivative for state in layout.states), ca.vertsplit(rates), strict=True)) | m.symbols
    passive = [item.name for item in (*m.constraints, *m.non_holonomic)]
    names = [*passive, *(item.name for item in m.rheonomic_constraints)]
    found |= {f"{name}_residual": kept.residuals[i] for i, name in enumerate(names)}
    found |= {f"lambda_{name}": equations.multipliers[i] for i, name in enumerate(passive)}
    for i, s in enumerate(m.actives):
        force = equations.operator_forces[i]
        found |= {f"{s.name}_force": force, f"{s.name}_power": force * m.active.s_dot[i]}
    for name, place in equations.points.items():
        velocity = m.dot(place)
        found |= {name: place, f"{name}_dot": velocity, f"{name}_ddot": m.dot(velocity)}
    found |= {name: getattr(equations, name) for name in ("kinetic_energy", "potential_energy", "energy")}
    return found | {item.name: getattr(m, item.name) for item in (*m.outputs, *m.calculated_parameters)}


def _initial(equations: Equations, symbols: dict[str, ca.SX]) -> list[ca.SX]:
    """Configuration, momenta p = ∂L/∂q̇ (or given), and internal states at the start."""
    m = equations.mechanism
    count = len(m.coordinates)
    names = [q.name for q in m.coordinates]
    rates = [f"{name}_dot" for name in names]
    p = m.free.frame @ equations.momenta
    unknown: list[ca.SX] = []  # rates of an orientation that starts from its momentum
    for turn in m.orientations:
        names += turn.quaternion
        if turn.start == "rate":
            rates += turn.rates
        else:
            unknown = ca.vertsplit(m.free.q_dot[count:])
            p = ca.vertcat(p[:count, 0], *(symbols[f"{name}_0"] for name in turn.momenta))
    q_0 = stack(symbols[f"{name}_0"] for name in names)
    v_0 = stack([*(symbols[f"{name}_0"] for name in rates), *unknown])
    p_0 = ca.substitute(p, ca.vertcat(m.free.q, m.free.q_dot), ca.vertcat(q_0, v_0))
    return [q_0, p_0, stack(symbols[f"{state.name}_0"] for state in m.internal_states)]


def _nominals(equations: Equations) -> ca.SX:
    """Sizes of the states: of q as declared, of p and of the energies what that size a second amounts to."""
    m = equations.mechanism
    count, turns, internal = len(m.coordinates), len(m.orientations), len(m.internal_states)
    sizes = ca.SX([*(q.nominal for q in m.coordinates), *([1.0] * 3 * turns)])
    inertia = ca.diag(equations.mass_matrix)
    energy = ca.dot(inertia, sizes**2) / 2
    positions = ca.vertcat(sizes[:count, 0], ca.SX.ones(4 * turns, 1))
    return ca.vertcat(positions, inertia * sizes, ca.SX.ones(internal, 1), energy, energy)


def _conditions(m: Mechanism) -> dict[str, ca.SX]:
    """What must stay positive, by the message to give when it does not."""
    found = {item.description: ca.SX(getattr(m, item.name)) for item in m.assertions}
    for q in m.coordinates:
        if q.minimum is not None:
            found[f"{q.name} must stay > {q.minimum:g} {q.unit}"] = m.symbols[q.name] - q.minimum
        if q.maximum is not None:
            found[f"{q.name} must stay < {q.maximum:g} {q.unit}"] = q.maximum - m.symbols[q.name]
    return found


def _start_conditions(equations: Equations) -> dict[str, ca.SX]:
    """The same, asked of the start alone: afterwards the state is put back onto its constraints."""
    found: dict[str, ca.SX] = {}
    m, kept = equations.mechanism, equations.constraints
    rates = ca.substitute(kept.rate_residuals, m.free.q_dot, equations.unconstrained_velocities)
    for i, item in enumerate((*m.constraints, *m.non_holonomic, *m.rheonomic_constraints)):
        text = f"{item.name} ({item.description}) must be kept to {CONSISTENT:g} {item.unit}"
        found[text] = CONSISTENT - ca.fabs(kept.residuals[i])
        if i not in kept.of_position:
            continue  # a constraint on rates has no other
        found[f"the rate of {text}/s"] = CONSISTENT - ca.fabs(rates[i])
    for turn in m.orientations:
        text = f"{', '.join(turn.quaternion)} must be a unit quaternion, to {CONSISTENT:g}"
        found[text] = CONSISTENT - ca.fabs(ca.norm_2(getattr(m, turn.name).quaternion) - 1)
    return found
