"""From an operator to the Model that an FMU back end takes."""

from __future__ import annotations

from typing import Any

import casadi as ca

from liaisons.expressions.algebra import stack
from liaisons.language.operator import Operator
from liaisons.mechanics.model import Model, described
from liaisons.mechanics.printing import of_operator


def operator_model(component: type[Operator]) -> Model:
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
    made: dict[str, Any] = {name: ca.Function(name, *ends) for name, ends in functions.items()}
    return Model(
        **described(picture),
        memory=(),
        outputs_function=made.pop("outputs"),
        **made,
        condition_texts=(),
        equations=of_operator(picture, triple[0]),
    )
