"""From an operator to the Model that an FMU back end takes."""

from __future__ import annotations

import inspect

import casadi as ca

from liaisons import units
from liaisons.expressions.algebra import stack
from liaisons.language.declarations import InternalState
from liaisons.language.operator import TRIPLE, Operator
from liaisons.language.variables import Port, PortMember, Variable
from liaisons.mechanics.model import Model, State
from liaisons.mechanics.printing import checked_against, of_operator

_TEXTS = ("signal", "first derivative of the signal", "second derivative of the signal")


def operator_model(component: type[Operator]) -> Model:
    """Lay an operator out as variables and functions."""
    picture = component()
    t, x, u = picture.clock, picture.internal, picture.input_column
    rates, triple = picture.rates(), picture.triple()
    start = [ca.SX.sym(f"{state.name}_0") for state in component.internal_states]
    k = ca.vertcat(picture.parameter_column, *start)
    none = ca.SX(0, 1)  # an operator has nothing to remember
    states = component.internal_states
    texts = zip(TRIPLE, _TEXTS, strict=True)
    outputs = [
        *(Variable(name, units.ANY, text, "output", "continuous") for name, text in texts),
        *(Variable(state.name, state.unit, state.description, "output", "continuous") for state in states),
        *(_rate_of(state) for state in states),
    ]
    return Model(
        name=component.__name__,
        module=component.__module__,
        description=component.summary(),
        documentation=inspect.getdoc(component) or component.__name__,
        parameters=(
            *(p.variable("parameter", "tunable" if p.tunable else "fixed") for p in component.parameters),
            *(state.variable("parameter", "fixed", f"{state.name}_0") for state in component.internal_states),
        ),
        inputs=tuple(item.variable("input", "continuous") for item in component.inputs),
        outputs=tuple(outputs),
        states=tuple(State(state.name, f"{state.name}_dot") for state in component.internal_states),
        memory=(),
        start=ca.Function("start", [t, u, k], [stack(start), none]),
        derivatives=ca.Function("derivatives", [t, x, u, k], [stack(rates)]),
        outputs_function=ca.Function("outputs", [t, x, u, k, none], [ca.densify(stack([*triple, x, *rates]))]),
        jump=ca.Function("jump", [t, x, u, k, none], [x]),
        remember=ca.Function("remember", [t, x, u, k, none], [none]),
        nominals=ca.Function("nominals", [t, x, u, k], [ca.SX.ones(x.shape)]),
        conditions=ca.Function("conditions", [t, x, u, k], [none]),
        condition_texts=(),
        events=ca.Function("events", [k], [stack(picture.events())]),
        ports=(Port("y", "signal", tuple(map(PortMember, ("s", "v", "a"), TRIPLE))),),
        experiment=component.experiment,
        equations=of_operator(picture, triple[0]),
        closed_form=checked_against(component),
    )


def _rate_of(state: InternalState) -> Variable:
    unit, text = units.rate(state.unit), f"rate of {state.name}"
    return Variable(f"{state.name}_dot", unit, text, "local", "continuous", derivative_of=state.name)
