"""Turns of the cat without angular momentum and twist (M 8.2): about a + b, which keeps its direction, by χ alone."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

from liaisons.closed_forms import Values, closed_form
from liaisons.language import Orientation
from liaisons_catalogue.solutions import rotations
from liaisons_catalogue.solutions.linear import coordinate_motion


@closed_form("the angle Φ [rad] by which χ turns the cat about a + b, once round at constant bend")
def turn(bend: float, at: Values) -> float:
    c, s = np.cos(bend / 2), np.sin(bend / 2)
    return float(2 * np.pi * at.inertia_axial * c / (at.inertia_transverse * s**2 + at.inertia_axial * c**2))


@closed_form("free fall, and without momentum and twist, at constant bend, a turn that χ alone determines")
def exact(t: NDArray, at: Values, *, azimuth: ArrayLike, azimuth_0: float = 0.0) -> dict[str, NDArray]:
    """Return com_z and the attitude of half A; χ is ``azimuth`` [rad] at the times, ``azimuth_0`` at the start."""
    chi = np.asarray(azimuth, dtype=float)
    psi = turn(at.bend, at) * (chi - azimuth_0) / (2 * np.pi)
    angles = azimuth_0, at.bend / 2, psi, -at.bend / 2, -chi
    q = rotations.product(*map(rotations.about_axis, (2, 0, 2, 0, 2), angles))
    fall = coordinate_motion(t, at, "com_z", forces=[(-at.gravity, 0.0)])
    return fall | dict(zip(Orientation.quaternion, q, strict=True))


@closed_form("the bend [rad] that turns the cat by Φ once round: (I - J) Φ c² + 2π J c = I Φ")
def bend_for(turn: float, at: Values) -> float:
    """Return the bend; there is one for 0 < ``turn`` <= 2π and I >= J."""
    I, J = at.inertia_transverse, at.inertia_axial  # noqa: E741
    at.require(0 < turn <= 2 * np.pi and I >= J, f"turn = {turn} must be > 0, <= 2π, and I >= J")
    return float(2 * np.arccos(I * turn / (np.pi * J + np.sqrt((np.pi * J) ** 2 + (I - J) * I * turn**2))))


@closed_form(
    "the direction of a + b in the frame of half A, which without twist and momentum stays where it is in space"
)
def bisector(bend: ArrayLike, azimuth: ArrayLike) -> NDArray:
    """Return the vector for angles ``bend`` and ``azimuth`` [rad] of any shape; shape (..., 3)."""
    half, chi = np.asarray(bend) / 2, np.asarray(azimuth)
    return np.stack(np.broadcast_arrays(np.sin(half) * np.sin(chi), -np.sin(half) * np.cos(chi), np.cos(half)), axis=-1)


@closed_form("the turn [rad] about a + b when b goes once round a cone tilted against a: Kane and Scher's integral")
def cone_turn(at: Values, *, tilt: float, half_angle: float) -> float:
    """Return the turn for a cone whose ``half_angle`` [rad] exceeds the ``tilt`` of its axis [rad]."""
    ratio = at.inertia_axial / at.inertia_transverse
    (s, c), (sb, cb) = ((np.sin(angle), np.cos(angle)) for angle in (tilt, half_angle))

    def rate(theta: float) -> float:
        """Integrand of Kane and Scher's integral."""
        T = c * cb - s * sb * np.cos(theta)
        S = -sb * (c * sb + s * cb * np.cos(theta))
        return ratio * S * np.sqrt(2 / (1 + T)) / ((T - 1) * (1 - T + ratio * (1 + T)))

    return float(quad(rate, 0, 2 * np.pi, epsabs=1e-13)[0])
