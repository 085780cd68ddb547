"""Pieces of classes: literals, declarations, equations, and the lines that they fill."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import final

import casadi as ca

from liaisons.formulas import Formula, Notation, formula
from liaisons.formulas.terms import Name
from liaisons.language import Variable
from liaisons.modelica_text.printer import UnsupportedError, expression, identifier

WIDTH = 120


def number(value: float) -> str:
    """A literal."""
    return repr(float(value)).removesuffix(".0")


def quoted(text: str) -> str:
    """A string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def bounds(variable: Variable) -> dict[str, str]:
    """Its attributes ``min`` and ``max``."""
    pairs = (("min", variable.minimum), ("max", variable.maximum))
    return {name: number(value) for name, value in pairs if value is not None}


def named(name: str, unit: str, description: str = "", size: str = "", **others: str) -> str:
    """A variable in a list of them: name, size, attributes, description."""
    pairs = ({"unit": quoted(unit)} if unit else {}) | others
    modified = ", ".join(f"{attribute}={value}" for attribute, value in pairs.items())
    return (
        f"{identifier(name)}{size}{f'({modified})' if pairs else ''}{f' {quoted(description)}' if description else ''}"
    )


def declared(*variables: str, head: str = "Real") -> list[str]:
    """One declaration of some variables."""
    return packed([f"{head} {variables[0]}", *variables[1:]], ", ") if variables else []


def packed(pieces: Iterable[str], between: str = "; ", end: str = ";") -> list[str]:
    """Pieces that stay whole, as many on a line as fit."""
    lines: list[str] = []
    *parts, last = pieces
    for piece in (*(part + between.rstrip() for part in parts), last + end):
        if lines and len(lines[-1]) + len(piece) < WIDTH - 4:
            lines[-1] += f" {piece}"
        else:
            lines.append(piece if not lines else f"  {piece}")
    return lines


def filled(statements: Iterable[str]) -> list[str]:
    """Lines of statements, short ones on one line as long as it lasts."""
    lines: list[str] = []
    for statement in statements:
        short = wrapped(f"{lines[-1]} {statement}") if lines and not lines[-1].startswith("  ") else []
        lines[-1:] = short if len(short) == 1 else [*lines[-1:], *wrapped(statement)]
    return lines


def indented(lines: Iterable[str]) -> list[str]:
    """Lines two columns further right."""
    return [f"  {line}" for line in lines]


@final
@dataclass(eq=False)
class Section:
    """Equations of a class, and the names of what long formulas repeat.

    :param names: what some symbols are written as.
    :param index: of the elements, in a loop.
    :param events: whether relations are events.
    """

    notation: Notation
    names: Mapping[str, str] = field(default_factory=dict)
    index: str = ""
    events: bool = True
    lines: list[str] = field(default_factory=list)  # one a statement
    unsaid: list[str] = field(default_factory=list)
    abbreviations: dict[str, str] = field(default_factory=dict)  # names by what they stand for

    @property
    def _letter(self) -> str:
        return self.notation.free_letter()

    @property
    def declared(self) -> list[str]:
        """Declarations of the abbreviations, and what is missing."""
        missing = [f"// too long, or not to be said in Modelica: {', '.join(self.unsaid)}"] if self.unsaid else []
        size = "[n]" * bool(self.index)
        names = [name + size for name in self.abbreviations.values()]
        return missing + (declared(*names, head="protected Real") if names else [])

    def written(self, right: ca.SX, longest: float = math.inf) -> str | None:
        """A formula, after the equations of its abbreviations; None if it is too long or cannot be said."""
        tree = formula(right, self.notation, longest, looser=1)
        if tree is None:
            return None
        local, uses = dict(self.names), Counter(_names(tree))
        definitions: dict[str, str] = {}
        try:
            for name, term in tree.where:
                text = expression(term, local, events=self.events)
                known = self.abbreviations | definitions
                if uses[name.name] > 1 or text in known:
                    definitions |= {} if text in known else {text: f"{self._letter}_{len(known) + 1}"}
                    local[name.name] = (known | definitions)[text] + self.index
                else:  # only too wide for a page
                    local[name.name] = f"({text})"
            result = expression(tree.term, local, events=self.events)
        except UnsupportedError:
            return None
        self.abbreviations |= definitions
        for text, name in definitions.items():
            self.lines.append(f"{name}{self.index} = {text};")
        return result

    def add(self, left: str, right: ca.SX, longest: float = math.inf) -> bool:
        """Write an equation unless its right side is too long or cannot be said; whether it is written."""
        text = self.written(right, longest)
        if text is None:
            self.unsaid.append(left)
            return False
        self.lines.append(f"{left} = {text};")
        return True


def wrapped(equation: str) -> list[str]:
    """Lines of one equation."""
    return textwrap.wrap(equation, WIDTH - 4, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)


def _names(tree: Formula) -> Iterator[str]:
    """Names in a formula and in the definitions of its abbreviations, as often as they stand there."""
    waiting: list[object] = [tree.term, *(term for _, term in tree.where)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Name):
            yield node.name
        elif isinstance(node, tuple):
            waiting += node
        elif is_dataclass(node):
            waiting += [getattr(node, member.name) for member in fields(node)]
