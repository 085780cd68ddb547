"""Polygons of a frame, sorted by depth, in an orthographic projection; the live page has the same formulas."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi, sin
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from liaisons_pages.pictures.frames import RATE, Frames, ShapeMotion

FACING = {"xz": (0.0, 0.0), "xy": (0.0, pi / 2), "yz": (pi / 2, 0.0), None: (-0.6, 0.35)}
"""Yaw and pitch [rad] of the camera that faces a plane, or looks at a spatial mechanism from above."""
_TRAIL = 3 * RATE  # frames that a trail lasts
COILS = 3, 9
"""Least and largest number of coils of a spring."""
COLOURS = {
    "rod": "#4b5b6b",
    "wire": "#8593a0",
    "spring": "#3f8f6b",
    "ball": "#c8532b",
    "box": "#4f83b5",
    "trail": "#c8532b",
    "floor": "#8593a0",
    "flash": "#f2b632",
}
LIGHT = (-0.35, -0.6, 0.72)
"""Direction to the light."""
_ROUND = np.linspace(0, 2 * pi, 24, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_ROUND), np.sin(_ROUND)])

_STAR = _CIRCLE * np.resize([1, 0.35], (24, 1))
TEETH = 24
"""Lines that hatch a floor."""

SIZES = {"rod": 0.011, "ball": 0.035, "wire": 0.005, "spring": 0.03, "trail": 0.0025, "flash": 0.06}
"""Default radius of each kind of shape, as a fraction of the extent of the picture."""


@final
@dataclass(frozen=True)
class Camera:
    """A direction of view, without perspective.

    :param yaw: angle [rad] of the eye about the vertical, from -y towards x.
    :param pitch: angle [rad] of the eye above the horizon.
    """

    yaw: float
    pitch: float

    def project(self, points: NDArray) -> NDArray:
        """Coordinates of points (..., 3) to the right, up and towards the eye."""
        return points @ self.axes.T

    @property
    def axes(self) -> NDArray:
        """Rows: unit vectors to the right, up, and towards the eye."""
        cy, sy, cp, sp = cos(self.yaw), sin(self.yaw), cos(self.pitch), sin(self.pitch)
        return np.array([[cy, sy, 0.0], [-sp * sy, sp * cy, cp], [sy * cp, -cy * cp, sp]])


def camera_facing(plane: str | None, angle: float = 0.0) -> Camera:
    """Camera that faces a plane, or for None looks at a spatial mechanism from an angle [rad]."""
    yaw, pitch = FACING[plane]
    return Camera(yaw + (angle if plane is None else 0.0), pitch)


Colour = tuple[float, ...]
"""Red, green, blue and, of a face, opacity, from 0 to 1."""


class Face(NamedTuple):
    """A polygon of one colour."""

    depth: float  # larger towards the eye
    corners: NDArray  # (k, 2)
    colour: Colour


@final
class Stage:
    """Frames and the visible part of space, of one size in all frames.

    :param ghost: a second motion, drawn pale.
    """

    def __init__(self, frames: Frames, ghost: Frames | None = None) -> None:
        self.frames, self.ghost = frames, ghost
        points, camera = frames.points, camera_facing(frames.plane)
        self.extent = float(np.max(np.linalg.norm(np.ptp(points, axis=1), axis=-1)))
        self.extent = self.extent or float(np.linalg.norm(np.ptp(points, axis=(0, 1)))) or 1.0
        low, high = points.min(axis=1), points.max(axis=1)
        if np.linalg.norm(high.max(axis=0) - low.min(axis=0)) <= 5 * self.extent:  # else a mechanism is followed
            low, high = (np.broadcast_to(edge, high.shape) for edge in (low.min(axis=0), high.max(axis=0)))
        self.middle = (low + high) / 2  # (n, 3)
        projected = camera.project(points - self.middle[:, None])[..., :2]
        half = np.max(np.abs(projected), axis=(0, 1))
        if frames.plane is None:  # seen from all sides
            half = np.full(2, np.max(np.linalg.norm(points - self.middle[:, None], axis=-1)))
        self.half = 1.1 * np.maximum(half, 0.3 * np.max(half)) + 0.05 * self.extent
        self.ratio = float(self.half[1] / self.half[0])

    def faces(self, k: int, angle: float = 0.0) -> list[Face]:
        """Polygons of the frame k, those behind first.

        :param angle: rotation of the camera about a spatial mechanism [rad].
        """
        camera = camera_facing(self.frames.plane, angle)
        faces = list(self._shape_faces(self.frames, k, camera, 1.0))
        if self.ghost is not None:
            faces = [*self._shape_faces(self.ghost, k, camera, 0.3), *faces]
        return sorted(faces, key=lambda face: face.depth)

    def _shape_faces(self, frames: Frames, k: int, camera: Camera, opacity: float) -> Iterator[Face]:
        """Yield the polygons of all shapes in the frame k."""
        for shape in frames.shapes:
            if shape.axes is not None:
                floor = shape.kind == "floor"
                paint = self._hatching if floor and frames.plane is not None else _box_faces
                faces = paint(camera.project(shape.points[k, 0] - self.middle[k]), shape, k, camera, opacity)
                # No body is behind a floor: it hides all, or nothing.
                depth = np.copysign(np.inf, -1e-9 - camera.axes[2] @ shape.axes[k, 2])
                yield from (face._replace(depth=depth) if floor else face for face in faces)
                continue
            first = max(0, k + 1 - _TRAIL) if shape.kind == "trail" else k
            points = camera.project(shape.closed_points[first : k + 1] - self.middle[k])
            radius, colour = self.radius(shape)[k, 0], (*rgb(shape.kind), opacity)
            if shape.kind == "ball":
                yield from _ball_faces(points[-1, 0], radius, colour)
            elif shape.kind == "flash" and radius:
                yield Face(-np.inf, points[-1, 0, :2] + radius * _STAR, colour)
            elif shape.kind == "trail":
                yield from _trail_faces(points[:, 0], radius, colour)
            elif shape.kind == "spring":
                zigzag = _zigzag_points(points[-1, 0], points[-1, 1], radius, self.coil_count(shape))
                yield from _segment_faces(zigzag, SIZES["wire"] * self.extent, colour)
            else:
                yield from _segment_faces(points[-1], radius, colour)

    def _hatching(self, centre: NDArray, shape: ShapeMotion, k: int, camera: Camera, opacity: float) -> Iterator[Face]:
        """Yield the lines of a floor that the camera sees from its side."""
        assert shape.axes is not None  # as for all floors
        assert shape.size is not None
        up = camera.project(shape.axes[k, 2])
        step = shape.size[k, 0] / TEETH
        along = step * np.array([up[1], -up[0], 0])
        edge = centre + shape.size[k, 2] / 2 * up + np.arange(-TEETH / 2, TEETH / 2 + 1)[:, None] * along
        radius, colour = SIZES["wire"] * self.extent, (*rgb("floor"), opacity)
        yield _line_face(edge[0], edge[-1], radius, colour)
        yield from (_line_face(a, a - along - shape.size[k, 2] * up, radius / 2, colour) for a in edge[1:])

    def radius(self, shape: ShapeMotion) -> NDArray:
        """Radius [m] at each frame of a shape without axes, (n, 1); 0 for a flash that is over."""
        default = np.broadcast_to(SIZES[shape.kind] * self.extent, (len(shape.points), 1))
        if shape.kind == "flash":
            return default * shape.size
        return default if shape.size is None else np.where(shape.size > 0, shape.size, default)

    def coil_count(self, spring: ShapeMotion) -> int:
        """Number of coils of a spring; a short one of a chain has fewer."""
        length = float(np.linalg.norm(spring.points[0, 1] - spring.points[0, 0]))
        return min(max(round(30 * length / self.extent), COILS[0]), COILS[1])


def rgb(kind: str) -> Colour:
    """Colour of a kind of shape in sRGB, with components from 0 to 1."""
    return tuple(byte / 255 for byte in bytes.fromhex(COLOURS[kind][1:]))


def _line_face(a: NDArray, b: NDArray, radius: float, colour: Colour) -> Face:
    """Polygon of a line from a to b (3,) with round ends."""
    angle = np.arctan2(b[1] - a[1], b[0] - a[0]) + np.linspace(pi / 2, 3 * pi / 2, 7)
    end = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return Face((a[2] + b[2]) / 2, np.concatenate([a[:2] + end, b[:2] - end]), colour)


def _segment_faces(points: NDArray, radius: float, colour: Colour) -> Iterator[Face]:
    """Polygons of lines between consecutive points."""
    return (_line_face(a, b, radius, colour) for a, b in pairwise(points))


def _ball_faces(centre: NDArray, radius: float, colour: Colour) -> Iterator[Face]:
    """Yield a disc and its highlight."""
    yield Face(centre[2], centre[:2] + radius * _CIRCLE, colour)
    light = tuple(0.6 * c + 0.4 for c in colour[:3])
    yield Face(centre[2], centre[:2] + radius * ((-0.3, 0.3) + 0.35 * _CIRCLE), (*light, colour[3]))


def _box_faces(centre: NDArray, shape: ShapeMotion, k: int, camera: Camera, opacity: float) -> Iterator[Face]:
    """Yield the three faces of a box that the eye sees."""
    assert shape.axes is not None  # as for all boxes
    assert shape.size is not None
    edges = shape.axes[k] * shape.size[k, :, None] / 2
    seen = camera.project(edges)
    for i in np.flatnonzero(seen[:, 2]):  # of both faces across an axis, the one towards the eye
        side = np.sign(seen[i, 2])
        a, b, face = seen[(i + 1) % 3], seen[(i + 2) % 3], centre + side * seen[i]
        light = 0.55 + 0.45 * max(0.0, float(side * shape.axes[k, i] @ np.array(LIGHT)))
        corners = np.array([face + a + b, face + a - b, face - a - b, face - a + b])[:, :2]
        yield Face(face[2], corners, (*(light * c for c in rgb(shape.kind)), opacity))


def _zigzag_points(a: NDArray, b: NDArray, width: float, coils: int) -> NDArray:
    """Points of a spring from a to b."""
    along = b - a
    length = float(np.hypot(along[0], along[1])) or 1.0
    across = min(width, length / 6) * np.array([-along[1], along[0], 0]) / length
    part = np.concatenate([[0], np.linspace(0.12, 0.88, 2 * coils + 1), [1]])
    off = np.concatenate([[0, 0], np.resize([1, -1], 2 * coils - 1), [0, 0]])
    return a + part[:, None] * along + off[:, None] * across


def _trail_faces(points: NDArray, radius: float, colour: Colour) -> Iterator[Face]:
    """Yield the lines of a trail, the older the paler."""
    for i, (a, b) in enumerate(pairwise(points)):
        yield _line_face(a, b, radius, (*colour[:3], 0.7 * colour[3] * (i + 1) / len(points)))._replace(depth=-np.inf)
