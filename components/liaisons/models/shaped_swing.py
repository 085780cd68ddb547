"""The general swing: any system that turns in one piece about an axis, from four functions of its shape."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from types import new_class

from liaisons.errors import ComponentError
from liaisons.language import ActiveCoordinate
from liaisons.models.general_swing import Function, GeneralSwing


def marle_swing(
    I: Function,  # noqa: E741 - the symbols of M eq. 54-56
    J: Function,
    g: Function,
    D: Function,
    *,
    shape: Mapping[str, ActiveCoordinate] | None = None,
    name: str = "MarleSwing",
) -> type[GeneralSwing]:
    """Make the swing of M 8.1 as a component, from four functions of the shape.

    Each function is called with the shape coordinates, one argument each, and returns numbers or CasADi expressions::

        Crouching = marle_swing(
            I=lambda length=1.0: 60 * length**2,
            J=lambda length: 0,
            g=lambda length: 60,
            D=lambda length: 60 * 9.81 * length,
        )

    :param I: moment of inertia about the axis [kg.m2].
    :param J: couplings J_α, one for each shape coordinate; a sequence, or a scalar where there is one.
    :param g: metric g_αβ of the shapes, rows of numbers; or a scalar.
    :param D: gravity times total mass times distance of the centre of mass from the axis [N.m].
    :param shape: names and declarations of the shape coordinates.  Without it they are the arguments of ``I``, with
        their default values (else 0) as start and no unit of their own.
    :param name: name of the component and of its FMU.
    :returns: a class as if it were written where ``I`` was defined; see :class:`GeneralSwing`.
    :raises ComponentError: if a function returns the wrong size, a name is taken, or I is not > 0 at the start.
    """
    coordinates = _shape_coordinates(I) if shape is None else dict(shape)
    for coordinate in coordinates:
        if hasattr(GeneralSwing, coordinate):
            raise ComponentError(f"{name}: a shape coordinate cannot be called {coordinate!r}; choose another name")
    if not coordinates:
        raise ComponentError(f"{name}: I takes no argument; give it one for each shape coordinate")
    functions = {"I": I, "J": J, "g": g, "D": D}
    for symbol, function in functions.items():
        try:
            inspect.signature(function).bind(*coordinates)
        except TypeError as error:
            names = ", ".join(coordinates)
            raise ComponentError(f"{name}: {symbol} must take the shape coordinates {names}: {error}") from None
    namespace = {"__module__": I.__module__, "functions": functions, **coordinates}
    return new_class(name, (GeneralSwing,), exec_body=lambda body: body.update(namespace))


def _shape_coordinates(function: Function) -> dict[str, ActiveCoordinate]:
    """Shape coordinates that the arguments of a function stand for."""
    arguments = inspect.signature(function).parameters.values()
    starts = {a.name: 0.0 if a.default is a.empty else a.default for a in arguments}
    return {name: ActiveCoordinate("1", f"shape coordinate {name}", start=start) for name, start in starts.items()}
