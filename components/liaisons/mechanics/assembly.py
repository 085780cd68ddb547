"""Model of a component, as FMU back ends take it."""

from __future__ import annotations

import casadi as ca

from liaisons.errors import ComponentError
from liaisons.expressions.algebra import stack
from liaisons.language.chain import Chain
from liaisons.language.component import Component
from liaisons.language.mechanism import Mechanism
from liaisons.language.operator import Operator
from liaisons.mechanics.chains.assembly import chain_model
from liaisons.mechanics.functions import model_functions
from liaisons.mechanics.mechanisms import mechanism_model
from liaisons.mechanics.model import NEXT_EVENT, LookupTable, Model, described
from liaisons.mechanics.printing import of_operator


def assemble(component: type[Component], n: object = None) -> Model:
    """Model of a component: derived, and laid out as variables and functions; names: docs/reference/fmu.md.

    :param component: a subclass of Mechanism, Chain or Operator.
    :param n: number of links of a chain, or of elements of a mechanism; as declared by default.
    :raises ComponentError: if n is no whole number, is too small, or the component has no Size n.
    """
    if issubclass(component, Chain):
        return chain_model(component, component(n).sizes["n"])
    if issubclass(component, Mechanism):
        return mechanism_model(component if n is None else component.of_size(n))
    assert issubclass(component, Operator)
    if n is not None:
        raise ComponentError(f"{component.__name__}: n = {n!r}: an operator has no size")
    return _operator_model(component)


def _operator_model(component: type[Operator]) -> Model:
    """Model of an operator: variables and functions."""
    operator = component()
    operator.lookups = []
    t, x, u = operator.clock, operator.internal, operator.input_column
    rates, triple, next_event = stack(map(ca.SX, operator.rates())), operator.triple(), operator.next_event_time()
    announced = ca.SX(0, 1) if next_event is None else next_event
    start = stack(ca.SX.sym(f"{state.name}_0") for state in component.internal_states)
    k, none = ca.vertcat(operator.parameter_column, start), ca.SX(0, 1)
    outputs = ca.densify(stack([*triple, x, rates]))
    sampled, limits = operator.samples(), operator.conditions()
    after = (sampled.get(state.name, operator.symbols[state.name]) for state in component.internal_states)
    jumped = ca.densify(stack(map(ca.SX, after)))
    kept = ca.densify(stack(map(ca.SX, limits.values())))
    equations = of_operator(operator, triple[0])
    table = None
    if operator.lookups:
        table = _table(operator, k, announced, rates, outputs, jumped, kept)
        rates, outputs, announced, jumped, kept = _of_all_rows(operator, rates, outputs, announced, jumped, kept)
    results = {
        "start": (start, none),
        "derivatives": rates,
        "outputs_function": outputs,
        "jump": jumped,
        "remember": none,
        "nominals": ca.SX.ones(x.shape),
        "conditions": kept,
        "events": stack(map(ca.SX, operator.events())),
        "draw": None if next_event is None else announced,
    }
    return Model(
        **described(operator),
        memory=(),
        **model_functions({"t": t, "y": x, "u": u, "k": k, "m": none}, results, merge=False),
        drawn=() if next_event is None else (NEXT_EVENT,),
        condition_texts=tuple(limits),
        equations=equations,
        table=table,
    )


def _table(operator: Operator, k: ca.SX, announced: ca.SX, *seen_by: ca.SX) -> LookupTable:
    """Functions of the two rows of each look-up."""
    t, x, u, lookups = operator.clock, operator.internal, operator.input_column, operator.lookups or []
    names = [column.name for column in operator.table]
    rows = operator.table[0].dimension.count
    behind = k[len(names) * rows :]
    seen = stack([*(row for lookup in lookups for row in (lookup.begin, lookup.end)), behind])
    has_events = any(ca.is_equal(lookup.time, t) for lookup in lookups)
    seeing = seen_by if has_events else (*seen_by, announced)
    rates, outputs, jumped, kept = seen_by
    elements = {name for column in operator.table for name in column.names}
    unseen = [name for name in map(str, ca.symvar(stack(seeing))) if name in elements]
    if unseen:
        raise ComponentError(f"{type(operator).__name__}: {unseen[0]} is part of a table: ask interval() for it")
    return LookupTable(
        columns=len(names),
        rows=rows,
        lookups=tuple(tuple(names.index(column) for column in lookup.columns) for lookup in lookups),
        rests=tuple(lookup.rests for lookup in lookups),
        times=ca.Function("times", [t, x, u, behind], [stack(lookup.time for lookup in lookups)]),
        derivatives=ca.Function("derivatives", [t, x, u, seen], [rates]),
        outputs_function=ca.Function("outputs", [t, x, u, seen, ca.SX(0, 1)], [outputs]),
        jump=ca.Function("jump", [t, x, u, seen, ca.SX(0, 1)], [jumped]),
        conditions=ca.Function("conditions", [t, x, u, seen], [kept]),
        has_events=has_events,
        draw=None if has_events or announced.is_empty() else ca.Function("draw", [t, x, u, seen], [announced]),
    )


def _of_all_rows(operator: Operator, *expressions: ca.SX) -> list[ca.SX]:
    """Expressions of all rows in place of those of each look-up."""
    lookups, operator.lookups = operator.lookups or [], None
    symbols, rows = [], []
    for lookup in lookups:
        both = operator.interval(lookup.time, *lookup.columns, rests=lookup.rests)
        for symbol, row in zip((lookup.begin, lookup.end), both, strict=True):
            symbols.append(symbol)
            rows.append(stack(row))
    return ca.substitute(list(expressions), symbols, rows)
