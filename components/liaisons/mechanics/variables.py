"""The variables of a mechanism, with the expressions that its equations give for them."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from liaisons import units
from liaisons.language.mechanism import Mechanism
from liaisons.language.names import (
    Row,
    derivative,
    forces_on,
    load_at,
    of_active,
    of_calculated,
    of_coordinate,
    of_energies,
    of_point,
    port,
    readable,
    triple,
)
from liaisons.language.variables import Port, Variable
from liaisons.mechanics.equations import Equations
from liaisons.mechanics.model import State


def inputs(component: type[Mechanism], equations: Equations) -> tuple[Variable, ...]:
    """σ, σ̇, σ̈ of the active coordinates; drives and loads of the free ones; loads at the named points."""
    return (
        *(variable for s in component.actives for variable in triple(s)),
        *(variable for q in component.coordinates for variable in forces_on(q)),
        *(load_at(name, unit) for name, unit in _point_units(component, equations)),
    )


def outputs(component: type[Mechanism], equations: Equations) -> list[Row]:
    """Everything that can be read; ``work``, ``dissipated``, ``energy_balance`` are filled in by the assembly."""
    return [
        *_of_coordinates(component, equations),
        *_of_orientations(component, equations),
        *_of_internal_states(component, equations),
        *_of_constraints(component, equations),
        *_of_actives(component, equations),
        *_of_points(component, equations),
        *of_energies(equations.kinetic_energy, equations.potential_energy, equations.power, equations.dissipation),
        *_declared(component, equations),
    ]


def states(component: type[Mechanism]) -> tuple[State, ...]:
    """Configuration, momenta, internal states, and the two integrals that close the energy balance."""
    positions = [q.name for q in component.coordinates]
    momenta = [f"p_{q.name}" for q in component.coordinates]
    for turn in component.orientations:
        positions, momenta = [*positions, *turn.quaternion], [*momenta, *turn.momenta]
    internal = [state.name for state in component.internal_states]
    return moving_states(*positions, *momenta, *internal)


def ports(component: type[Mechanism], equations: Equations) -> tuple[Port, ...]:
    """Each coordinate, and each component of a named point, as a connector."""
    return (
        *(port(q.name, q.unit, "free") for q in component.coordinates),
        *(port(s.name, s.unit, "active") for s in component.actives),
        *(port(name, unit, "point") for name, unit in _point_units(component, equations)),
    )


def moving_states(*names: str) -> tuple[State, ...]:
    """States with their derivatives, and the two integrals that close the energy balance."""
    motion = [State(name, f"{name}_dot") for name in names]
    return (*motion, State("work", "power"), State("dissipated", "dissipation"))


# ---- one kind of variable after the other -------------------------------------------------------------------------


def _of_coordinates(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    free = equations.mechanism.free
    p_dot = equations.state_rates[free.q.shape[0] :]
    columns = (free.q, free.q_dot, free.q_ddot, free.p, p_dot)
    for i, q in enumerate(component.coordinates):
        yield from of_coordinate(q, *(column[i] for column in columns))


def _of_orientations(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    free, first = equations.mechanism.free, len(component.coordinates)
    for turn in component.orientations:
        q_dot, p_dot = ca.vertsplit(equations.state_rates, [0, free.q.shape[0], free.q.shape[0] + free.p.shape[0]])
        for i, name in enumerate(turn.quaternion, first):
            yield readable(name, "1", f"{turn.description}: quaternion, scalar first", free.q[i])
            yield derivative(f"{name}_dot", "1/s", f"rate of {name}", q_dot[i], name)
        for i, name in enumerate(turn.rates, first):
            yield readable(name, "rad/s", f"{turn.description}: angular velocity in the body frame", free.q_dot[i])
            yield readable(f"{name}_dot", "rad/s2", f"rate of {name}", free.q_ddot[i])
        for i, name in enumerate(turn.momenta, first):
            yield readable(name, "kg.m2/s", f"{turn.description}: angular momentum in the inertial frame", free.p[i])
            yield derivative(f"{name}_dot", "N.m", f"rate of {name}: torque", p_dot[i], name)


def _of_internal_states(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    for i, state in enumerate(component.internal_states):
        symbol = equations.mechanism.internal[i]
        yield readable(state.name, state.unit, state.description, symbol, state.symbol)
        rate = equations.internal_rates[i]
        yield derivative(f"{state.name}_dot", units.rate(state.unit), f"rate of {state.name}", rate, state.name)


def _of_constraints(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    passive = (*component.constraints, *component.non_holonomic)
    for i, item in enumerate((*passive, *component.submersions)):
        residual = equations.constraints.residuals[i]
        yield readable(f"{item.name}_residual", item.unit, f"what is not kept of: {item.description}", residual)
    for i, item in enumerate(passive):
        unit = units.force(item.unit) if item in component.constraints else units.multiplier(item.unit)
        text = f"multiplier of: {item.description} (K eq. 7)"
        yield readable(f"lambda_{item.name}", unit, text, equations.multipliers[i])


def _of_actives(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    rates = equations.mechanism.active.s_dot
    for i, s in enumerate(component.actives):
        yield from of_active(s, equations.operator_forces[i], rates[i])


def _of_points(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    dot, places = equations.mechanism.dot, {point.name: point for point in component.points}
    for name, position in equations.points.items():
        yield from of_point(name, places[name.rpartition("_")[0]], position, velocity := dot(position), dot(velocity))


def _declared(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    m = equations.mechanism
    for item in component.outputs:
        yield readable(item.name, item.unit, item.description, getattr(m, item.name))
    for item in component.calculated_parameters:
        yield of_calculated(item, getattr(m, item.name))


def _point_units(component: type[Mechanism], equations: Equations) -> list[tuple[str, str]]:
    unit = {point.name: point.unit for point in component.points}
    return [(name, unit[name.rpartition("_")[0]]) for name in equations.points]
