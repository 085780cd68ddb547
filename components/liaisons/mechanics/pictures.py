"""Picture of a component: shapes whose coordinates are numbers or names of variables."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, final

import casadi as ca

from liaisons.base import units
from liaisons.errors import ComponentError, suggestion
from liaisons.language import Flash, MechanicalComponent, Named, Shape, Variable, element, shapes_of

_NEWER = {"rope", "floor", "flash"}  # than version 1.0 of resources/picture.json

_DRAWN = "picture"


@final
@dataclass(eq=False)
class Drawing:
    """Shapes for ``resources/picture.json``, and the variables of coordinates that only it needs."""

    names: dict[int, str] = field(default_factory=dict)  # of variables, by the keys of their expressions
    shapes: list[dict[str, Any]] = field(default_factory=list)
    expressions: list[ca.SX] = field(default_factory=list)

    def number_or_variable(self, value: Any) -> float | str:
        """Number of a constant; else name of the variable with this value, which is appended if there is none."""
        expression = ca.SX(value)
        if expression.is_constant():
            return float(expression)
        identity = expression.element_hash()
        if identity not in self.names:
            self.expressions.append(expression)
            self.names[identity] = element(_DRAWN, len(self.expressions))
        return self.names[identity]

    def add(self, m: MechanicalComponent, shapes: Iterable[Shape], named: Named) -> None:
        """Append shapes, with the numbers and names of variables that ``named`` returns for their coordinates.

        :raises ComponentError: if one holds what is not a scalar, or names no unilateral liaison.
        """
        liaisons = [liaison.name for liaison in m.unilaterals]
        for shape in shapes:
            if isinstance(shape, Flash) and shape.liaison not in liaisons:
                text = f"Flash: {shape.liaison!r} is not a unilateral liaison{suggestion(shape.liaison, liaisons)}"
                raise ComponentError(f"{type(m).__name__}.picture: {text}")
            try:
                self.shapes.append(shape.document(named))
            except (AttributeError, IndexError, NotImplementedError, TypeError, RuntimeError) as error:
                reason = (str(error).strip().splitlines() or [type(error).__name__])[-1]
                raise ComponentError(
                    f"{type(m).__name__}.picture: {type(shape).__name__}: {reason}; a point is given by its "
                    "components, {'x': ..., 'z': ...}"
                ) from None

    @property
    def document(self) -> Mapping[str, Any]:
        """Content of ``resources/picture.json``."""
        newer = any(shape["shape"] in _NEWER for shape in self.shapes)
        return {"version": "1.1" if newer else "1.0", "shapes": self.shapes}

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Variables that the picture alone needs: scalars, since importers of FMI 3.0 fail at local arrays."""
        text = "coordinate that only the picture needs, calculated when it is read"
        names = (element(_DRAWN, i) for i in range(1, len(self.expressions) + 1))
        return tuple(Variable(name, units.ANY, text, "local", "continuous") for name in names)


def mechanism_picture(m: MechanicalComponent, variables: Mapping[str, ca.SX]) -> Drawing:
    """Drawing of a mechanism by its method ``picture``.

    :param variables: expressions by name.
    :raises ComponentError: if it returns anything but shapes, or a shape holds what is not a scalar.
    """
    drawing = Drawing({ca.SX(expression).element_hash(): name for name, expression in variables.items()})
    drawing.add(m, shapes_of(m), drawing.number_or_variable)
    return drawing
