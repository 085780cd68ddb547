"""Shapes of a mechanism's picture, which ``picture(self)`` returns."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from math import cos, pi, sin
from typing import Any, Literal, TypeAlias, TypeVar, dataclass_transform, final

import casadi as ca

from liaisons.base.array_names import suffixed_name

VariableReference: TypeAlias = Mapping[str, Any]
"""A point's components [m] by axis, ``x`` to the right, ``y`` away, ``z`` up; those left out are 0."""

Number: TypeAlias = Any
"""A number, or an expression of the configuration and the parameters."""

Named = Callable[[Number], float | str]
"""Number, or name of the variable with this value."""


T = TypeVar("T")


@dataclass_transform(eq_default=False, frozen_default=True)
def _shape(cls: type[T]) -> type[T]:
    """Decorator of the class of a shape."""
    return dataclass(frozen=True, slots=True, eq=False)(cls)


class Drawn:
    """A shape; abstract."""

    __slots__ = ()

    def document(self, named: Named) -> dict[str, Any]:
        """Entry of the picture's file."""
        entry: dict[str, Any] = {"shape": type(self).__name__.lower()}
        for field in fields(self):  # pyright: ignore[reportArgumentType] - those of the dataclass
            name, value = field.name, getattr(self, field.name)
            if name in _POINTS:
                entry[_POINTS[name]] = _point(value, named)
            elif name != "radius" or value is not None:
                entry[name] = _written(value, named)
        return entry


@final
@_shape
class Rod(Drawn):
    """A straight rod between two points; its radius [m] is a fraction of the picture's extent unless given."""

    start: VariableReference
    end: VariableReference
    radius: Number | None = None


@final
@_shape
class Ball(Drawn):
    """A ball about a point."""

    at: VariableReference
    radius: Number | None = None


@final
@_shape
class Box(Drawn):
    """A box about a point.

    :param axes: its own axes as the columns of a rotation matrix (3, 3), e.g. that of an orientation.
    :param size: its lengths [m] along them.
    """

    at: VariableReference
    axes: ca.SX
    size: tuple[Number, Number, Number]

    def __post_init__(self) -> None:
        if getattr(self.axes, "shape", None) != (3, 3) or len(self.size) != 3:
            raise TypeError(
                "Box: axes are a rotation matrix (3, 3), e.g. turned('y', self.theta), and size has 3 lengths"
            )


@final
@_shape
class Wire(Drawn):
    """A curve through points; closed: back to the first."""

    points: Sequence[VariableReference]
    closed: bool = False


@final
@_shape
class Spring(Drawn):
    """A coil spring between two points."""

    start: VariableReference
    end: VariableReference


@final
@_shape
class Trail(Drawn):
    """Path of a point."""

    at: VariableReference


@final
@_shape
class Rope(Drawn):
    """A rope between two points; slack, it hangs in a curve of its length [m]."""

    start: VariableReference
    end: VariableReference
    length: Number


@final
@_shape
class Floor(Drawn):
    """A square plane about a point, hatched behind; a wall is one with another normal.

    :param normal: direction towards the bodies, by axis.
    :param width: [m].
    """

    at: VariableReference
    normal: VariableReference
    width: Number


@final
@_shape
class Flash(Drawn):
    """A flash at a point, after each impact at a unilateral liaison.

    :param liaison: its name.
    """

    at: VariableReference
    liaison: str

    def document(self, named: Named) -> dict[str, Any]:
        return {"shape": "flash", "at": _point(self.at, named), "count": suffixed_name(self.liaison, "_impacts")}


Shape: TypeAlias = Rod | Ball | Box | Wire | Spring | Trail | Rope | Floor | Flash
Shapes: TypeAlias = Sequence[Shape]

_AXES = ("x", "y", "z")


def turned(axis: Literal["x", "y", "z"], angle: Number) -> ca.SX:
    """Rotation matrix (3, 3) of a turn by an angle [rad] about an axis, by the right-hand rule."""
    c, s, i = ca.cos(angle), ca.sin(angle), _AXES.index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix = ca.SX.eye(3)
    matrix[j, j], matrix[k, k], matrix[j, k], matrix[k, j] = c, c, -s, s
    return matrix


def circle(centre: VariableReference, radius: Number, across: tuple[ca.SX, ca.SX], count: int = 48) -> Wire:
    """A circle about a point, spanned by two unit vectors (3,)."""
    a, b = across

    def position(angle: float) -> VariableReference:
        offset = radius * (cos(angle) * a + sin(angle) * b)
        return {axis: centre.get(axis, 0) + offset[i] for i, axis in enumerate(_AXES)}

    return Wire([position(2 * pi * i / count) for i in range(count)], closed=True)


_POINTS = {"start": "from", "end": "to", "at": "at", "normal": "normal"}


def _point(position: VariableReference, named: Named) -> list[float | str]:
    return [named(position.get(axis, 0.0)) for axis in _AXES]


def _written(value: Any, named: Named) -> Any:
    """Points, numbers, a matrix by columns, or a number."""
    if isinstance(value, Sequence):
        return [_point(item, named) if isinstance(item, Mapping) else named(item) for item in value]
    if getattr(value, "shape", ()) == (3, 3):
        return [[named(value[i, j]) for i in range(3)] for j in range(3)]
    return value if isinstance(value, bool) else named(value)
