"""Pieces of classes: literals, declarations, equations, and the lines that they fill."""

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import final

import casadi as ca

from liaisons.errors import ComponentError
from liaisons.language import Component, Experiment, Symbol, Variable
from liaisons_pages.formulas import Notation, UnsupportedError, formula, modelica_expression

WIDTH = 116
MOTION = 'partial model Motion "Equations of motion"'
WORD = r"(?<![\w.'])[A-Za-z_]\w*(?!\w*[('])"
_RESERVED = re.compile(
    "algorithm|and|annotation|assert|block|break|class|connect|connector|constant|constrainedby|"
    "der|discrete|each|else|elseif|elsewhen|encapsulated|end|enumeration|equation|expandable|"
    "extends|external|false|final|flow|for|function|if|import|impure|in|initial|inner|input|"
    "loop|model|not|operator|or|outer|output|package|parameter|partial|protected|public|pure|"
    "record|redeclare|replaceable|return|stream|then|time|true|type|when|while|within"
)
STRING = r'"(?:[^"\\]|\\.)*"'


def identifier(name: str) -> str:
    """Return a name in quotes where it is a reserved word."""
    return f"'{name}'" if _RESERVED.fullmatch(name) else name


def number_literal(value: float | tuple[float, ...]) -> str:
    """Return the literal of a number or an array."""
    if isinstance(value, tuple):
        return f"{{{', '.join(map(number_literal, value))}}}"
    if not math.isfinite(value):
        raise ComponentError(f"Modelica text has no number {value}; choose a finite one")
    return repr(float(value)).removesuffix(".0")


def string_literal(text: str) -> str:
    """Return the literal of a string."""
    return '"' + re.sub(r'([\\"])', r"\\\1", text) + '"'


def declaration(name: str, unit: str = "", text: str = "", **attributes: str) -> str:
    """Return the part of a declaration for one variable: name, attributes, description."""
    modified = {"unit": unit and string_literal(unit)} | attributes
    values = modification({attribute: value for attribute, value in modified.items() if value})
    return identifier(name) + f"({values})" * bool(values) + f" {string_literal(text)}" * bool(text)


def modification(values: Mapping[str, str]) -> str:
    """Return the list of attributes between the brackets of a declaration."""
    return ", ".join(f"{identifier(name)}={value}" for name, value in values.items())


def component_clause(kind: str, variables: Iterable[str]) -> list[str]:
    """Return one declaration of several variables; empty without variables."""
    listed = ", ".join(variables)
    return [f"{kind} {listed};"] if listed else []


def parameters(
    component: Component, value: Callable[[Variable], str] = lambda v: number_literal(v.starts[0]), size: str = ""
) -> tuple[list[str], list[str]]:
    """Return declarations of parameters and start values, and initial equations of the variables that start there.

    :param size: of arrays.
    """
    declarations, starts, initial = list[str](), list[str](), list[str]()
    own = {p.name for p in component.parameters}
    for v in component.layout().parameters:
        low, high = ("" if bound is None else number_literal(bound) for bound in (v.minimum, v.maximum))
        text = f"{declaration(v.name + size * bool(v.dimension), v.unit, min=low, max=high)} = {value(v)}"
        if v.name in own:
            declarations.append(f"parameter Real {text} {string_literal(v.description)};")
        else:
            starts.append(text)
            initial.append(f"{identifier(v.name[:-2])} = {v.name};")
    if starts:
        starts[-1] += ' "at the start"'
    return declarations + component_clause("parameter Real", starts), initial


def units_of(component: Component) -> dict[str, str]:
    """Return the units of variables and of outer forces Q, by name."""
    unit = {v.name: v.unit for v in component.layout().variables}
    return unit | {f"Q_{name[:-5]}": of for name, of in unit.items() if name.endswith("_load")}


def bound_assertions(symbols: Iterable[Symbol]) -> list[str]:
    """Return assertions of excluded bounds, since ``min`` and ``max`` include theirs."""
    limits = [
        (s.name, f"{sign} {number_literal(bound)}")
        for s in symbols
        for sign, bound in ((">", s.minimum), ("<", s.maximum))
        if s.strict and bound is not None
    ]
    return [
        f"assert({identifier(name)} {rest}, {string_literal(f'{name} {rest} is needed')});" for name, rest in limits
    ]


def statement_lines(statement: str) -> list[str]:
    """Return the lines of one statement; strings stay whole."""
    text = re.sub(STRING, lambda string: string[0].replace(" ", "\0"), statement)
    lines = textwrap.wrap(text, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return [line.replace("\0", " ") for line in lines]


def filled_lines(statements: Iterable[str]) -> list[str]:
    """Return the lines of statements, as many on a line as fit."""
    lines: list[str] = []
    for statement in statements:
        if lines and len(lines[-1] + statement) < WIDTH and not lines[-1].startswith(" "):
            lines[-1] += f" {statement}"
        else:
            lines += statement_lines(statement)
    return lines


def indented_lines(lines: Iterable[str]) -> list[str]:
    """Return lines indented by two columns."""
    return [f"  {line}" for line in lines]


def model_lines(
    head: str,
    declarations: Iterable[str],
    equations: list[str],
    initial: Iterable[str] = (),
    experiment: Experiment | None = None,
) -> list[str]:
    """Return the lines of a model.

    :param head: the first line.
    :param equations: lines.
    """
    lines = [head, *indented_lines(line for statement in declarations for line in statement_lines(statement))]
    for title, block in (("initial equation", filled_lines(initial)), ("equation", equations)):
        lines += [title, *indented_lines(block)] if block else []
    if e := experiment:
        times = f"StopTime={number_literal(e.stop_time)}, Interval={number_literal(e.step_size)}"
        values = f"{times}, Tolerance={number_literal(e.tolerance)}"
        lines.append(f"  annotation(experiment({values}));")
    return [*lines, re.sub(r".*?model (\w+).*", r"end \1;", head)]


@final
@dataclass(eq=False)
class Section:
    """Equations, the variables in them, and names of what long formulas repeat.

    :param names: what some symbols are written as.
    :param index: of elements, in a loop.
    :param events: whether relations are events.
    """

    notation: Notation
    names: Mapping[str, str] = field(default_factory=dict)
    index: str = ""
    events: bool = True
    statements: list[str] = field(default_factory=list)
    unsaid: list[str] = field(default_factory=list)
    variables: dict[str, None] = field(default_factory=dict)  # in the order of their first use
    _abbreviations: dict[str, str] = field(default_factory=dict)  # names by what they stand for

    def write_expression(self, right: ca.SX, *, readable: bool = False) -> str | None:
        """Write the abbreviations of a formula and return it; None if Modelica lacks a function.

        :param readable: None, too, if it is too long to be read.
        """
        longest = {} if readable else {"longest": math.inf}
        tree = formula(right, self.notation, **longest, breaks=True)
        if tree is None:
            return None
        local = dict(self.names)

        def write_name(name: str) -> str:
            return local.get(name, identifier(name))

        try:
            for name, term in tree.where:
                text = modelica_expression(term, write_name, events=self.events)
                if text not in self._abbreviations:
                    short = f"{self.notation.unused_letter()}_{len(self._abbreviations) + 1}"
                    self._abbreviations[text] = short
                    self.statements.append(f"{short}{self.index} = {text};")
                local[name.name] = self._abbreviations[text] + self.index
            result = modelica_expression(tree.term, write_name, events=self.events)
        except UnsupportedError:
            return None
        self.variables |= dict.fromkeys(map(str, ca.symvar(right)))
        return result

    def add(self, left: str, right: ca.SX, *, readable: bool = False) -> None:
        """Write an equation; one that has a function that Modelica lacks is noted in ``unsaid``.

        :param readable: so is one that is too long to be read.
        """
        text = self.write_expression(right, readable=readable)
        if text is None:
            self.unsaid.append(left)
        else:
            self.variables |= dict.fromkeys(re.findall(r"^(?:der\()?(\w+)[\[\w\s+\])]*$", left))
            self.statements.append(f"{re.sub(WORD, lambda name: identifier(name[0]), left)} = {text};")

    def add_rows(self, lefts: Iterable[str], column: ca.SX) -> None:
        """Write an equation for each row of a column."""
        for left, right in zip(lefts, ca.vertsplit(column), strict=True):
            self.add(left, right)

    def variables_except(self, *without: str) -> list[str]:
        """Return the names of the section's variables and abbreviations, without these."""
        names = dict.fromkeys([*self.variables, *self._abbreviations.values()])
        return [name for name in names if name not in {*without, "t"}]

    @property
    def comment(self) -> list[str]:
        """Comment on the missing equations; empty if all are written."""
        return [f"/* Too long, or not to be said in Modelica: {', '.join(self.unsaid)}. */"] if self.unsaid else []
