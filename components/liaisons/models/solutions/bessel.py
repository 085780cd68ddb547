"""The pendulum of small angle whose length grows or shrinks at a constant rate."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv, yv


def lengthening_pendulum(
    t: ArrayLike, angle: float, rate: float, *, length: float, speed: float, gravity: float
) -> tuple[NDArray, NDArray]:
    """Angle and rate of (l² θ')' = -g l θ with l = length + speed · t: θ = (A J1(x) + B Y1(x))/x, x = 2 √(g l)/|l'|.

    :param t: times since the start [s], any shape, with l > 0.
    :param speed: l' [m/s], not 0.
    """
    J, Y, J_dot, Y_dot, wronskian = _solutions(np.asarray(length), speed, gravity)
    A = (angle * Y_dot - rate * Y) / wronskian
    B = (rate * J - angle * J_dot) / wronskian
    J, Y, J_dot, Y_dot, _ = _solutions(length + speed * np.asarray(t, dtype=float), speed, gravity)
    return A * J + B * Y, A * J_dot + B * Y_dot


def _solutions(length: NDArray, speed: float, gravity: float) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Both solutions J1(x)/x and Y1(x)/x, their time derivatives, and their Wronskian 2 x'/(π x³)."""
    x = 2 * np.sqrt(gravity * length) / abs(speed)
    x_dot = 2 * gravity / (x * speed)
    J_dot, Y_dot = -jv(2, x) / x * x_dot, -yv(2, x) / x * x_dot
    return jv(1, x) / x, yv(1, x) / x, J_dot, Y_dot, 2 * x_dot / (np.pi * x**3)
