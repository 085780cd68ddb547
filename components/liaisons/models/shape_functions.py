"""Mechanisms that are given by functions of their shape."""

import inspect
from collections.abc import Callable, Mapping
from types import new_class
from typing import Any, ClassVar, TypeVar

import casadi as ca

from liaisons.errors import ComponentError
from liaisons.language import ActiveCoordinate, Mechanism

Function = Callable[..., Any]
_Shaped = TypeVar("_Shaped", bound="ShapedMechanism")


class ShapedMechanism(Mechanism, abstract=True):
    """Mechanism with functions of shape coordinates, which the operator prescribes; abstract."""

    functions: ClassVar[Mapping[str, Function]] = {}

    def _value_of(self, name: str, rows: int = 1, columns: int = 1) -> ca.SX:
        """Value of one of the functions at the present shape, checked by its size."""
        value = self.functions[name](*ca.vertsplit(self.active.s))
        if isinstance(value, (list, tuple)):
            value = ca.vertcat(*(ca.horzcat(*row) if isinstance(row, (list, tuple)) else row for row in value))
        matrix = ca.SX(value)
        if matrix.shape != (rows, columns):
            raise ComponentError(
                f"{type(self).__name__}: {name} returns shape {matrix.shape}; for the shape coordinates "
                f"{', '.join(s.name for s in self.actives)} it must be {(rows, columns)}"
            )
        return matrix


def component_of_shape(
    base: type[_Shaped], functions: Mapping[str, Function], shape: Mapping[str, ActiveCoordinate] | None, name: str
) -> type[_Shaped]:
    """A component from functions of its shape, as if it were written where the first of them was defined.

    :param functions: by symbol; each is called with the shape coordinates, one argument each.
    :param shape: names and declarations of these; without it they are the arguments of the first function, with their
        default values (else 0) as start and no unit of their own.
    :raises ComponentError: if a name is taken, there are no shape coordinates, or a function does not take them.
    """
    symbol, first = next(iter(functions.items()))
    coordinates = _arguments(first) if shape is None else dict(shape)
    for coordinate in coordinates:
        if hasattr(base, coordinate):
            raise ComponentError(f"{name}: a shape coordinate cannot be called {coordinate!r}; choose another name")
    if not coordinates:
        raise ComponentError(f"{name}: {symbol} takes no argument; give it one for each shape coordinate")
    for symbol, function in functions.items():
        try:
            inspect.signature(function).bind(*coordinates)
        except TypeError as error:
            names = ", ".join(coordinates)
            raise ComponentError(f"{name}: {symbol} must take the shape coordinates {names}: {error}") from None
    namespace = {"__module__": first.__module__, "functions": functions, **coordinates}
    return new_class(name, (base,), exec_body=lambda body: body.update(namespace))


def _arguments(function: Function) -> dict[str, ActiveCoordinate]:
    """Shape coordinates with the names and defaults of the arguments of a function."""
    arguments = inspect.signature(function).parameters.values()
    starts = {a.name: 0.0 if a.default is a.empty else a.default for a in arguments}
    return {name: ActiveCoordinate("1", f"shape coordinate {name}", start=start) for name, start in starts.items()}
