"""The charge in uniform fields, v' = a + turn∧v: a turn across the magnetic field, uniform acceleration along it."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.stumpff import stumpff


@closed_form("helix, cycloid or parabola (K Ex. 4) for any fields and any start, without division by Ω")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    rotation = -at.charge / at.mass * at.array("B_x", "B_y", "B_z")
    a = at.charge / at.mass * at.array("E_x", "E_y", "E_z")
    r_0, v_0 = at.array("x_0", "y_0", "z_0"), at.array("x_dot_0", "y_dot_0", "z_dot_0")
    r, r_dot = _particle_motion(t, r_0, v_0, a, rotation)
    centre = _guiding_centre(t, r_0, v_0, a, rotation) if rotation.any() else r
    names = (form.format(axis) for form in ("{}", "{}_dot", "guiding_centre_{}") for axis in "xyz")
    return dict(zip(names, (*r, *r_dot, *centre), strict=True))


@closed_form("the velocity of the guiding centre across B, E∧B/B² [m/s], (3,): that of all masses and charges")
def drift(at: Values) -> NDArray:
    B, E = at.array("B_x", "B_y", "B_z"), at.array("E_x", "E_y", "E_z")
    at.require(np.any(B != 0), "B = 0; without a magnetic field nothing drifts")
    return np.cross(E, B) / (B @ B)


def _particle_motion(
    t: ArrayLike, r_0: NDArray, v_0: NDArray, acceleration: NDArray, rotation: NDArray
) -> tuple[NDArray, NDArray]:
    """Position r and velocity r' that solve r'' = acceleration + rotation∧r'.

    :param t: times since the start [s], any shape; the vectors have shape (3,).
    :returns: shape (3, ...) each.
    """
    times = np.asarray(t, dtype=float)[..., None]  # the last axis is that of the vectors
    rate = float(np.linalg.norm(rotation))
    c_1, c_2, c_3 = stumpff((rate * times) ** 2)
    axis = rotation / rate if rate > 0 else np.zeros(3)
    v_along, a_along = axis * (axis @ v_0), axis * (axis @ acceleration)
    v, a = v_0 - v_along, acceleration - a_along
    v_left, a_left = np.cross(rotation, v), np.cross(rotation, a)
    cosine = 1 - (rate * times) ** 2 * c_2
    r = r_0 + times * (v_along + c_1 * v) + times**2 * (a_along / 2 + c_2 * (v_left + a)) + times**3 * c_3 * a_left
    r_dot = v_along + cosine * v + times * (a_along + c_1 * (v_left + a)) + times**2 * c_2 * a_left
    return np.moveaxis(r, -1, 0), np.moveaxis(r_dot, -1, 0)


def _guiding_centre(t: ArrayLike, r_0: NDArray, v_0: NDArray, acceleration: NDArray, rotation: NDArray) -> NDArray:
    """Position of the centre about which the particle turns; the rotation must not be 0.

    :returns: shape (3, ...).
    """
    square = rotation @ rotation
    across = np.cross(rotation, acceleration) / square
    centre_0 = r_0 + np.cross(rotation, v_0 - across) / square
    rate, along = across + rotation * (rotation @ v_0) / square, rotation * (rotation @ acceleration) / square
    return _particle_motion(t, centre_0, rate, along, np.zeros(3))[0]
