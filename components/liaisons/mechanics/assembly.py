"""From a component to the Model that an FMU back end takes."""

from __future__ import annotations

from typing import Any

import casadi as ca

from liaisons.errors import ComponentError
from liaisons.expressions.algebra import stack
from liaisons.language.chain import Chain
from liaisons.language.component import Component
from liaisons.language.mechanism import Mechanism
from liaisons.language.operator import Operator
from liaisons.mechanics.chains.assembly import chain_model
from liaisons.mechanics.mechanisms import mechanism_model
from liaisons.mechanics.model import Model, described
from liaisons.mechanics.printing import of_operator


def assemble(component: type[Component], n: object = None) -> Model:
    """Derive a component and lay it out as variables and functions (DESIGN: names in an FMU).

    :param component: a subclass of Mechanism, Chain or Operator.
    :param n: how many links a chain has; as declared where none is given.
    :raises ComponentError: if n is no whole number or too small, or given for what has no links.
    """
    if issubclass(component, Chain):
        return chain_model(component, component(n).sizes["n"])
    if n is not None:
        raise ComponentError(f"{component.__name__}: n = {n!r}: only a Chain has links")
    if issubclass(component, Mechanism):
        return mechanism_model(component)
    assert issubclass(component, Operator)
    return _operator_model(component)


def _operator_model(component: type[Operator]) -> Model:
    """Lay an operator out as variables and functions."""
    picture = component()
    t, x, u = picture.clock, picture.internal, picture.input_column
    rates, triple = picture.rates(), picture.triple()
    start = stack(ca.SX.sym(f"{state.name}_0") for state in component.internal_states)
    k, none = ca.vertcat(picture.parameter_column, start), ca.SX(0, 1)  # an operator has nothing to remember
    functions = {
        "start": ([t, u, k], [start, none]),
        "derivatives": ([t, x, u, k], [stack(rates)]),
        "outputs": ([t, x, u, k, none], [ca.densify(stack([*triple, x, *rates]))]),
        "jump": ([t, x, u, k, none], [x]),
        "remember": ([t, x, u, k, none], [none]),
        "nominals": ([t, x, u, k], [ca.SX.ones(x.shape)]),
        "conditions": ([t, x, u, k], [none]),
        "events": ([k], [stack(picture.events())]),
    }
    columns = len(picture.parameters)
    ends = ca.SX.sym("ends", 2 * columns)
    piece = picture.piece(t, ends)
    if piece is not None:
        functions["piece"] = ([t, ends], [ca.densify(stack(picture.triple(piece)))])
    made: dict[str, Any] = {name: ca.Function(name, *ends) for name, ends in functions.items()}
    return Model(
        **described(picture),
        memory=(),
        outputs_function=made.pop("outputs"),
        **made,
        condition_texts=(),
        equations=of_operator(picture, triple[0]),
    )
