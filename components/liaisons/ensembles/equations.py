"""A model as an ensemble needs it: free of whatever no recorded output depends on, operators put into place.

The vectors of :class:`liaisons.mechanics.model.Model` become columns of SX symbols: ``t``; ``y``, the states that
count; ``lanes``, values that differ between the members; ``shared``, values that are given once for all of them; ``m``,
memory.  What nobody gives keeps its start value and is a number in the expressions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, final

import casadi as ca
import numpy as np

from liaisons.errors import ComponentError, suggestion
from liaisons.language import Component, Operator, Variable
from liaisons.mechanics import assemble
from liaisons.mechanics.model import Model

Columns = tuple[ca.SX, ...]
"""t, lanes, shared: what every expression may depend on."""

INTEGRALS = ("work", "dissipated")
"""States that no motion depends on; integrated only for outputs that need them."""


@final
@dataclass(frozen=True, eq=False)
class Equations:
    """Expressions of one ensemble.

    :param constants: t, lanes, shared.
    :param y: the states that count, shape (s, 1).
    :param start: y at the start, of constants.
    :param rates: of constants and y.
    :param projected: y put back onto constraints; None: no need.
    :param memory_start: m at the start, of constants.
    :param outputs: recorded outputs, of constants, y and m_start.
    :param conditions: must stay > 0, of constants and y.
    :param start_conditions: likewise, of constants alone: asked of the start only.
    :param condition_texts: one a condition, those of the start last.
    """

    constants: Columns
    y: ca.SX
    memory: ca.SX
    start: ca.SX
    memory_start: ca.SX
    rates: ca.SX
    projected: ca.SX | None
    outputs: ca.SX
    conditions: ca.SX
    start_conditions: ca.SX
    condition_texts: tuple[str, ...]


@final
class Settable:
    """What of a component and its operators can be given values, by name; ``length.amplitude`` is an operator's.

    :raises ComponentError: for an operator that is no function of time, or is put onto something that is not active.
    """

    def __init__(self, component: type[Component], operators: Mapping[str, type[Component]]) -> None:
        self.model = model = _model(component)
        self.operators = {name: _signal(model, name, operator) for name, operator in operators.items()}
        driven = {
            name
            for triple in model.active
            if triple.value in operators
            for name in (triple.value, triple.rate, triple.acceleration)
        }
        own = {v.name: v for v in (*model.parameters, *model.inputs) if v.name not in driven}
        foreign = {f"{name}.{p.name}": p for name, signal in self.operators.items() for p in signal.parameters}
        self.variables: dict[str, Variable] = own | foreign

    def check(self, names: Iterable[str]) -> None:
        """Raise a ComponentError with the nearest match for a name that is not there."""
        for name in names:
            if name not in self.variables:
                raise ComponentError(
                    f"{self.model.name} has no value {name!r} to set{suggestion(name, self.variables)}"
                )


def equations(settable: Settable, lanes: Iterable[str], shared: Iterable[str], record: Iterable[str]) -> Equations:
    """Put the expressions together.

    :param lanes: names of the values that differ between members, in the order of their column.
    :param shared: likewise of those that are given once for all.
    :param record: names of outputs.
    :raises ComponentError: for an unknown output, outputs that no state moves, or a function that is not made of scalar
        operations.
    """
    model = settable.model
    t = ca.SX.sym("t")
    columns = {"lanes": list(lanes), "shared": list(shared)}
    symbols = {title: ca.SX.sym(title, len(names)) for title, names in columns.items()}
    given = {name: symbols[title][i] for title, names in columns.items() for i, name in enumerate(names)}

    def value(name: str, variable: Variable) -> ca.SX:
        return given.get(name, ca.SX(variable.starts[0]))

    inputs = {v.name: value(v.name, v) for v in model.inputs}
    for name, signal in settable.operators.items():
        triple = next(a for a in model.active if a.value == name)
        k = ca.vertcat(*(value(f"{name}.{p.name}", p) for p in signal.parameters))
        z = _scalar(signal.outputs_function, t, [], [], k, [])[0]
        inputs |= {triple.value: z[0], triple.rate: z[1], triple.acceleration: z[2]}
    u = _column(inputs.values())
    k = _column(value(v.name, v) for v in model.parameters)

    y_all, m = ca.SX.sym("y", len(model.states)), ca.SX.sym("m", len(model.memory))
    rates = _scalar(model.derivatives, t, y_all, u, k)[0]
    projected = None if model.project is None else _scalar(model.project, t, y_all, u, k)[0]
    remembered = _scalar(model.remember, t, y_all, u, k, m)[0]  # what outputs see after a completed step
    rows, record = {variable.name: i for i, variable in enumerate(model.outputs)}, list(record)
    for name in record:
        if name not in rows:
            raise ComponentError(f"record: {model.name} has no output {name!r}{suggestion(name, rows)}")
    z = _scalar(model.outputs_function, t, y_all, u, k, remembered)[0]
    outputs = _column(z[rows[name]] for name in record)
    conditions = ca.vertsplit(_scalar(model.conditions, t, y_all, u, k)[0])
    lasting, at_start = (
        conditions[: len(conditions) - model.start_only],
        conditions[len(conditions) - model.start_only :],
    )
    texts = [*model.condition_texts]
    for variable in model.inputs:
        if variable.name not in given:  # the domain of what is given is checked before
            for bound in _bounds(variable, inputs[variable.name]):
                texts.insert(len(lasting), f"{variable.name} must stay {variable.domain()}")
                lasting.append(bound)

    needed = _closure(ca.vertcat(outputs, *lasting), y_all, [rates, *([] if projected is None else [projected])])
    if not needed:
        raise ComponentError(f"record: nothing of {record} depends on a state of {model.name}; record one")
    y, picked = y_all[needed], lambda expression: expression[needed]
    start, memory_start = _scalar(model.start, t, u, k)
    return Equations(
        constants=(t, symbols["lanes"], symbols["shared"]),
        y=y,
        memory=m,
        start=picked(start),
        memory_start=memory_start,
        rates=picked(rates),
        projected=None if projected is None else picked(projected),
        outputs=outputs,
        conditions=_column(lasting),
        start_conditions=ca.substitute(_column(at_start), y_all, start),
        condition_texts=tuple(texts),
    )


def default_record(model: Model) -> list[str]:
    """Names of the states that move: coordinates and momenta."""
    return [state.name for state in model.states if state.name not in INTEGRALS]


@lru_cache(maxsize=32)
def _model(component: type[Component]) -> Model:
    return assemble(component).flat()


def _signal(model: Model, name: str, operator: type[Component]) -> Model:
    """The model of an operator, flat."""
    active = [a.value for a in model.active]
    if name not in active:
        raise ComponentError(f"operators: {model.name} has no active coordinate {name!r}{suggestion(name, active)}")
    if not (isinstance(operator, type) and issubclass(operator, Operator)):
        raise ComponentError(f"operators: {name} = {operator!r} is no Operator; give the class, e.g. Sinusoid")
    signal = _model(operator)
    if signal.states or signal.inputs:
        raise ComponentError(
            f"operators: {operator.__name__} on {name} closes a loop; in an ensemble an operator is a function of time"
        )
    return signal


def _bounds(variable: Variable, value: ca.SX) -> list[ca.SX]:
    """What must be > 0 while a variable is in its domain."""
    gaps = [value - variable.minimum] if variable.minimum is not None else []
    gaps += [variable.maximum - value] if variable.maximum is not None else []
    return [gap if variable.strict else gap >= 0 for gap in gaps if not gap.is_constant()]


def _scalar(function: ca.Function, *arguments: Any) -> list[ca.SX]:
    """Expressions of a function, whose own graph may be of matrices."""
    try:
        expanded = function if function.is_a("SXFunction") else function.expand()
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        raise ComponentError(f"{function.name()} cannot be written in scalar operations: {reason}") from None
    columns = [ca.SX(0, 1) if isinstance(argument, list) else argument for argument in arguments]
    return [ca.densify(result) for result in expanded.call(columns, True, False)]


def _column(expressions: Iterable[ca.SX]) -> ca.SX:
    rows = list(expressions)
    return ca.vertcat(*rows) if rows else ca.SX(0, 1)


def _closure(wanted: ca.SX, y: ca.SX, maps: Iterable[ca.SX]) -> list[int]:
    """The states that the wanted expressions depend on, directly or through others."""
    uses = [np.array(ca.DM(ca.jacobian_sparsity(expression, y), 1)) != 0 for expression in maps]
    needed = np.any(np.array(ca.DM(ca.jacobian_sparsity(wanted, y), 1)) != 0, axis=0)
    while True:
        grown = needed.copy()
        for use in uses:
            grown |= use[needed].any(axis=0)
        if (grown == needed).all():
            return np.flatnonzero(needed).tolist()
        needed = grown
