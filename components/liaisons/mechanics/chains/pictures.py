"""The picture of a chain: that of a link, link by link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import casadi as ca

from liaisons.expressions.algebra import stack
from liaisons.language.chain import Chain
from liaisons.language.shapes import Rod, Shape, Spring
from liaisons.language.variables import element
from liaisons.mechanics.pictures import Drawing, Drawn, documents, shapes_of

MOST_LINKS = 200
"""Of a longer chain the first ones are drawn."""

Vectors: TypeAlias = Mapping[str, tuple[ca.SX, Sequence[bool]]]
"""t, y, u, k: the symbols that make them up, and whether one stands for a number of each link."""


@final
@dataclass(frozen=True, eq=False)
class _Link:
    """What the symbols of a link are for one of the links.

    :param names: of variables by the identity of their expressions, without an index.
    :param joint: for each symbol of the joint its name, or its number, and the expression; empty at a free end.
    """

    number: int
    names: Mapping[int, tuple[str, bool]]
    symbols: ca.SX
    values: ca.SX
    joint: Mapping[int, tuple[float | str, ca.SX]]
    drawn: Drawn

    def value(self, expression: ca.SX) -> ca.SX:
        """An expression in the symbols of a link, as one of the vectors."""
        return ca.substitute(expression, self.symbols, self.values)

    def named(self, value: Any) -> float | str:
        """The number itself, or the name of the variable that has it."""
        identity = ca.SX(value).element_hash()
        if identity in self.joint:
            return self.joint[identity][0]
        if identity in self.names:
            name, each = self.names[identity]
            return element(name, self.number) if each else name
        expression = self.value(ca.SX(value))
        return float(expression) if expression.is_constant() else self.drawn.name(expression)


def chain_picture(m: Chain, known: Mapping[str, ca.SX], vectors: Vectors) -> tuple[Drawing, ca.Function | None]:
    """What is drawn, and the function (t, y, u, k) → d of what only the picture needs.

    :param m: the symbols of a link.
    :param known: expressions of variables, by name, in these symbols.
    """
    n, drawn, found = m.sizes["n"], Drawn(), []
    whole = {name: ca.SX.sym(name, sum(n if each else 1 for each in of)) for name, (_, of) in vectors.items()}
    each_link = {
        x.element_hash()
        for column_, of in vectors.values()
        for x, each in zip(ca.vertsplit(column_), of, strict=True)
        if each
    } | {w.element_hash() for w in ca.vertsplit(m.w)}
    names = {
        ca.SX(x).element_hash(): (name, any(symbol.element_hash() in each_link for symbol in ca.symvar(ca.SX(x))))
        for name, x in known.items()
    }
    shapes, base, joint = shapes_of(m), m.base(), {}
    for number in range(1, min(n, MOST_LINKS) + 1):
        link = _Link(number, names, *_values(m, vectors, whole, number, joint), joint, drawn)
        if number == 1 and base is not None:
            joint = _joint(m, base, link)
            link = _Link(number, names, *_values(m, vectors, whole, number, joint), joint, drawn)
        found += documents(m, [shape for shape in shapes if joint or not _hangs(shape, m)], link.named)
        joint = _joint(m, m.tip(), link)
    draw = ca.Function("draw", [*whole.values()], [stack(drawn.expressions)]) if drawn.expressions else None
    return Drawing(tuple(found), tuple(drawn.expressions)), draw


def _joint(m: Chain, end: Mapping[str, ca.SX], link: _Link) -> dict[int, tuple[float | str, ca.SX]]:
    """Where a link begins that hangs on the end of another, or on the base."""
    ends = zip(ca.vertsplit(m.w), ca.vertsplit(stack(map(ca.SX, end.values()))), strict=True)
    return {w.element_hash(): (link.named(x), link.value(x)) for w, x in ends}


def _values(
    m: Chain, vectors: Vectors, whole: Mapping[str, ca.SX], number: int, joint: Mapping[int, tuple[float | str, ca.SX]]
) -> tuple[ca.SX, ca.SX]:
    """Symbols of a link, and what they are for one."""
    n, symbols, values = m.sizes["n"], [m.number], [ca.SX(number)]
    for name, (column_, of) in vectors.items():
        first = 0
        for symbol, each in zip(ca.vertsplit(column_), of, strict=True):
            symbols.append(symbol)
            values.append(whole[name][first + (number - 1 if each else 0)])
            first += n if each else 1
    hung = [(w, joint[w.element_hash()][1]) for w in ca.vertsplit(m.w) if joint]
    return stack([*symbols, *(w for w, _ in hung)]), stack([*values, *(x for _, x in hung)])


def _hangs(shape: Shape, m: Chain) -> bool:
    """Whether a shape begins at the joint, which the first link of a free end has not."""
    places = (shape.start, shape.end) if isinstance(shape, Rod | Spring) else ()
    return any(ca.depends_on(ca.SX(component), m.w) for place in places for component in place.values())
