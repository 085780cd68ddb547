"""Operators: the signal and its derivatives, and a flange that follows it."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from liaisons.expressions.algebra import stack
from liaisons.expressions.operations import interpret
from liaisons.formulas import Notation
from liaisons.language import Operator, ParameterArray
from liaisons.mechanics import assemble
from liaisons.modelica_text.faces import experiment
from liaisons.modelica_text.text import Section, bounds, declared, filled, indented, named, number, quoted

ENTRY = """\
function entry "Of a column of a table: in the row where the interval of a time begins (ahead = 0), or ends (1)"
  input Real t, instant[:], column[size(instant, 1)];
  input Integer ahead;
  input Boolean rests "behind all rows it is the last one; else the last interval";
  output Real value;
protected
  Integer last, k;
algorithm
  last := 1;
  k := 0;
  for i in 1:size(instant, 1) - 1 loop
    if last == i and instant[i + 1] >= instant[i] then
      last := i + 1;
      if rests and t >= instant[i + 1] or not rests and instant[i + 1] > instant[i] and (k == 0 or t >= instant[i]) then
        k := if rests then i + 1 else i;
      end if;
    end if;
  end for;
  value := column[min(max(k, 1) + ahead, last)];
end entry;
"""


def operator_classes(component: type[Operator]) -> list[str]:
    """Lines of the models ``Signals``, ``Translational`` and ``Rotational``."""
    operator = component()
    operator.lookups = []
    whole = operator.signal
    operator.signal = lambda t: chosen(ca.SX(whole(t)))  # type: ignore[method-assign]
    triple, rates, inputs = operator.triple(), operator.rates(), component.inputs
    # Rows of a table change without an event.
    section = Section(Notation.from_model(assemble(component)), {"t": "time"}, events=not operator.lookups)
    symbols, rows, declarations = [], [], [*_parameters(operator)]
    read = {x.element_hash() for x in ca.symvar(stack(map(ca.SX, [*triple, *rates])))}
    for count, lookup in enumerate(operator.lookups, start=1):
        t = f"instant_{count}"
        declarations += declared(named(t, "s", "where the table is read"))
        section.add(t, lookup.time)
        for ahead, (entries, end) in enumerate(((lookup.begin, "begin"), (lookup.end, "end"))):
            for symbol, column in zip(ca.vertsplit(entries), lookup.columns, strict=True):
                if symbol.element_hash() in read:
                    name = f"{column}_{end}"
                    call = f"entry({t}, {operator.table[0].name}, {column}, {ahead}, {str(lookup.rests).lower()})"
                    declarations += declared(named(name, ""))
                    section.lines.append(f"{name} = {call};")
                    symbols.append(symbol)
                    rows.append(ca.SX.sym(name))
    triple, rates = (
        ca.vertsplit(ca.substitute(stack(map(ca.SX, x)), stack(symbols), stack(rows))) for x in (triple, rates)
    )
    for state, rate in zip(component.internal_states, rates, strict=False):
        section.add(f"der({state.name})", rate)
    for i, y in enumerate(triple, start=1):
        section.add(f"y[{i}]", y)
    for state in component.internal_states:
        declarations += declared(named(state.name, state.unit, state.description, start=f"{state.name}_0"))
    for item in inputs:
        declarations += declared(
            f"{named(item.name, item.unit)} = {number(item.start)} {quoted(item.description)}", head="input Real"
        )
    initial = filled(f"{state.name} = {state.name}_0;" for state in component.internal_states)
    asserted = [
        f"assert({p.name} > {number(p.minimum)}, {quoted(f'{p.name} > {number(p.minimum)} is needed')});"
        for p in component.parameters
        if p.strict and p.minimum is not None
    ]
    return [
        *(ENTRY.splitlines() if operator.lookups else []),
        'model Signals "The signal and its two derivatives"',
        *indented([*declarations, 'output Real y[3] "signal, first and second derivative";', *section.declared]),
        *(["initial equation", *indented(initial)] if initial else []),
        "equation",
        *indented(filled([*asserted, *section.lines])),
        f"  {experiment(component.experiment)}",
        "end Signals;",
        'model Translational "A flange that follows the signal" extends Signals;',
        "  Translation flange(s=y[1]);",
        "end Translational;",
        'model Rotational "A flange that follows the signal" extends Signals;',
        "  Rotation flange(phi=y[1]);",
        "end Rotational;",
    ]


def _parameters(operator: Operator) -> Iterator[str]:
    rows = max((len(p.leading) for p in operator.table if len(set(p.leading)) > 1), default=2)
    for p in operator.parameters:
        size, value = "", number(p.start)
        if isinstance(p, ParameterArray):
            values = (p.leading + (0.0,) * rows)[:rows]
            size, value = "[:]", f"{{{', '.join(map(number, values))}}}"
        limits = bounds(p.variable("parameter", "fixed"))
        text = f"{named(p.name, p.unit, size=size, **limits)} = {value} {quoted(p.description)}"
        yield from declared(text, head="parameter Real")
    for state in operator.internal_states:
        yield from declared(
            f'{named(f"{state.name}_0", state.unit)} = {number(state.start)} "at the start"', head="parameter Real"
        )


def chosen(expression: ca.SX) -> ca.SX:
    """The expression with choices in the place of minima and maxima: their derivatives need no division."""
    symbols = ca.symvar(expression)
    function = ca.Function("f", symbols, [expression])

    def operation(code: int, x: list[ca.SX]) -> ca.SX:
        if code in (ca.OP_FMIN, ca.OP_FMAX):
            less, more = x if code == ca.OP_FMIN else x[::-1]
            return ca.if_else(x[0] < x[1], less, more)
        return ca.SX.unary(code, *x) if len(x) == 1 else ca.SX.binary(code, *x)

    ((result,),) = interpret(function, entry=lambda i, _: symbols[i], constant=ca.SX, operation=operation)
    return result
