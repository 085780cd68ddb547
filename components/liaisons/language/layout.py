"""The variables of a component: names, units and descriptions, as DESIGN.md lays them down for every FMU."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from liaisons import units
from liaisons.language.declarations import (
    ActiveCoordinate,
    Coordinate,
    DeclaredFormula,
    InternalState,
    Orientation,
    Symbol,
    calculated,
    point,
)
from liaisons.language.variables import (
    ActiveInput,
    Causality,
    Dimension,
    State,
    Terminal,
    TerminalKind,
    TerminalMember,
    Variable,
)

# Names of connector members as in the Modelica Standard Library: position, rate, acceleration, force.
_TRANSLATION = ("s", "v", "a", "f")
_ROTATION = ("phi", "w", "a", "tau")


@dataclass(frozen=True)
class Layout:
    """All variables of a component, in the order of their value references, and which of them belong together."""

    parameters: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    states: tuple[State, ...]
    ports: tuple[Terminal, ...]
    active: tuple[ActiveInput, ...] = ()
    dimensions: tuple[Dimension, ...] = ()

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All of them: parameters, inputs, outputs."""
        return self.parameters + self.inputs + self.outputs


def start_of(q: Coordinate) -> Iterator[Variable]:
    """Initial value and rate of a coordinate."""
    position = replace(q.variable("parameter", "fixed", f"{q.name}_0"), description=f"{q.description}, at the start")
    yield replace(position, start=q.leading) if q.leading else position
    yield _start(f"{q.name}_dot", units.rate(q.unit), q.start_rate)


def start_of_turn(turn: Orientation) -> Iterator[Variable]:
    """Initial quaternion, and angular velocity or momentum."""
    yield from (_start(name, "1", float(name == turn.quaternion[0])) for name in turn.quaternion)
    yield from (_start(name, "rad/s" if turn.start == "rate" else "kg.m2/s", 0.0) for name in turn.start_names)


def triple(s: ActiveCoordinate) -> Iterator[Variable]:
    """σ, σ̇ and σ̈ of an active coordinate."""
    speed, together = units.rate(s.unit), "to be set with it, in model exchange too"
    yield s.variable("input", "continuous")
    yield _zero(f"{s.name}_dot", speed, f"rate of {s.name}, {together}")
    yield _zero(f"{s.name}_ddot", units.rate(speed), f"acceleration of {s.name}, {together}")


def forces_on(q: Coordinate) -> Iterator[Variable]:
    """Drive and load of a free coordinate."""
    unit, along = units.force(q.unit), f"along +{q.name}"
    yield _zero(f"{q.name}_force", unit, f"generalised force on this mechanism {along} (K eq. 14)")
    load = f"generalised force that this mechanism exerts {along} on what is attached to it"
    yield _zero(f"{q.name}_load", unit, load)


def load_at(name: str, place: point) -> Variable:
    """Load at a component of a named point."""
    text = f"force that this mechanism exerts along +{name} on what is attached there"
    return _zero(f"{name}_load", units.force(place.unit), text)


def of_coordinate(q: Coordinate) -> Iterator[Variable]:
    """The motion along a coordinate: q, q̇, q̈, p, ṗ."""
    speed, force = units.rate(q.unit), units.force(q.unit)
    yield readable(q.name, q.unit, q.description, symbol=q.symbol)
    yield readable(f"{q.name}_dot", speed, f"rate of {q.name}", derivative_of=q.name)
    yield readable(f"{q.name}_ddot", units.rate(speed), f"acceleration of {q.name}")
    yield readable(f"p_{q.name}", units.momentum(q.unit), f"momentum conjugate to {q.name}")
    yield _rate(f"p_{q.name}", force, f"rate of p_{q.name}: all generalised forces along {q.name}")


def of_turn(turn: Orientation) -> Iterator[Variable]:
    """The motion of an orientation: quaternion, angular velocity, angular momentum, and their rates."""
    for name in turn.quaternion:
        yield readable(name, "1", f"{turn.description}: quaternion, scalar first")
        yield _rate(name, "1/s", f"rate of {name}")
    for name in turn.rates:
        yield readable(name, "rad/s", f"{turn.description}: angular velocity in the body frame")
        yield readable(f"{name}_dot", "rad/s2", f"rate of {name}")
    for name in turn.momenta:
        yield readable(name, "kg.m2/s", f"{turn.description}: angular momentum in the inertial frame")
        yield _rate(name, "N.m", f"rate of {name}: torque")


def of_internal(state: InternalState) -> Iterator[Variable]:
    """An internal state and its rate."""
    yield readable(state.name, state.unit, state.description, symbol=state.symbol)
    yield _rate(state.name, units.rate(state.unit), f"rate of {state.name}")


def residual(item: DeclaredFormula) -> Variable:
    """What a constraint is not kept by."""
    return readable(f"{item.name}_residual", item.unit, f"what is not kept of: {item.description}")


def multiplier(item: DeclaredFormula, unit: str) -> Variable:
    """λ of a constraint."""
    return readable(f"lambda_{item.name}", unit, f"multiplier of: {item.description} (K eq. 7)")


def of_calculated(item: calculated) -> Variable:
    """A calculated parameter."""
    return Variable(item.name, item.unit, item.description, "calculatedParameter", "fixed")


def of_active(s: ActiveCoordinate) -> Iterator[Variable]:
    """Force and power of the operator, and whether what he prescribes agrees with itself."""
    text = f"generalised force of the operator on this mechanism along +{s.name} (M eq. 27)"
    yield readable(f"{s.name}_force", units.force(s.unit), text)
    yield readable(f"{s.name}_power", "W", f"power of the operator through {s.name} (M eq. 28)")
    text = (
        f"what {s.name} went in the last communication step beyond what {s.name}_dot and {s.name}_ddot say, where they "
        "contradict each other; else 0, as in model exchange and in hold mode"
    )
    yield Variable(f"{s.name}_mismatch", s.unit, text, "local", "discrete")


def of_point(name: str, place: point) -> Iterator[Variable]:
    """Position, rate and acceleration of a component of a named point."""
    speed = units.rate(place.unit)
    yield readable(name, place.unit, f"{name.rpartition('_')[2]} of {place.description}")
    yield readable(f"{name}_dot", speed, f"rate of {name}")
    yield readable(f"{name}_ddot", units.rate(speed), f"acceleration of {name}")


def of_energies() -> Iterator[Variable]:
    """Energies, powers and their integrals, which balance each other."""
    yield readable("kinetic_energy", "J", "kinetic energy T (K eq. 12)")
    yield readable("potential_energy", "J", "potential energy V")
    yield readable("energy", "J", "energy T + V (K eq. 61)")
    yield readable("work", "J", "work done on this mechanism through all its ports since the start")
    text = "energy lost by friction, or taken out by non-holonomic constraints, since the start"
    yield readable("dissipated", "J", text)
    text = "energy - energy at start - work + dissipated: 0 up to the integration error"
    yield readable("energy_balance", "J", text)
    yield readable("power", "W", "power through all ports", "local", derivative_of="work")
    loss = "power lost by friction, the rates times the gradient of the dissipation function (K eq. 67)"
    yield readable("dissipation", "W", loss, "local", derivative_of="dissipated")


def moving(names: Iterable[str]) -> tuple[State, ...]:
    """States with their derivatives, and the two integrals that close the energy balance."""
    motion = (State(name, f"{name}_dot") for name in names)
    return (*motion, State("work", "power"), State("dissipated", "dissipation"))


def port(name: str, unit: str, kind: TerminalKind) -> Terminal:
    """A connector: position, rate, acceleration, and force or load."""
    variables = (name, f"{name}_dot", f"{name}_ddot", f"{name}_{'force' if kind == 'active' else 'load'}")
    roles = _ROTATION if unit == "rad" else _TRANSLATION
    return Terminal(name, kind, tuple(TerminalMember(role, name) for role, name in zip(roles, variables, strict=True)))


def start_of_internal(state: Symbol) -> Variable:
    """Initial value of an internal state."""
    return state.variable("parameter", "fixed", f"{state.name}_0")


def readable(
    name: str,
    unit: str,
    text: str,
    causality: Causality = "output",
    *,
    derivative_of: str | None = None,
    symbol: str = "",
) -> Variable:
    """An output that changes continuously."""
    return Variable(name, unit, text, causality, "continuous", derivative_of=derivative_of, symbol=symbol)


def _rate(name: str, unit: str, text: str) -> Variable:
    return readable(f"{name}_dot", unit, text, "local", derivative_of=name)


def _start(name: str, unit: str, value: float) -> Variable:
    return Variable(f"{name}_0", unit, f"initial value of {name}", "parameter", "fixed", start=value)


def _zero(name: str, unit: str, text: str) -> Variable:
    return Variable(name, unit, text, "input", "continuous", start=0.0)
