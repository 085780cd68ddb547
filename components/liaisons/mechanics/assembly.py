"""From equations of motion to the Model that an FMU back end takes: names, units, vectors, functions."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING

import casadi as ca

from liaisons import units
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.model import ActiveInput, Model, Port, PortKind, PortMember, State, Variable

if TYPE_CHECKING:
    from liaisons.mechanics.mechanism import Mechanism

# Names of connector members as in the Modelica Standard Library: position, rate, acceleration, force.
_TRANSLATION = ("s", "v", "a", "f")
_ROTATION = ("phi", "w", "a", "tau")
_START = ("_0", "_dot_0")


@cache
def assemble(component: type[Mechanism]) -> Model:
    """Derive a mechanism and lay it out as variables and functions (DESIGN: names in an FMU).

    :param component: a subclass of Mechanism.
    """
    equations = derive(component)
    m = equations.mechanism
    parameters, inputs, outputs = _parameters(component), _inputs(component, equations), _outputs(component, equations)
    symbols = equations.symbols | {f"{q.name}{end}": ca.SX.sym(q.name + end) for q in m.coordinates for end in _START}

    # The vectors of Model.
    work, dissipated = ca.SX.sym("work"), ca.SX.sym("dissipated")
    energy_start, energy_booked = ca.SX.sym("energy_start"), ca.SX.sym("energy_booked")
    t = ca.SX.sym("t")
    y = ca.vertcat(m.free.q, m.free.p, work, dissipated)
    u = _column(symbols[variable.name] for variable in inputs)
    k = _column(symbols[variable.name] for variable in parameters)
    memory = ca.vertcat(energy_start, energy_booked)

    # State at the start: p = ∂L/∂q̇ there.
    q_0, q_dot_0 = (_column(symbols[q.name + end] for q in m.coordinates) for end in _START)
    p_0 = ca.substitute(equations.momenta, ca.vertcat(m.free.q, m.free.q_dot), ca.vertcat(q_0, q_dot_0))
    initial = ca.vertcat(q_0, p_0, 0, 0)

    # Motion, with the two integrals that close the energy balance.
    rates = ca.vertcat(m.free.q_dot, equations.momentum_rates, equations.power, equations.dissipation)

    # When an operator makes σ̇ jump, p stays and the energy jumps with it: that much work came in as an impulse.
    energy = equations.in_phase_space(equations.energy)
    energy_at_start = ca.substitute(energy, y, initial)
    impulse = energy - energy_booked
    integrals = {
        "work": work + impulse,
        "dissipated": dissipated,
        "energy_balance": energy - energy_start - (work + impulse) + dissipated,
    }
    z = [integrals.get(variable.name, expression) for variable, expression in outputs]
    conditions = _conditions(component, m)

    def function(name: str, arguments: list[ca.SX], *results: ca.SX) -> ca.Function:
        in_state = [ca.densify(equations.in_phase_space(result)) for result in results]
        return ca.Function(name, arguments, ca.cse(in_state))

    return Model(
        name=component.__name__,
        description=component.summary(),
        documentation=inspect.getdoc(component) or component.__name__,
        parameters=parameters,
        inputs=inputs,
        outputs=tuple(variable for variable, _ in outputs),
        states=_states(component),
        memory=("energy_start", "energy_booked"),
        start=function("start", [t, u, k], initial, ca.vertcat(energy_at_start, energy_at_start)),
        derivatives=function("derivatives", [t, y, u, k], rates),
        outputs_function=function("outputs", [t, y, u, k, memory], ca.vertcat(*z)),
        jump=function("jump", [t, y, u, k, memory], ca.vertcat(m.free.q, m.free.p, work + impulse, dissipated)),
        remember=function("remember", [t, y, u, k, memory], ca.vertcat(energy_start, energy)),
        nominals=function("nominals", [t, y, u, k], _nominals(component, equations)),
        conditions=function("conditions", [t, y, u, k], _column(conditions.values())),
        condition_texts=tuple(conditions),
        events=ca.Function("events", [k], [ca.SX(0, 1)]),
        active=tuple(ActiveInput(s.name, f"{s.name}_dot", f"{s.name}_ddot") for s in component.actives),
        ports=_ports(component, equations),
        experiment=component.experiment,
        equations=_printed(equations),
    )


def _parameters(component: type[Mechanism]) -> tuple[Variable, ...]:
    declared = [p.variable("parameter", "tunable" if p.tunable else "fixed") for p in component.parameters]
    for q in component.coordinates:
        declared.append(q.variable("parameter", "fixed", f"{q.name}_0"))
        text = f"initial rate of {q.name}"
        declared.append(Variable(f"{q.name}_dot_0", units.rate(q.unit), text, "parameter", "fixed", q.start_rate))
    return tuple(declared)


def _inputs(component: type[Mechanism], equations: Equations) -> tuple[Variable, ...]:
    def zero(name: str, unit: str, text: str) -> Variable:
        return Variable(name, unit, text, "input", "continuous", start=0.0)

    found: list[Variable] = []
    for s in component.actives:
        speed = units.rate(s.unit)
        found.append(s.variable("input", "continuous"))
        found.append(zero(f"{s.name}_dot", speed, f"rate of {s.name}"))
        found.append(zero(f"{s.name}_ddot", units.rate(speed), f"acceleration of {s.name}"))
    for q in component.coordinates:
        unit = units.force(q.unit)
        found.append(zero(f"{q.name}_force", unit, f"generalised force on this mechanism along +{q.name} (K eq. 14)"))
        text = f"generalised force that this mechanism exerts along +{q.name} on what is attached to it"
        found.append(zero(f"{q.name}_load", unit, text))
    for name, unit in _point_units(component, equations):
        text = f"force that this mechanism exerts along +{name} on what is attached there"
        found.append(zero(f"{name}_load", units.force(unit), text))
    return tuple(found)


def _outputs(component: type[Mechanism], equations: Equations) -> list[tuple[Variable, ca.SX]]:
    """Readable variables with their expressions; the integrals work and dissipated stand for themselves."""
    m = equations.mechanism
    found: list[tuple[Variable, ca.SX]] = []

    def add(
        name: str,
        unit: str,
        text: str,
        expression: ca.SX | float,
        *,
        local: bool = False,
        calculated: bool = False,
        derivative_of: str | None = None,
    ) -> None:
        causality = "calculatedParameter" if calculated else "local" if local else "output"
        variability = "fixed" if calculated else "continuous"
        variable = Variable(name, unit, text, causality, variability, derivative_of=derivative_of)
        found.append((variable, ca.SX(expression)))

    for i, q in enumerate(component.coordinates):
        speed, momentum = units.rate(q.unit), units.momentum(q.unit)
        add(q.name, q.unit, q.description, m.free.q[i])
        add(f"{q.name}_dot", speed, f"rate of {q.name}", m.free.q_dot[i], derivative_of=q.name)
        add(f"{q.name}_ddot", units.rate(speed), f"acceleration of {q.name}", m.free.q_ddot[i])
        add(f"p_{q.name}", momentum, f"momentum conjugate to {q.name}", m.free.p[i])
        text = f"rate of p_{q.name}: all generalised forces along {q.name}"
        rate = equations.momentum_rates[i]
        add(f"p_{q.name}_dot", units.force(q.unit), text, rate, local=True, derivative_of=f"p_{q.name}")
    for i, s in enumerate(component.actives):
        text = f"generalised force of the operator on this mechanism along +{s.name} (M eq. 27)"
        add(f"{s.name}_force", units.force(s.unit), text, equations.operator_forces[i])
        text = f"power of the operator through {s.name} (M eq. 28)"
        add(f"{s.name}_power", "W", text, equations.operator_forces[i] * m.active.s_dot[i])
    for (name, unit), expression in zip(_point_units(component, equations), equations.points.values(), strict=True):
        speed, velocity = units.rate(unit), m.dot(expression)
        add(name, unit, f"component of a point: {name}", expression)
        add(f"{name}_dot", speed, f"rate of {name}", velocity)
        add(f"{name}_ddot", units.rate(speed), f"acceleration of {name}", m.dot(velocity))
    add("kinetic_energy", "J", "kinetic energy T (K eq. 12)", equations.kinetic_energy)
    add("potential_energy", "J", "potential energy V", equations.potential_energy)
    add("energy", "J", "energy T + V (K eq. 61)", equations.energy)
    add("work", "J", "work done on this mechanism through all its ports since the start", 0)
    add("dissipated", "J", "energy lost by friction since the start", 0)
    add("energy_balance", "J", "energy - energy at start - work + dissipated: 0 up to the integration error", 0)
    add("power", "W", "power through all ports", equations.power, local=True, derivative_of="work")
    text = "power lost by friction, twice the friction coefficient times T (K eq. 67)"
    add("dissipation", "W", text, equations.dissipation, local=True, derivative_of="dissipated")
    for item in component.outputs:
        add(item.name, item.unit, item.description, getattr(m, item.name))
    for item in component.calculated_parameters:
        add(item.name, item.unit, item.description, getattr(m, item.name), calculated=True)
    return found


def _states(component: type[Mechanism]) -> tuple[State, ...]:
    coordinates = [State(q.name, f"{q.name}_dot") for q in component.coordinates]
    momenta = [State(f"p_{q.name}", f"p_{q.name}_dot") for q in component.coordinates]
    return (*coordinates, *momenta, State("work", "power"), State("dissipated", "dissipation"))


def _nominals(component: type[Mechanism], equations: Equations) -> ca.SX:
    """Sizes of the states: of q as declared, of p and of the energies what that size a second amounts to."""
    sizes = ca.SX([q.nominal for q in component.coordinates])
    inertia = ca.diag(equations.mass_matrix)
    energy = ca.dot(inertia, sizes**2) / 2
    return ca.vertcat(sizes, inertia * sizes, energy, energy)


def _conditions(component: type[Mechanism], m: Mechanism) -> dict[str, ca.SX]:
    """What must stay positive, by the message to give when it does not."""
    found = {condition.description: ca.SX(getattr(m, condition.name)) for condition in component.conditions}
    for q in component.coordinates:
        if q.minimum is not None:
            found[f"{q.name} must stay > {q.minimum:g} {q.unit}"] = m.symbols[q.name] - q.minimum
        if q.maximum is not None:
            found[f"{q.name} must stay < {q.maximum:g} {q.unit}"] = q.maximum - m.symbols[q.name]
    return found


def _ports(component: type[Mechanism], equations: Equations) -> tuple[Port, ...]:
    def port(name: str, unit: str, kind: PortKind, force: str) -> Port:
        variables = (name, f"{name}_dot", f"{name}_ddot", f"{name}_{force}")
        roles = _ROTATION if unit == "rad" else _TRANSLATION
        return Port(name, kind, tuple(PortMember(role, name) for role, name in zip(roles, variables, strict=True)))

    free = [port(q.name, q.unit, "free", "load") for q in component.coordinates]
    active = [port(s.name, s.unit, "active", "force") for s in component.actives]
    points = [port(name, unit, "point", "load") for name, unit in _point_units(component, equations)]
    return (*free, *active, *points)


def _point_units(component: type[Mechanism], equations: Equations) -> list[tuple[str, str]]:
    unit = {point.name: point.unit for point in component.points}
    return [(name, unit[name.rpartition("_")[0]]) for name in equations.points]


def _printed(equations: Equations) -> dict[str, str]:
    """The equations in CasADi's notation, for the documentation inside the FMU."""
    m = equations.mechanism
    printed = {"L": str(ca.cse(equations.lagrangian))}
    for i, q in enumerate(m.coordinates):
        printed[f"p_{q.name}"] = str(equations.momenta[i])
        printed[f"p_{q.name}_dot"] = str(equations.momentum_rates[i])
    return printed


def _column(expressions: Iterable[ca.SX]) -> ca.SX:
    rows = list(expressions)
    return ca.vertcat(*rows) if rows else ca.SX(0, 1)
