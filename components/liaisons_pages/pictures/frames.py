"""Positions of the shapes of a picture at each frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arguments import shown
from liaisons.errors import SimulationError
from liaisons.results import Picture

RATE = 30
"""Frames a second."""

FLASH = 6
"""Frames that a flash lasts."""
THICKNESS = 0.04
"""Thickness of a floor, as a fraction of its width."""

_SKEW = 1e-3
"""Allowed deviation of the axes of a box from orthonormal vectors: invisible."""
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))

Signal = Callable[[str], NDArray]
"""Values of a variable at the frames, (n,)."""


@final
@dataclass(frozen=True, eq=False)
class ShapeMotion:
    """One shape at n frames.

    :param kind: ``"rod"``, ``"ball"``, ``"box"``, ``"wire"``, ``"spring"``, ``"trail"``, ``"floor"`` or ``"flash"``; a
        rope is a wire.
    :param points: (n, k, 3) [m]: both ends of a rod or spring, all points of a wire, else the centre.
    :param axes: (n, 3, 3), unit vectors, of a box or floor, whose third is its normal.
    :param size: (n, 3) [m] of a box or floor; (n, 1), the radius, of a rod or ball that has one; of a flash its
        strength, 1 at the impact.
    :param closed: whether the last point of a wire is joined to the first.
    """

    kind: str
    points: NDArray
    axes: NDArray | None = None
    size: NDArray | None = None
    closed: bool = False

    @cached_property
    def closed_points(self) -> NDArray:
        """Points, (n, k, 3), with the first again at the end of a closed wire."""
        return np.concatenate([self.points, self.points[:, : int(self.closed)]], axis=1)

    @property
    def corners(self) -> NDArray:
        """Corners of a box or floor, (n, 8, 3); none of other shapes."""
        if self.axes is None or self.size is None:
            return self.points[:, :0]
        return self.points + _CORNERS @ (self.axes * self.size[:, :, None] / 2)


@final
@dataclass(frozen=True, eq=False)
class Frames:
    """Shapes at the times of n frames [s]."""

    time: NDArray
    shapes: tuple[ShapeMotion, ...]
    plane: str | None
    values: NDArray  # (n, variables), in the order of the picture's
    shifts: Sequence[float]  # of each shape along x [m], contained in its points, not in values

    @property
    def points(self) -> NDArray:
        """All points of all shapes, the corners of boxes among them, (n, k, 3)."""
        return np.concatenate([points for shape in self.shapes for points in (shape.points, shape.corners)], axis=1)


def picture_frames(
    picture: Picture, time: NDArray, signal: Signal, *, title: str, shifts: Sequence[float] | None = None
) -> Frames:
    """Frames of a picture at some times, in which groups of shapes are moved apart.

    :param title: for messages.
    :param shifts: of each shape along x [m]; None: what places the groups side by side at the first time.
    :raises SimulationError: if a coordinate is not finite, or the axes of a box are no right-handed unit vectors.
    """
    values = np.stack([signal(name) for name in picture.variables] or [np.zeros(len(time))], axis=1)
    invalid = np.argwhere(~(abs(values) <= Picture.LARGEST))  # not-a-number, too
    if picture.shapes and len(invalid):
        frame, column = invalid[0]
        value = f"{values[frame, column]:g}" if np.isfinite(values[frame, column]) else "not finite"
        raise SimulationError(
            f"{title}: {picture.variables[column]} in its picture is {value} at t = {time[frame]:g} s: "
            "nothing to draw there"
        )
    shapes = tuple(_shape_motion(shape, len(time), signal) for shape in picture.shapes)
    for axes in (shape.axes for shape in shapes if shape.axes is not None):
        skew = np.abs(axes @ np.swapaxes(axes, 1, 2) - np.eye(3)).max(axis=(1, 2))
        wrong = np.flatnonzero((skew > _SKEW) | (np.linalg.det(axes) < 0))
        if wrong.size:
            raise SimulationError(
                f"{title}: a box in its picture has axes {shown(axes[wrong[0]].tolist())} at t = {time[wrong[0]]:g} s: "
                "give three unit vectors at right angles, right-handed"
            )
    if shifts is None:
        shifts = _group_shifts(shapes, [shape.get("group", 0) for shape in picture.shapes])
    shifted = (
        replace(s, points=s.points + np.array([x, 0, 0])) if x else s for s, x in zip(shapes, shifts, strict=True)
    )
    return Frames(time, tuple(shifted), picture.plane, values, shifts)


def _group_shifts(shapes: Sequence[ShapeMotion], groups: Sequence[int]) -> Sequence[float]:
    """Shifts of shapes along x [m] that put their groups side by side, with room to swing."""
    right, shifts = None, {}
    for group in dict.fromkeys(groups):
        members = [shape for shape, number in zip(shapes, groups, strict=True) if number == group]
        points = np.concatenate([points[0] for shape in members for points in (shape.points, shape.corners)])
        low, high = points.min(axis=0), points.max(axis=0)
        centre, room = (low[0] + high[0]) / 2, 1.1 * (high - low).max() or 1.0
        shifts[group] = 0.0 if right is None else float(right + room - centre)
        right = centre + shifts[group] + room
    return [shifts[group] for group in groups]


def _shape_motion(shape: Mapping[str, Any], count: int, signal: Signal) -> ShapeMotion:
    """Motion of a declared shape over all frames."""

    def columns(coordinates: list[float | str]) -> NDArray:
        """Values of coordinates at the frames, (n, k)."""
        return np.stack([signal(x) if isinstance(x, str) else np.full(count, float(x)) for x in coordinates], axis=-1)

    ends = [shape[member] for member in ("from", "to", "at") if member in shape] or shape["points"]
    points = np.stack([columns(point) for point in ends], axis=1)
    if shape["shape"] == "rope":
        return ShapeMotion("wire", _rope_points(points, columns([shape["length"]])))
    if shape["shape"] == "floor":
        axes = _axes_along(columns(shape["normal"]))
        edges = columns([shape["width"]]) * (1, 1, THICKNESS)
        return ShapeMotion("floor", points - axes[:, 2:] * edges[:, None, 2:] / 2, axes, edges)
    if shape["shape"] == "flash":
        return ShapeMotion("flash", points, size=_flash_strength(columns([shape["count"]])))
    size = shape.get("size") or ([shape["radius"]] if "radius" in shape else None)
    return ShapeMotion(
        shape["shape"],
        points,
        axes=np.stack([columns(axis) for axis in shape["axes"]], axis=1) if "axes" in shape else None,
        size=None if size is None else columns(size),
        closed=shape.get("closed", False),
    )


def _rope_points(ends: NDArray, length: NDArray) -> NDArray:
    """Points (n, 17, 3) of a rope of a length (n, 1), a parabola below the line between its ends (n, 2, 3)."""
    part = np.linspace(0, 1, 17)[:, None]
    straight = ends[:, :1] + part * (ends[:, 1:] - ends[:, :1])

    def curve(sag: NDArray) -> NDArray:
        return straight - sag[:, None] * 4 * part * (1 - part) * np.array([0, 0, 1])

    sag = np.zeros_like(length)
    for k in range(2, 30):  # bisection: a deeper curve is longer, and any is longer than twice its sag
        deeper = sag + length / 2**k
        short = np.linalg.norm(np.diff(curve(deeper), axis=1), axis=2).sum(axis=1, keepdims=True) <= length
        sag = np.where(short, deeper, sag)
    return curve(sag)


def _axes_along(normal: NDArray) -> NDArray:
    """Orthonormal axes (n, 3, 3), the third along a normal (n, 3)."""

    def unit(vectors: NDArray) -> NDArray:
        return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)

    third = unit(normal)
    first = unit(np.cross(np.eye(3)[np.argmin(np.abs(third).max(axis=0))], third))  # the same axis at all times
    return np.stack([first, np.cross(third, first), third], axis=1)


def _flash_strength(count: NDArray) -> NDArray:
    """Strength of a flash, (n, 1), which falls from 1 where its count (n, 1) changes to 0 in :data:`FLASH` frames."""
    frame, whole = np.arange(len(count))[:, None], np.round(count)
    last = np.maximum.accumulate(np.where(np.diff(whole, axis=0, prepend=whole[:1]) != 0, frame, -FLASH))
    return np.maximum(1 - (frame - last) / FLASH, 0)
