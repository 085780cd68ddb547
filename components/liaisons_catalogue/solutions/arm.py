"""Torques of an arm at rest, by moments of the weights."""

import numpy as np
from scipy.spatial.transform import Rotation

from liaisons.closed_forms import Values, closed_form


@closed_form("torques that hold the weights at rest, the load hanging down")
def static_torques(at: Values) -> dict[str, float]:
    """Return ``axis_1_force``, ... [N.m] at the angles ``axis_1``, ..., by moments about the axes in space."""
    right = np.pi / 2
    places = [(0, 0, 0), (at.axis_2_at_x, 0, at.axis_2_at_z), (at.axis_3_at_x, 0, 0), (at.axis_4_at_x, 0, 0)]
    places += [(0, 0, at.axis_5_at_z), (0, 0, 0)]
    twists = map(Rotation.from_euler, "xxxyxx", (0, right, 0, right, right, -right))
    masses = at.array("base_mass", "upper_mass", "fore_mass", "wrist_1_mass", "wrist_2_mass", "flange_mass")
    centres = [(0, 0, at.base_centre_z), (at.upper_centre_x, 0, 0), (at.fore_centre_x, 0, at.fore_centre_z)]
    centres += [(0, 0, at.wrist_1_centre_z), (0, 0, 0), (0, 0, at.flange_centre_z)]
    R, origin = Rotation.identity(), np.zeros(3)
    axes, weights = [], []
    for k, (place, twist, mass, centre) in enumerate(zip(places, twists, masses, centres, strict=True), 1):
        origin, R = origin + R.apply(place), R * twist * Rotation.from_euler("z", getattr(at, f"axis_{k}"))
        axes.append((R.apply([0, 0, 1]), origin))
        weights.append((mass, origin + R.apply(centre)))
    weights.append((at.load_mass, origin + R.apply([0, 0, at.grip_at_z])))  # the load's centre hangs below its joint
    upwards = at.gravity * np.array([0, 0, 1.0])
    return {
        f"axis_{k}_force": float(axis @ sum(np.cross(r - o, m * upwards) for m, r in weights[k - 1 :]))
        for k, (axis, o) in enumerate(axes, 1)
    }
