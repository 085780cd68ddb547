"""Operators: the signal with its derivatives, and flanges that follow it."""

from collections.abc import Callable, Collection, Iterable, Iterator
from functools import partial

import casadi as ca

from liaisons.algebra import stack
from liaisons.expressions import interpret
from liaisons.language import Operator, Symbol, Variable
from liaisons_exchange.modelica_text.text import (
    Section,
    bound_assertions,
    component_clause,
    declaration,
    filled_lines,
    model_lines,
    number_literal,
    parameters,
)
from liaisons_pages.formulas import Notation

_ENTRY = """\
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
end entry;"""
_FOLLOWER = 'model {0} "A flange that follows the signal" extends Signals; {1} flange({2}=y[1]); end {0};'


def _table_entries(operator: Operator, section: Section, read: Collection[int]) -> tuple[list[ca.SX], list[ca.SX]]:
    """Add statements that look entries of tables up; return symbols of the signal, and those of the entries for them.

    :param read: hashes of the symbols that the signal reads.
    """
    symbols: list[ca.SX] = []
    entries: list[ca.SX] = []
    for count, lookup in enumerate(operator.lookups or (), start=1):
        section.add(f"instant_{count}", lookup.time)
        for ahead, row in enumerate((lookup.begin, lookup.end)):
            for symbol, column in zip(ca.vertsplit(row), lookup.columns, strict=True):
                if symbol.element_hash() in read:
                    symbols.append(symbol)
                    entries.append(ca.SX.sym(f"{column}_{('begin', 'end')[ahead]}"))
                    read_at = f"instant_{count}, {operator.table[0].name}, {column}, {ahead}"
                    rests = "true" if lookup.rests else "false"
                    section.statements.append(f"{entries[-1]} = entry({read_at}, {rests});")
    return symbols, entries


def operator_classes(component: type[Operator]) -> list[str]:
    """Return lines of the models ``Signals``, ``Translational`` and ``Rotational``."""
    operator, layout = component(), component().layout()
    operator.lookups = []
    object.__setattr__(operator, "signal", partial(_with_if_else, operator.signal))
    columns = [stack(operator.triple()), operator.internal_rate_column()]
    # Rows of a table change without an event.
    section = Section(Notation.from_component(component), {"t": "time"}, events=not operator.lookups)
    symbols, entries = _table_entries(operator, section, {x.element_hash() for x in ca.symvar(stack(columns))})
    triple, rates = (ca.substitute(x, stack(symbols), stack(entries)) for x in columns)
    section.add_rows((f"der({state.name})" for state in component.internal_states), rates)
    section.add_rows((f"y[{i}]" for i in (1, 2, 3)), triple)

    rows = max((len(p.leading) for p in operator.table if len({*p.leading}) > 1), default=2)

    def value(v: Variable) -> str:
        return number_literal(v.starts[:rows] if v.dimension else v.starts[0])

    constants, initial = parameters(operator, value, "[:]")
    without = [x.name for x in (*layout.parameters, *layout.inputs, *component.internal_states)]
    declarations = [
        *constants,
        *_input_and_state_declarations(layout.inputs, component.internal_states),
        *component_clause("Real", section.variables_except(*without, "time", "y")),
        'output Real y[3] "signal, first and second derivative";',
    ]
    return [
        *(_ENTRY.splitlines() if symbols else []),
        *model_lines(
            'model Signals "The signal and its two derivatives"',
            declarations,
            filled_lines([*bound_assertions(component.parameters), *section.statements]),
            initial,
            component.experiment,
        ),
        _FOLLOWER.format("Translational", "Translation", "s"),
        _FOLLOWER.format("Rotational", "Rotation", "phi"),
    ]


def _input_and_state_declarations(inputs: Iterable[Variable], states: Iterable[Symbol]) -> Iterator[str]:
    for v in inputs:
        yield f'input Real {declaration(v.name, v.unit)} = {number_literal(v.starts[0])} "{v.description}";'
    for x in states:
        yield f"Real {declaration(x.name, x.unit, x.description, start=f'{x.name}_0')};"


def _with_if_else(signal: Callable[[ca.SX], ca.SX], t: ca.SX) -> ca.SX:
    """Return the signal with if_else in place of fmin and fmax, whose derivatives CasADi writes with a division."""
    expression = ca.SX(signal(t))
    symbols = ca.symvar(expression)

    def operation(code: int, x: list[ca.SX]) -> ca.SX:
        if code in (ca.OP_FMIN, ca.OP_FMAX):
            less, more = x if code == ca.OP_FMIN else x[::-1]
            return ca.if_else(x[0] < x[1], less, more)
        return ca.SX.unary(code, *x) if len(x) == 1 else ca.SX.binary(code, *x)

    function = ca.Function("f", symbols, [expression])
    return interpret(function, entry=lambda i, _: symbols[i], constant=ca.SX, operation=operation)[0][0]
