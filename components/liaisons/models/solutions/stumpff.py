"""Stumpff's functions c_k(z) = Σ_j (-z)^j / (k + 2j)!, which have no regimes: circular, straight and hyperbolic motion.

c_1(θ²) = sin θ / θ,   c_2(θ²) = (1 - cos θ) / θ²,   c_3(θ²) = (θ - sin θ) / θ³, and their hyperbolic counterparts for
negative arguments; 1, 1/2, 1/6 at 0.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

# of c_3, highest power first; for |z| < 1 the next term is below 1e-19
_SERIES = [(-1) ** j / factorial(3 + 2 * j) for j in reversed(range(9))]


def stumpff(z: ArrayLike) -> tuple[NDArray, NDArray, NDArray]:
    """c_1, c_2 and c_3, each with the shape of z; infinite where they overflow (z below -5e5)."""
    z = np.asarray(z, dtype=float)
    c_1 = _c_1(z)
    near = np.abs(z) < 1
    c_3 = np.where(near, np.polyval(_SERIES, np.where(near, z, 0.0)), (1 - c_1) / np.where(near, 1.0, z))
    return c_1, _c_1(z / 4) ** 2 / 2, c_3


def turning_motion(
    t: ArrayLike, r_0: NDArray, v_0: NDArray, acceleration: NDArray, turn: NDArray
) -> tuple[NDArray, NDArray]:
    """r and r' of r'' = acceleration + turn∧r', uniform: along the axis uniform acceleration, across it a turn.

    :param t: times since the start [s], any shape; the vectors have shape (3,).
    :returns: shape (3, ...) each.
    """
    times = np.asarray(t, dtype=float)[..., None]  # the last axis is that of the vectors
    rate = float(np.linalg.norm(turn))
    c_1, c_2, c_3 = stumpff((rate * times) ** 2)
    axis = turn / rate if rate > 0 else np.zeros(3)
    v_along, a_along = axis * (axis @ v_0), axis * (axis @ acceleration)
    v, a = v_0 - v_along, acceleration - a_along
    v_left, a_left = np.cross(turn, v), np.cross(turn, a)
    cosine = 1 - (rate * times) ** 2 * c_2
    r = r_0 + times * (v_along + c_1 * v) + times**2 * (a_along / 2 + c_2 * (v_left + a)) + times**3 * c_3 * a_left
    r_dot = v_along + cosine * v + times * (a_along + c_1 * (v_left + a)) + times**2 * c_2 * a_left
    return np.moveaxis(r, -1, 0), np.moveaxis(r_dot, -1, 0)


def centre_of_turns(t: ArrayLike, r_0: NDArray, v_0: NDArray, acceleration: NDArray, turn: NDArray) -> NDArray:
    """What a :func:`turning_motion` goes round, turn not 0: along the axis it goes with it, across it drifts evenly.

    :returns: shape (3, ...).
    """
    square = turn @ turn
    across = np.cross(turn, acceleration) / square
    centre_0 = r_0 + np.cross(turn, v_0 - across) / square
    rate, along = across + turn * (turn @ v_0) / square, turn * (turn @ acceleration) / square
    return turning_motion(t, centre_0, rate, along, np.zeros(3))[0]


def _c_1(z: NDArray) -> NDArray:
    theta = np.sqrt(np.abs(z))
    sine = np.where(z < 0, np.sinh(np.where(z < 0, theta, 0.0)), np.sin(theta))
    return np.divide(sine, theta, out=np.ones_like(theta), where=theta > 0)
