"""What is seen of a frame, as polygons, what lies behind first."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from liaisons.pictures.camera import Camera, facing
from liaisons.pictures.frames import RATE, Frames, Moving

_TRAIL = 3 * RATE  # frames that a trail lasts
_COILS = 3, 9
COLOURS = {
    "rod": "#4b5b6b",
    "wire": "#8593a0",
    "spring": "#3f8f6b",
    "ball": "#c8532b",
    "box": "#4f83b5",
    "trail": "#c8532b",
}
_LIGHT = np.array([-0.35, -0.6, 0.72])
_ROUND = np.linspace(0, 2 * np.pi, 24, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_ROUND), np.sin(_ROUND)])

# Sizes where none is given, as fractions of the picture's extent.
ROD, BALL, WIRE, SPRING = 0.011, 0.035, 0.005, 0.03


class Face(NamedTuple):
    """A polygon of one colour."""

    depth: float  # larger towards the eye
    corners: NDArray  # (k, 2)
    colour: tuple[float, ...]  # RGBA


@final
class Stage:
    """The part of space that is seen, the same from frame to frame, and what is in it."""

    def __init__(self, frames: Frames, ghost: Frames | None = None) -> None:
        self.frames, self.ghost = frames, ghost
        points, camera = frames.points, facing(frames.plane)
        self.extent = float(np.max(np.linalg.norm(np.ptp(points, axis=1), axis=-1)))
        self.extent = self.extent or float(np.linalg.norm(np.ptp(points, axis=(0, 1)))) or 1.0
        low, high = points.min(axis=1), points.max(axis=1)
        self.follows = bool(np.linalg.norm(high.max(axis=0) - low.min(axis=0)) > 5 * self.extent)
        if not self.follows:  # else what wanders off is followed
            low, high = (np.broadcast_to(edge, high.shape) for edge in (low.min(axis=0), high.max(axis=0)))
        self.middle = (low + high) / 2  # (n, 3)
        seen = camera.see(points - self.middle[:, None])[..., :2]
        half = np.max(np.abs(seen), axis=(0, 1))
        if frames.plane is None:  # it may be seen from all sides
            half = np.full(2, np.max(np.linalg.norm(points - self.middle[:, None], axis=-1)))
        self.half = 1.1 * np.maximum(half, 0.3 * np.max(half)) + 0.05 * self.extent
        self.ratio = float(self.half[1] / self.half[0])

    def faces(self, k: int, turn: float = 0.0) -> list[Face]:
        """Polygons of the frame k, those behind first.

        :param turn: angle [rad] by which the camera has gone round a spatial mechanism.
        """
        camera = facing(self.frames.plane, turn)
        both = ((self.ghost, 0.3), (self.frames, 1.0))
        found = [f for frames, opacity in both if frames for f in self._faces(frames, k, camera, opacity)]
        return sorted(found, key=lambda face: face.depth)

    def _faces(self, frames: Frames, k: int, camera: Camera, opacity: float) -> Iterator[Face]:
        for shape in frames.shapes:
            first = max(0, k + 1 - _TRAIL) if shape.kind == "trail" else k
            seen = camera.see(shape.points[first : k + 1] - self.middle[k])
            radius = shape.size[k, 0] if shape.size is not None else None
            colour = (*_rgb(shape.kind), opacity)
            if shape.kind == "rod":
                yield _line(seen[-1, 0], seen[-1, 1], radius or ROD * self.extent, colour)
            elif shape.kind == "ball":
                yield from _ball(seen[-1, 0], radius or BALL * self.extent, colour)
            elif shape.kind == "box":
                yield from _box(seen[-1, 0], shape, k, camera, opacity)
            elif shape.kind == "wire":
                yield from _lines(seen[-1], WIRE * self.extent, colour, closed=shape.closed)
            elif shape.kind == "spring":
                coils = self.coils(shape)
                zigzag = _zigzag(seen[-1, 0], seen[-1, 1], SPRING * self.extent, coils)
                yield from _lines(zigzag, WIRE * self.extent, colour)
            else:
                yield from _fading(seen[:, 0], WIRE / 2 * self.extent, colour)

    def coils(self, spring: Moving) -> int:
        """How many a spring has; a short one of a chain has fewer."""
        length = float(np.linalg.norm(spring.points[0, 1] - spring.points[0, 0]))
        return min(max(round(30 * length / self.extent), _COILS[0]), _COILS[1])


def _rgb(kind: str) -> tuple[float, ...]:
    return tuple(byte / 255 for byte in bytes.fromhex(COLOURS[kind][1:]))


def _line(a: NDArray, b: NDArray, radius: float, colour: tuple[float, ...]) -> Face:
    """A line from a to b (3,) with round ends."""
    angle = np.arctan2(b[1] - a[1], b[0] - a[0]) + np.linspace(np.pi / 2, 3 * np.pi / 2, 7)
    end = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return Face((a[2] + b[2]) / 2, np.concatenate([a[:2] + end, b[:2] - end]), colour)


def _lines(points: NDArray, radius: float, colour: tuple[float, ...], *, closed: bool = False) -> Iterator[Face]:
    points = np.concatenate([points, points[:1]]) if closed else points
    return (_line(a, b, radius, colour) for a, b in pairwise(points))


def _ball(centre: NDArray, radius: float, colour: tuple[float, ...]) -> Iterator[Face]:
    yield Face(centre[2], centre[:2] + radius * _CIRCLE, colour)
    light = tuple(0.6 * c + 0.4 for c in colour[:3])
    yield Face(centre[2], centre[:2] + radius * ((-0.3, 0.3) + 0.35 * _CIRCLE), (*light, colour[3]))


def _box(centre: NDArray, shape: Moving, k: int, camera: Camera, opacity: float) -> Iterator[Face]:
    assert shape.axes is not None  # as for all boxes
    assert shape.size is not None
    edges = shape.axes[k] * shape.size[k, :, None] / 2
    seen = camera.see(edges)
    for i in range(3):
        a, b = seen[(i + 1) % 3], seen[(i + 2) % 3]
        for side in (1.0, -1.0):
            if side * seen[i, 2] <= 0:
                continue
            face = centre + side * seen[i]
            light = 0.55 + 0.45 * max(0.0, float(side * shape.axes[k, i] @ _LIGHT))
            corners = np.array([face + a + b, face + a - b, face - a - b, face - a + b])[:, :2]
            yield Face(face[2], corners, (*(light * c for c in _rgb("box")), opacity))


def _zigzag(a: NDArray, b: NDArray, width: float, coils: int) -> NDArray:
    along = b - a
    length = float(np.hypot(along[0], along[1])) or 1.0
    across = min(width, length / 6) * np.array([-along[1], along[0], 0]) / length
    part = np.concatenate([[0], np.linspace(0.12, 0.88, 2 * coils + 1), [1]])
    off = np.concatenate([[0, 0], np.resize([1, -1], 2 * coils - 1), [0, 0]])
    return a + part[:, None] * along + off[:, None] * across


def _fading(points: NDArray, radius: float, colour: tuple[float, ...]) -> Iterator[Face]:
    for i, (a, b) in enumerate(pairwise(points)):
        yield _line(a, b, radius, (*colour[:3], 0.7 * colour[3] * (i + 1) / len(points)))._replace(depth=-np.inf)
