"""Names, units and descriptions of a mechanism's variables, as DESIGN.md lays them down for every FMU."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

import casadi as ca

from liaisons import units
from liaisons.mechanics.declarations import ActiveCoordinate, Calculated, Coordinate, Point
from liaisons.mechanics.model import Dimension, Port, PortKind, PortMember, State, Variable

if TYPE_CHECKING:
    from liaisons.mechanics.component import Component
    from liaisons.mechanics.equations import Equations
    from liaisons.mechanics.mechanism import Mechanism

# Names of connector members as in the Modelica Standard Library: position, rate, acceleration, force.
_TRANSLATION = ("s", "v", "a", "f")
_ROTATION = ("phi", "w", "a", "tau")

Expression: TypeAlias = Any  # SX of a mechanism, MX of a chain
Row = tuple[Variable, Expression]
"""A variable that can be read, and the expression for it."""


def parameters(component: type[Mechanism]) -> tuple[Variable, ...]:
    """Declared parameters, then the start values of coordinates, orientations and internal states."""
    declared = declared_parameters(component)
    for q in component.coordinates:
        declared += start_of(q)
    for turn in component.orientations:
        unit = "rad/s" if turn.start == "rate" else "kg.m2/s"
        declared += [_start(name, "1", float(name == turn.quaternion[0])) for name in turn.quaternion]
        declared += [_start(name, unit, 0.0) for name in turn.start_names]
    declared += [state.variable("parameter", "fixed", f"{state.name}_0") for state in component.internal_states]
    return tuple(declared)


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
    return moving(*positions, *momenta, *internal)


def ports(component: type[Mechanism], equations: Equations) -> tuple[Port, ...]:
    """Each coordinate, and each component of a named point, as a connector."""
    return (
        *(port(q.name, q.unit, "free") for q in component.coordinates),
        *(port(s.name, s.unit, "active") for s in component.actives),
        *(port(name, unit, "point") for name, unit in _point_units(component, equations)),
    )


# ---- what belongs to one declaration; of arrays with a dimension --------------------------------------------------


def declared_parameters(component: type[Component]) -> list[Variable]:
    """The declared parameters."""
    return [p.variable("parameter", "tunable" if p.tunable else "fixed") for p in component.parameters]


def start_of(q: Coordinate, dimension: Dimension | None = None) -> list[Variable]:
    """Initial value and rate of a coordinate."""
    position = replace(q.variable("parameter", "fixed", f"{q.name}_0"), description=f"{q.description}, at the start")
    if q.leading:
        position = replace(position, start=q.leading)
    rate = _start(f"{q.name}_dot", units.rate(q.unit), q.start_rate)
    return [_sized(variable, dimension) for variable in (position, rate)]


def triple(s: ActiveCoordinate) -> list[Variable]:
    """σ, σ̇ and σ̈ of an active coordinate."""
    speed, together = units.rate(s.unit), "to be set with it, in model exchange too"
    return [
        s.variable("input", "continuous"),
        _zero(f"{s.name}_dot", speed, f"rate of {s.name}, {together}"),
        _zero(f"{s.name}_ddot", units.rate(speed), f"acceleration of {s.name}, {together}"),
    ]


def forces_on(q: Coordinate, dimension: Dimension | None = None) -> list[Variable]:
    """Drive and load of a free coordinate."""
    unit = units.force(q.unit)
    drive = f"generalised force on this mechanism along +{q.name} (K eq. 14)"
    load = f"generalised force that this mechanism exerts along +{q.name} on what is attached to it"
    both = (_zero(f"{q.name}_force", unit, drive), _zero(f"{q.name}_load", unit, load))
    return [_sized(variable, dimension) for variable in both]


def load_at(name: str, unit: str, dimension: Dimension | None = None) -> Variable:
    """Load at a component of a named point."""
    text = f"force that this mechanism exerts along +{name} on what is attached there"
    return _sized(_zero(f"{name}_load", units.force(unit), text), dimension)


def of_coordinate(q: Coordinate, *values: Expression, dimension: Dimension | None = None) -> Iterator[Row]:
    """The motion along a coordinate: q, q̇, q̈, p, ṗ."""
    speed = units.rate(q.unit)
    rows = (
        _output(q.name, q.unit, q.description, values[0], q.symbol),
        _derivative(f"{q.name}_dot", speed, f"rate of {q.name}", values[1], q.name, local=False),
        _output(f"{q.name}_ddot", units.rate(speed), f"acceleration of {q.name}", values[2]),
        _output(f"p_{q.name}", units.momentum(q.unit), f"momentum conjugate to {q.name}", values[3]),
        _derivative(
            f"p_{q.name}_dot",
            units.force(q.unit),
            f"rate of p_{q.name}: all generalised forces along {q.name}",
            values[4],
            f"p_{q.name}",
        ),
    )
    for variable, expression in rows:
        yield _sized(variable, dimension), expression


def of_active(s: ActiveCoordinate, force: Expression, rate: Expression) -> Iterator[Row]:
    """Force and power of the operator, and whether what he prescribes agrees with itself."""
    text = f"generalised force of the operator on this mechanism along +{s.name} (M eq. 27)"
    yield _output(f"{s.name}_force", units.force(s.unit), text, force)
    yield _output(f"{s.name}_power", "W", f"power of the operator through {s.name} (M eq. 28)", force * rate)
    text = (
        f"what {s.name} went in the last communication step beyond what {s.name}_dot and {s.name}_ddot say, where they "
        "contradict each other; else 0, as in model exchange and in hold mode"
    )
    yield Variable(f"{s.name}_mismatch", s.unit, text, "local", "discrete"), ca.DM(0)


def mismatches(actives: Iterable[ActiveCoordinate]) -> list[str]:
    """Names of the variables of :func:`of_active` that an FMU fills in."""
    return [f"{s.name}_mismatch" for s in actives]


def of_point(name: str, place: Point, *values: Expression, dimension: Dimension | None = None) -> Iterator[Row]:
    """Position, rate and acceleration of a component of a named point."""
    speed, axis = units.rate(place.unit), name.rpartition("_")[2]
    texts = (f"{axis} of {place.description}", f"rate of {name}", f"acceleration of {name}")
    kinds = (("", place.unit), ("_dot", speed), ("_ddot", units.rate(speed)))
    for (end, unit_of), text, value in zip(kinds, texts, values, strict=True):
        variable, expression = _output(f"{name}{end}", unit_of, text, value)
        yield _sized(variable, dimension), expression


def of_energies(kinetic: Expression, potential: Expression, power: Expression, dissipation: Expression) -> list[Row]:
    """Energies and powers; ``work``, ``dissipated``, ``energy_balance`` are filled in by the assembly."""
    filled_in = ca.DM(0)
    loss = "power lost by friction, the rates times the gradient of the dissipation function (K eq. 67)"
    return [
        _output("kinetic_energy", "J", "kinetic energy T (K eq. 12)", kinetic),
        _output("potential_energy", "J", "potential energy V", potential),
        _output("energy", "J", "energy T + V (K eq. 61)", kinetic + potential),
        _output("work", "J", "work done on this mechanism through all its ports since the start", filled_in),
        _output(
            "dissipated",
            "J",
            "energy lost by friction, or taken out by non-holonomic constraints, since the start",
            filled_in,
        ),
        _output(
            "energy_balance",
            "J",
            "energy - energy at start - work + dissipated: 0 up to the integration error",
            filled_in,
        ),
        _derivative("power", "W", "power through all ports", power, "work"),
        _derivative("dissipation", "W", loss, dissipation, "dissipated"),
    ]


def of_calculated(item: Calculated, value: Expression) -> Row:
    """A calculated parameter."""
    return Variable(item.name, item.unit, item.description, "calculatedParameter", "fixed"), value


def moving(*names: str) -> tuple[State, ...]:
    """States with their derivatives, and the two integrals that close the energy balance."""
    motion = [State(name, f"{name}_dot") for name in names]
    return (*motion, State("work", "power"), State("dissipated", "dissipation"))


def port(name: str, unit: str, kind: PortKind) -> Port:
    """A connector: position, rate, acceleration, and force or load."""
    variables = (name, f"{name}_dot", f"{name}_ddot", f"{name}_{'force' if kind == 'active' else 'load'}")
    roles = _ROTATION if unit == "rad" else _TRANSLATION
    return Port(name, kind, tuple(PortMember(role, name) for role, name in zip(roles, variables, strict=True)))


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
            yield _output(name, "1", f"{turn.description}: quaternion, scalar first", free.q[i])
            yield _derivative(f"{name}_dot", "1/s", f"rate of {name}", q_dot[i], name)
        for i, name in enumerate(turn.rates, first):
            yield _output(name, "rad/s", f"{turn.description}: angular velocity in the body frame", free.q_dot[i])
            yield _output(f"{name}_dot", "rad/s2", f"rate of {name}", free.q_ddot[i])
        for i, name in enumerate(turn.momenta, first):
            yield _output(name, "kg.m2/s", f"{turn.description}: angular momentum in the inertial frame", free.p[i])
            yield _derivative(f"{name}_dot", "N.m", f"rate of {name}: torque", p_dot[i], name)


def _of_internal_states(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    for i, state in enumerate(component.internal_states):
        symbol = equations.mechanism.internal[i]
        yield _output(state.name, state.unit, state.description, symbol, state.symbol)
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
        yield from of_active(s, equations.operator_forces[i], rates[i])


def _of_points(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    dot, places = equations.mechanism.dot, {point.name: point for point in component.points}
    for name, position in equations.points.items():
        yield from of_point(name, places[name.rpartition("_")[0]], position, velocity := dot(position), dot(velocity))


def _declared(component: type[Mechanism], equations: Equations) -> Iterator[Row]:
    m = equations.mechanism
    for item in component.outputs:
        yield _output(item.name, item.unit, item.description, getattr(m, item.name))
    for item in component.calculated_parameters:
        yield of_calculated(item, getattr(m, item.name))


def _output(name: str, unit: str, text: str, expression: Expression, symbol: str = "") -> Row:
    return Variable(name, unit, text, "output", "continuous", symbol=symbol), expression


def _derivative(name: str, unit: str, text: str, expression: Expression, of: str, *, local: bool = True) -> Row:
    causality = "local" if local else "output"
    return Variable(name, unit, text, causality, "continuous", derivative_of=of), expression


def _start(name: str, unit: str, value: float) -> Variable:
    return Variable(f"{name}_0", unit, f"initial value of {name}", "parameter", "fixed", start=value)


def _zero(name: str, unit: str, text: str) -> Variable:
    return Variable(name, unit, text, "input", "continuous", start=0.0)


def _sized(variable: Variable, dimension: Dimension | None) -> Variable:
    return variable if dimension is None else replace(variable, dimension=dimension)


def _point_units(component: type[Mechanism], equations: Equations) -> list[tuple[str, str]]:
    unit = {point.name: point.unit for point in component.points}
    return [(name, unit[name.rpartition("_")[0]]) for name in equations.points]
