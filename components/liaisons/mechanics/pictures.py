"""The picture of a component: shapes whose coordinates are numbers or names of variables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, final

import casadi as ca

from liaisons import units
from liaisons.errors import ComponentError
from liaisons.language.checks import call
from liaisons.language.component import Component
from liaisons.language.shapes import Named, Shape
from liaisons.language.variables import Dimension, Variable, element

VERSION = "1.0"
"""Of the form of ``resources/picture.json``."""

_DRAWN = "picture"


@final
@dataclass(frozen=True, eq=False)
class Drawing:
    """What is drawn, for ``resources/picture.json``, and what it needs beside what can be read anyway."""

    shapes: tuple[dict[str, Any], ...]
    expressions: tuple[ca.SX, ...]

    @property
    def document(self) -> Mapping[str, Any]:
        """The content of the file."""
        return {"version": VERSION, "shapes": list(self.shapes)}

    @property
    def variables(self) -> tuple[Variable, ...]:
        """An array of the coordinates that no other variable has."""
        if not self.expressions:
            return ()
        size = Dimension("", len(self.expressions), "")
        text = "coordinates that only the picture needs, calculated when they are read"
        return (Variable(_DRAWN, units.ANY, text, "local", "continuous", dimension=size),)


@final
@dataclass(eq=False)
class Drawn:
    """Expressions that only the picture needs, each once, in an array of their own."""

    expressions: list[ca.SX] = field(default_factory=list)
    names: dict[int, str] = field(default_factory=dict)  # by the identity of the expression

    def name(self, expression: ca.SX) -> str:
        """The name of its place."""
        identity = expression.element_hash()
        if identity not in self.names:
            self.expressions.append(expression)
            self.names[identity] = element(_DRAWN, len(self.expressions))
        return self.names[identity]


def mechanism_picture(m: Component, known: Mapping[str, ca.SX]) -> Drawing:
    """What the method ``picture`` of a mechanism draws.

    :param m: its symbols.
    :param known: expressions of variables, by name.
    :raises ComponentError: if it returns anything but shapes, or a shape holds what is no scalar.
    """
    names = {ca.SX(expression).element_hash(): name for name, expression in known.items()}
    drawn = Drawn()

    def named(value: Any) -> float | str:
        expression = ca.SX(value)
        if expression.is_constant():
            return float(expression)
        return names.get(expression.element_hash()) or drawn.name(expression)

    return Drawing(tuple(documents(m, shapes_of(m), named)), tuple(drawn.expressions))


def shapes_of(m: Component) -> Sequence[Shape]:
    """What the method returns.

    :raises ComponentError: if it is anything but shapes.
    """
    shapes = call(m, "picture")
    if isinstance(shapes, Sequence) and all(isinstance(shape, Shape) for shape in shapes):
        return shapes
    raise ComponentError(
        f"{type(m).__name__}.picture returns {shapes!r}; return a list of Rod, Ball, Box, Wire, Spring, Trail"
    )


def documents(m: Component, shapes: Iterable[Shape], named: Named) -> Iterator[dict[str, Any]]:
    """Shapes as they stand in the file.

    :raises ComponentError: if one holds what is no scalar.
    """
    for shape in shapes:
        try:
            yield shape.document(named)
        except (AttributeError, IndexError, NotImplementedError, TypeError, RuntimeError) as error:
            reason = (str(error).strip().splitlines() or [type(error).__name__])[-1]
            raise ComponentError(
                f"{type(m).__name__}.picture: {type(shape).__name__}: {reason}; a point is given by its components, "
                "{'x': ..., 'z': ...}"
            ) from None
