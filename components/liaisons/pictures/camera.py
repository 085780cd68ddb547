"""Orthographic projection of points; the live page has the same formulas."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import final

import numpy as np
from numpy.typing import NDArray

FACING = {"xz": (0.0, 0.0), "xy": (0.0, pi / 2), "yz": (pi / 2, 0.0), None: (-0.6, 0.35)}
"""Yaw and pitch [rad] of the camera that faces a plane, or looks at a spatial mechanism from above."""


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
