"""From a component to the Model that an FMU back end takes."""

from __future__ import annotations

from liaisons.errors import ComponentError
from liaisons.language.chain import Chain
from liaisons.language.component import Component
from liaisons.language.mechanism import Mechanism
from liaisons.language.operator import Operator
from liaisons.mechanics.chains.assembly import chain_model
from liaisons.mechanics.mechanisms import mechanism_model
from liaisons.mechanics.model import Model
from liaisons.mechanics.operators import operator_model


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
    return operator_model(component)
