"""Names, units and descriptions of a mechanism's variables, as DESIGN.md lays them down for every FMU."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import casadi as ca

from liaisons import units
from liaisons.mechanics.model import Port, PortKind, PortMember, State, Variable

if TYPE_CHECKING:
    from liaisons.mechanics.equations import Equations
    from liaisons.mechanics.mechanism import Mechanism

# Names of connector members as in the Modelica Standard Library: position, rate, acceleration, force.
_TRANSLATION = ("s", "v", "a", "f")
_ROTATION = ("phi", "w", "a", "tau")

Row = tuple[Variable, ca.SX]
"""A variable that can be read, and the expression for it."""


def parameters(component: type[Mechanism]) -> tuple[Variable, ...]:
    """Declared parameters, then the start values of coordinates, orientations and internal states."""
    declared = [p.variable("parameter", "tunable" if p.tunable else "fixed") for p in component.parameters]
    for q in component.coordinates:
        declared.append(q.variable("parameter", "fixed", f"{q.name}_0"))
        declared.append(_start(f"{q.name}_dot", units.rate(q.unit), q.start_rate))
    for turn in component.orientations:
        unit = "rad/s" if turn.start == "rate" else "kg.m2/s"
        declared += [_start(name, "1", float(name == turn.quaternion[0])) for name in turn.quaternion]
        declared += [_start(name, unit, 0.0) for name in turn.start_names]
    declared += [state.variable("parameter", "fixed", f"{state.name}_0") for state in component.internal_states]
    return tuple(declared)


def inputs(component: type[Mechanism], equations: Equations) -> tuple[Variable, ...]:
    """σ, σ̇, σ̈ of the active coordinates; drives and loads of the free ones; loads at the named points."""
    found: list[Variable] = []
    for s in component.actives:
        speed = units.rate(s.unit)
        found.append(s.variable("input", "continuous"))
        found.append(_zero(f"{s.name}_dot", speed, f"rate of {s.name}"))
        found.append(_zero(f"{s.name}_ddot", units.rate(speed), f"acceleration of {s.name}"))
    for q in component.coordinates:
        unit = units.force(q.unit)
        found.append(_zero(f"{q.name}_force", unit, f"generalised force on this mechanism along +{q.name} (K eq. 14)"))
        text = f"generalised force that this mechanism exerts along +{q.name} on what is attached to it"
        found.append(_zero(f"{q.name}_load", unit, text))
    for name, unit in _point_units(component, equations):
        text = f"force that this mechanism exerts along +{name} on what is attached there"
        found.append(_zero(f"{name}_load", units.force(unit), text))
    return tuple(found)


def outputs(component: type[Mechanism], equations: Equations) -> list[Row]:
    """Everything that can be read; ``work``, ``dissipated``, ``energy_balance`` are filled in by the assembly."""
    return [
        *_of_coordinates(component, equations),
        *_of_orientations(component, equations),
        *_of_internal_states(component, equations),
        *_of_constraints(component, equations),
        *_of_actives(component, equations),
        *_of_points(component, equations),
        *_of_energies(equations),
        *_declared(component, equations),
    ]


def states(component: type[Mechanism]) -> tuple[State, ...]:
    """Configuration, momenta, internal states, and the two integrals that close the energy balance."""
    positions = [q.name for q in component.coordinates]
    momenta = [f"p_{q.name}" for q in component.coordinates]
    for turn in component.orientations:
        positions, momenta = [*positions, *turn.quaternion], [*momenta, *turn.momenta]
    internal = [state.name for state in component.internal_states]
    moving = [State(name, f"{name}_dot") for name in (*positions, *momenta, *internal)]
    return (*moving, State("work", "power"), State("dissipated", "dissipation"))


def ports(component: type[Mechanism], equations: Equations) -> tuple[Port, ...]:
    """Each coordinate, and each component of a named point, as a connector."""

    def port(name: str, unit: str, kind: PortKind, force: str) -> Port:
        variables = (name, f"{name}_dot", f"{name}_ddot", f"{name}_{force}")
        roles = _ROTATION if unit == "rad" else _TRANSLATION
        return Port(name, kind, tuple(PortMember(role, name) for role, name in zip(roles, variables, strict=True)))

    free = [port(q.name, q.unit, "free", "load") for q in component.coordinates]
    active = [port(s.name, s.unit, "active", "force") for s in component.actives]
    points = [port(name, unit, "point", "load") for name, unit in _point_units(component, equations)]
    return (*free, *active, *points)


# ---- one kind of variable after the other -------------------------------------------------------------------------


def _of_coordinates(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    free = equations.mechanism.free
    for i, q in enumerate(component.coordinates):
        speed = units.rate(q.unit)
        yield _output(q.name, q.unit, q.description, free.q[i])
        yield _derivative(f"{q.name}_dot", speed, f"rate of {q.name}", free.q_dot[i], q.name, local=False)
        yield _output(f"{q.name}_ddot", units.rate(speed), f"acceleration of {q.name}", free.q_ddot[i])
        yield _output(f"p_{q.name}", units.momentum(q.unit), f"momentum conjugate to {q.name}", free.p[i])
        text = f"rate of p_{q.name}: all generalised forces along {q.name}"
        rate = equations.momentum_rates[i]
        yield _derivative(f"p_{q.name}_dot", units.force(q.unit), text, rate, f"p_{q.name}")


def _of_orientations(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    free, first = equations.mechanism.free, len(component.coordinates)
    for turn in component.orientations:
        turning = free.kinematics @ free.q_dot
        for i, name in enumerate(turn.quaternion, first):
            yield _output(name, "1", f"{turn.description}: quaternion, scalar first", free.q[i])
            yield _derivative(f"{name}_dot", "1/s", f"rate of {name}", turning[i], name)
        for i, name in enumerate(turn.rates, first):
            yield _output(name, "rad/s", f"{turn.description}: angular velocity in the body frame", free.q_dot[i])
            yield _output(f"{name}_dot", "rad/s2", f"rate of {name}", free.q_ddot[i])
        for i, name in enumerate(turn.momenta, first):
            yield _output(name, "kg.m2/s", f"{turn.description}: angular momentum in the inertial frame", free.p[i])
            yield _derivative(f"{name}_dot", "N.m", f"rate of {name}: torque", equations.momentum_rates[i], name)


def _of_internal_states(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    for i, state in enumerate(component.internal_states):
        yield _output(state.name, state.unit, state.description, equations.mechanism.internal[i])
        rate = equations.internal_rates[i]
        yield _derivative(f"{state.name}_dot", units.rate(state.unit), f"rate of {state.name}", rate, state.name)


def _of_constraints(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    passive = (*component.constraints, *component.non_holonomic)
    for i, item in enumerate((*passive, *component.submersions)):
        residual = equations.constraints.residuals[i]
        yield _output(f"{item.name}_residual", item.unit, f"what is not kept of: {item.description}", residual)
    for i, item in enumerate(passive):
        unit = units.force(item.unit) if item in component.constraints else units.multiplier(item.unit)
        text = f"multiplier of: {item.description} (K eq. 7)"
        yield _output(f"lambda_{item.name}", unit, text, equations.multipliers[i])


def _of_actives(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    rates = equations.mechanism.active.s_dot
    for i, s in enumerate(component.actives):
        text = f"generalised force of the operator on this mechanism along +{s.name} (M eq. 27)"
        yield _output(f"{s.name}_force", units.force(s.unit), text, equations.operator_forces[i])
        text = f"power of the operator through {s.name} (M eq. 28)"
        yield _output(f"{s.name}_power", "W", text, equations.operator_forces[i] * rates[i])


def _of_points(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    dot = equations.mechanism.dot
    for (name, unit), position in zip(_point_units(component, equations), equations.points.values(), strict=True):
        speed, velocity = units.rate(unit), dot(position)
        yield _output(name, unit, f"component of a point: {name}", position)
        yield _output(f"{name}_dot", speed, f"rate of {name}", velocity)
        yield _output(f"{name}_ddot", units.rate(speed), f"acceleration of {name}", dot(velocity))


def _of_energies(equations: Equations) -> Iterator[Row]:
    filled_in = ca.SX(0)
    yield _output("kinetic_energy", "J", "kinetic energy T (K eq. 12)", equations.kinetic_energy)
    yield _output("potential_energy", "J", "potential energy V", equations.potential_energy)
    yield _output("energy", "J", "energy T + V (K eq. 61)", equations.energy)
    yield _output("work", "J", "work done on this mechanism through all its ports since the start", filled_in)
    yield _output("dissipated", "J", "energy lost by friction since the start", filled_in)
    text = "energy - energy at start - work + dissipated: 0 up to the integration error"
    yield _output("energy_balance", "J", text, filled_in)
    yield _derivative("power", "W", "power through all ports", equations.power, "work")
    text = "power lost by friction, twice the friction coefficient times T (K eq. 67)"
    yield _derivative("dissipation", "W", text, equations.dissipation, "dissipated")


def _declared(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    m = equations.mechanism
    for item in component.outputs:
        yield _output(item.name, item.unit, item.description, getattr(m, item.name))
    for item in component.calculated_parameters:
        variable = Variable(item.name, item.unit, item.description, "calculatedParameter", "fixed")
        yield variable, ca.SX(getattr(m, item.name))


def _output(name: str, unit: str, text: str, expression: ca.SX) -> Row:
    return Variable(name, unit, text, "output", "continuous"), ca.SX(expression)


def _derivative(name: str, unit: str, text: str, expression: ca.SX, of: str, *, local: bool = True) -> Row:
    causality = "local" if local else "output"
    return Variable(name, unit, text, causality, "continuous", derivative_of=of), ca.SX(expression)


def _start(name: str, unit: str, value: float) -> Variable:
    return Variable(f"{name}_0", unit, f"initial value of {name}", "parameter", "fixed", start=value)


def _zero(name: str, unit: str, text: str) -> Variable:
    return Variable(name, unit, text, "input", "continuous", start=0.0)


def _point_units(component: type[Mechanism], equations: Equations) -> list[tuple[str, str]]:
    unit = {point.name: point.unit for point in component.points}
    return [(name, unit[name.rpartition("_")[0]]) for name in equations.points]
