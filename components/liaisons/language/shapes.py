"""Shapes of a mechanism's picture, which ``picture(self)`` returns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any, Literal, TypeAlias, final

import casadi as ca

VariableReference: TypeAlias = Mapping[str, Any]
"""A point's components [m] by axis, ``x`` to the right, ``y`` away, ``z`` up; those left out are 0."""

Number: TypeAlias = Any
"""A number, or an expression of the configuration and the parameters."""

Named = Callable[[Number], float | str]
"""Number, or name of the variable with this value."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Rod:
    """A straight rod between two points; its radius [m] is a fraction of the picture's extent unless given."""

    start: VariableReference
    end: VariableReference
    radius: Number | None = None

    def document(self, named: Named) -> dict[str, Any]:
        """Entry of the picture's file."""
        return {"shape": "rod", "from": _point(self.start, named), "to": _point(self.end, named)} | _radius(self, named)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """A ball about a point."""

    at: VariableReference
    radius: Number | None = None

    def document(self, named: Named) -> dict[str, Any]:
        """Entry of the picture's file."""
        return {"shape": "ball", "at": _point(self.at, named)} | _radius(self, named)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Box:
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

    def document(self, named: Named) -> dict[str, Any]:
        """Entry of the picture's file."""
        axes = [[named(self.axes[i, j]) for i in range(3)] for j in range(3)]
        return {"shape": "box", "at": _point(self.at, named), "axes": axes, "size": [named(s) for s in self.size]}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Wire:
    """A curve through points; closed: back to the first."""

    points: Sequence[VariableReference]
    closed: bool = False

    def document(self, named: Named) -> dict[str, Any]:
        """Entry of the picture's file."""
        return {"shape": "wire", "points": [_point(p, named) for p in self.points], "closed": self.closed}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Spring:
    """A coil spring between two points."""

    start: VariableReference
    end: VariableReference

    def document(self, named: Named) -> dict[str, Any]:
        """Entry of the picture's file."""
        return {"shape": "spring", "from": _point(self.start, named), "to": _point(self.end, named)}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trail:
    """Path of a point."""

    at: VariableReference

    def document(self, named: Named) -> dict[str, Any]:
        """Entry of the picture's file."""
        return {"shape": "trail", "at": _point(self.at, named)}


Shape: TypeAlias = Rod | Ball | Box | Wire | Spring | Trail
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


def _point(position: VariableReference, named: Named) -> list[float | str]:
    return [named(position.get(axis, 0.0)) for axis in _AXES]


def _radius(shape: Rod | Ball, named: Named) -> dict[str, float | str]:
    return {} if shape.radius is None else {"radius": named(shape.radius)}
