"""Model of a component, as FMU back ends take it."""

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from liaisons.algebra import stack
from liaisons.errors import ComponentError
from liaisons.language import LATE, Component, Mechanism, Operator, SampledStates
from liaisons.mechanics.functions import model_functions
from liaisons.mechanics.mechanisms import mechanism_model
from liaisons.mechanics.model import NEXT_EVENT, LookupTable, Model, declared_fields
from liaisons.mechanics.printing import of_signals


def assemble(component: type[Component], n: object = None) -> Model:
    """Model of a component: derived, and laid out as variables and functions; names: docs/reference/fmu.md.

    :param component: a subclass of Mechanism, Chain, Operator or Sampled.
    :param n: number of links of a chain, or of elements of a mechanism; as declared by default.
    :raises ComponentError: if n is not a whole number, is too small, or the component has no Size n.
    """
    for kind in component.__mro__:
        if model_of := _MODEL_OF.get(kind):
            return model_of(component, n)
    return _signal_model(component, n)


def assemble_by(kind: type[Component], model_of: Callable[[Any, object], Model]) -> None:
    """Let :func:`assemble` make models of the subclasses of a class by a function of its own.

    :param model_of: component and n → model.
    """
    _MODEL_OF[kind] = model_of


def _mechanism_model(component: type[Mechanism], n: object) -> Model:
    """Model of a mechanism with n elements, as declared by default."""
    return mechanism_model(component if n is None else component.of_size(n))


_MODEL_OF: dict[type[Component], Callable[[Any, object], Model]] = {Mechanism: _mechanism_model}


def _sampled_memory(m: SampledStates) -> tuple[tuple[str, ...], ca.SX, ca.SX]:
    """Names of the numbers that a sampled component remembers, its states before the start, and symbols of them all."""
    states = [state.name for state in m.discrete_states]
    names = (*(f"{name}_before" for name in states), *states, "last_sample")
    return names, stack(ca.SX.sym(f"{name}_0") for name in states), ca.SX.sym("m", len(names))


def _sampled_results(m: SampledStates, results: dict[str, Any], memory: ca.SX) -> dict[str, Any]:
    """Results with the states that are visible of the memory, and the memory after a sample."""
    results["outputs_function"] = ca.vertcat(results["outputs_function"], m.discrete)
    visible = {name: ca.substitute(value, m.discrete, m.visible_states(memory)) for name, value in results.items()}
    return visible | {"sample": m.after_sample(memory)}


def _signal_model(component: Any, n: object) -> Model:
    """Model of an operator, or of a sampled component: variables and functions."""
    if n is not None:
        raise ComponentError(f"{component.__name__}: n = {n!r}: it has no size")
    m = component()
    if isinstance(m, Operator):
        m.lookups = []
    x, rates = m.internal, m.internal_rate_column()
    triple, next_event = m.triple(), m.next_event_time()
    start = stack(ca.SX.sym(f"{state.name}_0") for state in component.internal_states)
    k, memory, names, limits = ca.vertcat(m.parameter_column, start), ca.SX(0, 1), (), m.conditions()
    own: dict[str, Any] = {"derivatives": rates, "outputs_function": stack([*triple, x, rates])}
    events, at_start = stack(map(ca.SX, m.events())), memory
    if isinstance(m, SampledStates):
        names, before, memory = _sampled_memory(m)
        k, at_start = ca.vertcat(k, before), m.memory_at_start(before)
        own = _sampled_results(m, own, memory) | {"events": events}
        limits = {LATE: m.missed_sample_margin(memory), **limits}
    vectors = {"t": m.clock, "y": x, "u": m.input_column, "k": k, "m": memory}
    read = {
        **own,
        "jump": x,
        "conditions": stack(map(ca.SX, limits.values())),
        **({} if next_event is None else {"draw": next_event}),
    }
    equations, table = of_signals(m), None
    if isinstance(m, Operator) and m.lookups:
        table = _lookup_table(m, vectors, read)
        read = _with_all_rows(m, read)
    results = {"events": events, **read, "start": (start, at_start), "remember": memory}
    results["nominals"] = ca.SX.ones(x.shape)
    return Model(
        **declared_fields(m),
        memory=names,
        **model_functions(vectors, results, merge=False),
        drawn=() if next_event is None else (NEXT_EVENT,),
        condition_texts=tuple(limits),
        equations=equations,
        table=table,
    )


def _lookup_table(operator: Operator, vectors: Mapping[str, ca.SX], results: Mapping[str, ca.SX]) -> LookupTable:
    """Lookup table of an operator, with its functions of the two rows of each look-up.

    :param results: of the functions that read rows, by name.
    """
    t, lookups, columns = operator.clock, operator.lookups or [], operator.table
    names, rows = [column.name for column in columns], columns[0].dimension.count
    behind = vectors["k"][len(names) * rows :]
    seen = stack([*(row for lookup in lookups for row in (lookup.begin, lookup.end)), behind])
    has_events = any(ca.is_equal(lookup.time, t) for lookup in lookups)
    own = {name: value for name, value in results.items() if name != "draw" or not has_events}
    events = own.pop("events", None)
    elements = {name for column in columns for name in column.names}
    unseen = [
        name
        for name in map(str, ca.symvar(stack([*own.values(), ca.SX(0, 1) if events is None else events])))
        if name in elements
    ]
    if unseen:
        raise ComponentError(f"{type(operator).__name__}: {unseen[0]} is part of a table: ask interval() for it")
    times = stack(lookup.time for lookup in lookups)
    return LookupTable(
        columns=len(names),
        rows=rows,
        lookups=tuple(tuple(names.index(column) for column in lookup.columns) for lookup in lookups),
        rests=tuple(lookup.rests for lookup in lookups),
        times=ca.Function("times", [t, vectors["y"], vectors["u"], behind], [times]),
        has_events=has_events,
        events=events if events is None else ca.Function("events", [t, vectors["y"], vectors["u"], seen], [events]),
        **model_functions({**vectors, "k": seen}, own, merge=False),
    )


def _with_all_rows(operator: Operator, results: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
    """Results as expressions of all rows in place of those of each look-up."""
    lookups, operator.lookups = operator.lookups or [], None
    symbols, rows = [], []
    for lookup in lookups:
        both = operator.interval(lookup.time, *lookup.columns, rests=lookup.rests)
        for symbol, row in zip((lookup.begin, lookup.end), both, strict=True):
            symbols.append(symbol)
            rows.append(stack(row))
    return dict(zip(results, ca.substitute(list(results.values()), symbols, rows), strict=True))
