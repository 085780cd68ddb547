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
NUMBERS = "the functions of the shape are given as bare numbers, in SI units"
"""Why units are not checked."""


class ShapedMechanism(Mechanism, abstract=True):
    """Mechanism with functions of shape coordinates, which the operator prescribes; abstract."""

    functions: ClassVar[Mapping[str, Function]] = {}

    def _value_of(self, name: str, rows: int = 1, columns: int = 1) -> ca.SX:
        """Value of the function of this name at the shape; raise a ComponentError if its size is another."""
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


def smallest_pivot(matrix: ca.SX) -> ca.SX:
    """Smallest pivot of Cholesky's decomposition, positive for a positive definite symmetric matrix."""
    pivots, _, _ = ca.ldl(ca.densify(matrix), False)
    return ca.mmin(pivots)


def component_of_shape(
    base: type[_Shaped], functions: Mapping[str, Function], shape: Mapping[str, ActiveCoordinate] | None, name: str
) -> type[_Shaped]:
    """Make a component from functions of its shape, in the module of the first function.

    :param functions: by symbol; each is called with the shape coordinates, one argument each.
    :param shape: names and declarations of these; without it they are the arguments of the first function, with their
        default values (else 0) as start and no unit of their own.
    :raises ComponentError: if a name is taken, there are no shape coordinates, or a function does not take them.
    """
    symbol, first = next(iter(functions.items()))
    coordinates = _shape_coordinates(first) if shape is None else dict(shape)
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


def _shape_coordinates(function: Function) -> dict[str, ActiveCoordinate]:
    """Shape coordinates with the names of a function's arguments; its defaults are their start values."""
    arguments = inspect.signature(function).parameters.values()
    starts = {a.name: 0.0 if a.default is a.empty else a.default for a in arguments}
    return {name: ActiveCoordinate("1", f"shape coordinate {name}", start=start) for name, start in starts.items()}
