"""Picture of a chain, link by link."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, final

import casadi as ca

from liaisons.algebra import stack
from liaisons.chains.chain import Chain
from liaisons.chains.rows import Vector, keys, substituted
from liaisons.language import Rod, Rope, Shape, Spring, element, shapes_of
from liaisons.mechanics import Drawing

_MOST_DRAWN_LINKS = 200
"""Number of links that are drawn; of a longer chain the first ones."""


def chain_picture(
    m: Chain, variables: Mapping[str, ca.SX], vectors: Mapping[str, Vector]
) -> tuple[Drawing, ca.Function | None]:
    """Drawing of a chain, and the function (t, y, u, k) → d of its new variables.

    :param variables: expressions by name, in the symbols of a link.
    :param vectors: t, y, u, k.
    """
    n, drawing, shapes, base = m.sizes["n"], Drawing(), shapes_of(m), m.base()
    whole = {name: ca.SX.sym(name, vector.offsets(n)[-1]) for name, vector in vectors.items()}
    flagged = (pair for v in vectors.values() for pair in zip(ca.vertsplit(v.entries), v.each, strict=True))
    of_links = keys(ca.vertcat(m.w, *(symbol for symbol, each in flagged if each)))
    names = {ca.SX(x).element_hash(): (name, bool(keys(x) & of_links)) for name, x in variables.items()}
    joint: list[tuple[float | str, ca.SX]] = []
    for number in range(1, min(n, _MOST_DRAWN_LINKS) + 1):
        link = _Link(number, names, drawing, [(m.number, ca.SX(number))])
        for name, vector in vectors.items():
            places = zip(vector.offsets(n), vector.each, strict=False)
            values = [whole[name][first + (number - 1 if each else 0)] for first, each in places]
            link.pairs.append((vector.entries, stack(values)))
        joint = link.ends(base) if number == 1 and base is not None else joint
        link.set_joint(m.w, joint)
        drawing.add(m, [shape for shape in shapes if joint or not _depends_on_joint(shape, m)], link.number_or_variable)
        joint = link.ends(m.tip())
    draw = ca.Function("draw", [*whole.values()], [stack(drawing.expressions)]) if drawing.expressions else None
    return drawing, draw


@final
@dataclass(eq=False)
class _Link:
    """A link of a chain."""

    number: int
    names: Mapping[int, tuple[str, bool]]  # of variables, by the keys of their expressions; whether an array
    drawing: Drawing
    pairs: list[tuple[ca.SX, ca.SX]]  # symbols of a link, and what they are of this one, in terms of the vectors
    joint: dict[int, float | str] = field(default_factory=dict)  # names where it begins

    def number_or_variable(self, value: Any) -> float | str:
        """Number of a constant; else name of the variable with this value at this link."""
        identity = ca.SX(value).element_hash()
        if identity in self.joint:
            return self.joint[identity]
        if identity in self.names:
            name, each = self.names[identity]
            return element(name, self.number) if each else name
        return self.drawing.number_or_variable(substituted(ca.SX(value), self.pairs))

    def ends(self, places: Mapping[str, ca.SX]) -> list[tuple[float | str, ca.SX]]:
        """Number or variable, and expression in whole vectors, of each component of a joint."""
        return [(self.number_or_variable(x), substituted(ca.SX(x), self.pairs)) for x in places.values()]

    def set_joint(self, w: ca.SX, ends: Iterable[tuple[float | str, ca.SX]]) -> None:
        """Set the components of the joint at which the link begins; none at a free end."""
        for symbol, (name, expression) in zip(ca.vertsplit(w), ends, strict=False):
            self.joint[symbol.element_hash()] = name
            self.pairs.append((symbol, expression))


def _depends_on_joint(shape: Shape, m: Chain) -> bool:
    """Whether a shape of a link ends at its joint, which the first link of a free end lacks."""
    places = (shape.start, shape.end) if isinstance(shape, Rod | Spring | Rope) else ()
    return any(ca.depends_on(ca.SX(component), m.w) for position in places for component in position.values())
