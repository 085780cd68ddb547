"""Torques of an arm at rest, by moments of the weights."""

import numpy as np
from numpy.typing import NDArray

from liaisons.language import Values, closed_form


@closed_form("torques that hold the weights at rest, the load hanging down")
def static_torques(at: Values) -> dict[str, float]:
    """At the angles ``axis_1``, ...: ``axis_1_force``, ... [N.m], by moments about the axes in space."""
    right = np.pi / 2
    places = [(0, 0, 0), (at.axis_2_at_x, 0, at.axis_2_at_z), (at.axis_3_at_x, 0, 0), (at.axis_4_at_x, 0, 0)]
    places += [(0, 0, at.axis_5_at_z), (0, 0, 0)]
    twists = [np.eye(3), _turn(0, right), np.eye(3), _turn(1, right), _turn(0, right), _turn(0, -right)]
    masses = at.array("base_mass", "upper_mass", "fore_mass", "wrist_1_mass", "wrist_2_mass", "flange_mass")
    centres = [(0, 0, at.base_centre_z), (at.upper_centre_x, 0, 0), (at.fore_centre_x, 0, at.fore_centre_z)]
    centres += [(0, 0, at.wrist_1_centre_z), (0, 0, 0), (0, 0, at.flange_centre_z)]
    R, origin = np.eye(3), np.zeros(3)
    axes, origins, weights, points = [], [], [], []
    for k, (place, twist, mass, centre) in enumerate(zip(places, twists, masses, centres, strict=True), 1):
        origin, R = origin + R @ place, R @ twist @ _turn(2, getattr(at, f"axis_{k}"))
        axes.append(R[:, 2])
        origins.append(origin)
        points.append(origin + R @ centre)
        weights.append(mass)
    points.append(origin + R @ (0, 0, at.grip_at_z))  # there the load pulls, whose centre hangs below
    weights.append(at.load_mass)
    upwards = at.gravity * np.array([0, 0, 1.0])
    moments = (
        sum(np.cross(r - o, m * upwards) for r, m in zip(points[k:], weights[k:], strict=True))
        for k, o in enumerate(origins)
    )
    return {
        f"axis_{k}_force": float(axis @ moment) for k, (axis, moment) in enumerate(zip(axes, moments, strict=True), 1)
    }


def _turn(axis: int, angle: float) -> NDArray:
    """Rotation matrix of a turn about x, y or z."""
    c, s, j, k = np.cos(angle), np.sin(angle), (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[j, j], matrix[k, k], matrix[j, k], matrix[k, j] = c, c, -s, s
    return matrix
