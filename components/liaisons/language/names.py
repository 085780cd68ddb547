"""Names, units and descriptions of a component's variables, as DESIGN.md lays them down for every FMU."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, TypeAlias

import casadi as ca

from liaisons import units
from liaisons.language.component import Component
from liaisons.language.declarations import ActiveCoordinate, Calculated, Coordinate, Point
from liaisons.language.mechanism import Mechanism
from liaisons.language.variables import Dimension, Port, PortKind, PortMember, Variable

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
        readable(q.name, q.unit, q.description, values[0], q.symbol),
        derivative(f"{q.name}_dot", speed, f"rate of {q.name}", values[1], q.name, local=False),
        readable(f"{q.name}_ddot", units.rate(speed), f"acceleration of {q.name}", values[2]),
        readable(f"p_{q.name}", units.momentum(q.unit), f"momentum conjugate to {q.name}", values[3]),
        derivative(
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
    yield readable(f"{s.name}_force", units.force(s.unit), text, force)
    yield readable(f"{s.name}_power", "W", f"power of the operator through {s.name} (M eq. 28)", force * rate)
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
        variable, expression = readable(f"{name}{end}", unit_of, text, value)
        yield _sized(variable, dimension), expression


def of_energies(kinetic: Expression, potential: Expression, power: Expression, dissipation: Expression) -> list[Row]:
    """Energies and powers; ``work``, ``dissipated``, ``energy_balance`` are filled in by the assembly."""
    filled_in = ca.DM(0)
    loss = "power lost by friction, the rates times the gradient of the dissipation function (K eq. 67)"
    return [
        readable("kinetic_energy", "J", "kinetic energy T (K eq. 12)", kinetic),
        readable("potential_energy", "J", "potential energy V", potential),
        readable("energy", "J", "energy T + V (K eq. 61)", kinetic + potential),
        readable("work", "J", "work done on this mechanism through all its ports since the start", filled_in),
        readable(
            "dissipated",
            "J",
            "energy lost by friction, or taken out by non-holonomic constraints, since the start",
            filled_in,
        ),
        readable(
            "energy_balance",
            "J",
            "energy - energy at start - work + dissipated: 0 up to the integration error",
            filled_in,
        ),
        derivative("power", "W", "power through all ports", power, "work"),
        derivative("dissipation", "W", loss, dissipation, "dissipated"),
    ]


def of_calculated(item: Calculated, value: Expression) -> Row:
    """A calculated parameter."""
    return Variable(item.name, item.unit, item.description, "calculatedParameter", "fixed"), value


def port(name: str, unit: str, kind: PortKind) -> Port:
    """A connector: position, rate, acceleration, and force or load."""
    variables = (name, f"{name}_dot", f"{name}_ddot", f"{name}_{'force' if kind == 'active' else 'load'}")
    roles = _ROTATION if unit == "rad" else _TRANSLATION
    return Port(name, kind, tuple(PortMember(role, name) for role, name in zip(roles, variables, strict=True)))


def readable(name: str, unit: str, text: str, expression: Expression, symbol: str = "") -> Row:
    """An output that changes continuously."""
    return Variable(name, unit, text, "output", "continuous", symbol=symbol), expression


def derivative(name: str, unit: str, text: str, expression: Expression, of: str, *, local: bool = True) -> Row:
    """The rate of another variable."""
    causality = "local" if local else "output"
    return Variable(name, unit, text, causality, "continuous", derivative_of=of), expression


def _start(name: str, unit: str, value: float) -> Variable:
    return Variable(f"{name}_0", unit, f"initial value of {name}", "parameter", "fixed", start=value)


def _zero(name: str, unit: str, text: str) -> Variable:
    return Variable(name, unit, text, "input", "continuous", start=0.0)


def _sized(variable: Variable, dimension: Dimension | None) -> Variable:
    return variable if dimension is None else replace(variable, dimension=dimension)
