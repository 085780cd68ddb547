"""Positions of the shapes of a picture at each frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.arguments import shown
from liaisons.errors import SimulationError
from liaisons.pictures.declared import LARGEST, Picture

RATE = 30
"""Frames a second."""

_SKEW = 1e-3
"""Invisible deviation of the axes of a box from orthonormal vectors."""
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))

Signal = Callable[[str], NDArray]
"""Values of a variable at the frames, (n,)."""


@final
@dataclass(frozen=True, eq=False)
class Moving:
    """One shape at n frames.

    :param kind: ``"rod"``, ``"ball"``, ``"box"``, ``"wire"``, ``"spring"`` or ``"trail"``.
    :param points: (n, k, 3) [m]: both ends of a rod or spring, the centre of a ball, box or trail, all of a wire.
    :param axes: (n, 3, 3), unit vectors, of a box.
    :param size: (n, 3) [m] of a box; (n, 1), the radius, of a rod or ball that has one.
    :param closed: whether the last point of a wire is joined to the first.
    """

    kind: str
    points: NDArray
    axes: NDArray | None = None
    size: NDArray | None = None
    closed: bool = False

    @cached_property
    def path(self) -> NDArray:
        """The points, (n, k, 3), the first again at the end if it is closed."""
        return np.concatenate([self.points, self.points[:, : int(self.closed)]], axis=1)

    @property
    def corners(self) -> NDArray:
        """Corners of a box, (n, 8, 3); none of other shapes."""
        if self.axes is None or self.size is None:
            return self.points[:, :0]
        return self.points + _CORNERS @ (self.axes * self.size[:, :, None] / 2)


@final
@dataclass(frozen=True, eq=False)
class Frames:
    """Shapes at the times of n frames [s]."""

    time: NDArray
    shapes: tuple[Moving, ...]
    plane: str | None
    values: NDArray  # (n, variables), in the order of the picture's
    shifts: Sequence[float]  # of each shape along x [m], which its points have and values have not

    @property
    def points(self) -> NDArray:
        """All points of all shapes, the corners of boxes among them, (n, k, 3)."""
        return np.concatenate([points for shape in self.shapes for points in (shape.points, shape.corners)], axis=1)


def frames(
    picture: Picture, time: NDArray, signal: Signal, *, title: str, shifts: Sequence[float] | None = None
) -> Frames:
    """The shapes of a picture at some times, those of different groups side by side.

    :param title: for messages.
    :param shifts: of each shape along x [m]; else as the groups need at the first of the times.
    :raises SimulationError: if a coordinate is not finite, or the axes of a box are no right-handed unit vectors.
    """
    shapes = tuple(_moving(shape, len(time), signal) for shape in picture.shapes)
    values = np.stack([signal(name) for name in picture.variables] or [np.zeros(len(time))], axis=1)
    invalid = np.argwhere(~(abs(values) <= LARGEST))  # not-a-number, too
    if shapes and len(invalid):
        frame, column = invalid[0]
        value = f"{values[frame, column]:g}" if np.isfinite(values[frame, column]) else "not finite"
        raise SimulationError(
            f"{title}: {picture.variables[column]} in its picture is {value} at t = {time[frame]:g} s: "
            "nothing to draw there"
        )
    for axes in (shape.axes for shape in shapes if shape.axes is not None):
        skew = np.abs(axes @ np.swapaxes(axes, 1, 2) - np.eye(3)).max(axis=(1, 2))
        wrong = np.flatnonzero((skew > _SKEW) | (np.linalg.det(axes) < 0))
        if wrong.size:
            raise SimulationError(
                f"{title}: a box in its picture has axes {shown(axes[wrong[0]].tolist())} at t = {time[wrong[0]]:g} s: "
                "give three unit vectors at right angles, right-handed"
            )
    if shifts is None:
        shifts = _side_by_side(shapes, [shape.get("group", 0) for shape in picture.shapes])
    shifted = (
        replace(s, points=s.points + np.array([x, 0, 0])) if x else s for s, x in zip(shapes, shifts, strict=True)
    )
    return Frames(time, tuple(shifted), picture.plane, values, shifts)


def _side_by_side(shapes: Sequence[Moving], groups: Sequence[int]) -> Sequence[float]:
    """Shifts of shapes along x by what the groups before take at the start, with room to swing; as on live pages."""
    right, shifts = None, {}
    for group in dict.fromkeys(groups):
        members = [shape for shape, number in zip(shapes, groups, strict=True) if number == group]
        points = np.concatenate([points[0] for shape in members for points in (shape.points, shape.corners)])
        low, high = points.min(axis=0), points.max(axis=0)
        centre, room = (low[0] + high[0]) / 2, 1.1 * (high - low).max() or 1.0
        shifts[group] = 0.0 if right is None else float(right + room - centre)
        right = centre + shifts[group] + room
    return [shifts[group] for group in groups]


def _moving(shape: Mapping[str, Any], count: int, signal: Signal) -> Moving:
    def columns(coordinates: list[float | str]) -> NDArray:
        return np.stack([signal(x) if isinstance(x, str) else np.full(count, float(x)) for x in coordinates], axis=-1)

    ends = [shape[member] for member in ("from", "to", "at") if member in shape] or shape["points"]
    size = shape.get("size") or ([shape["radius"]] if "radius" in shape else None)
    return Moving(
        shape["shape"],
        np.stack([columns(point) for point in ends], axis=1),
        axes=np.stack([columns(axis) for axis in shape["axes"]], axis=1) if "axes" in shape else None,
        size=None if size is None else columns(size),
        closed=shape.get("closed", False),
    )
