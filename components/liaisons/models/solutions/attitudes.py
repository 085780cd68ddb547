"""Turns without angular momentum: a satellite by its wheels, cats by their shape (M 8.2, 8.3)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

from liaisons.language import Orientation, Values, closed_form
from liaisons.models.solutions import rotations
from liaisons.models.solutions.euler_top import euler_top
from liaisons.models.solutions.integration import integrate
from liaisons.models.solutions.linear import free_fall
from liaisons.models.solutions.validity import require

_TENSOR = ("J_xx", "J_xy", "J_xz", "J_xy", "J_yy", "J_yz", "J_xz", "J_yz", "J_zz")

# ---- Satellite -----------------------------------------------------------------------------------------------------


def _tensor(where: str, at: Values) -> NDArray:
    J = at.array(*_TENSOR).reshape(3, 3)
    definite = bool(np.all(np.linalg.eigvalsh(J) > 0))
    require(definite, f"Satellite.{where}: J = {J.tolist()} must be positive definite")
    return J


@closed_form("with the wheels locked Euler's top, by elliptic functions, attitude included")
def locked(t: NDArray, at: Values) -> dict[str, NDArray]:
    start = rotations.unit(at.array("q_w_0", "q_x_0", "q_y_0", "q_z_0"))
    omega, q = euler_top(t, _tensor("exact", at), at.array("omega_x_0", "omega_y_0", "omega_z_0"), start)
    return dict(zip((*Orientation.rates, *Orientation.quaternion), (*omega, *q), strict=True))


@closed_form("from rest, the wheels turned in proportion: a rotation by -J⁻¹ J_wheel Δφ")
def slew(
    turn_1: ArrayLike = 0,
    turn_2: ArrayLike = 0,
    turn_3: ArrayLike = 0,
    *,
    at: Values,
    start: ArrayLike = rotations.IDENTITY,
) -> dict[str, NDArray]:
    """Δφ = (turn_1, turn_2, turn_3) [rad], any shape, in one direction at any pace, from the attitude ``start``."""
    turns = np.stack(np.broadcast_arrays(turn_1, turn_2, turn_3))
    vector = -at.J_wheel * np.tensordot(np.linalg.inv(_tensor("slew", at)), turns, 1)
    q = rotations.turned(rotations.unit(start), vector)
    return dict(zip(Orientation.quaternion, q, strict=True))


@closed_form("the motors' torques in a slew, λ = J_wheel (φ'' + ω') = J_wheel (1 - J_wheel J⁻¹) φ''")
def slew_torque(
    push_1: ArrayLike = 0, push_2: ArrayLike = 0, push_3: ArrayLike = 0, *, at: Values
) -> dict[str, NDArray]:
    """φ'' = (push_1, push_2, push_3) [rad/s2], any shape, in the proportion of the wheels' angles."""
    push = np.stack(np.broadcast_arrays(push_1, push_2, push_3)).astype(float)
    turning = np.tensordot(np.linalg.inv(_tensor("slew_torque", at)), at.J_wheel * push, 1)
    return {f"wheel_{k}_force": row for k, row in enumerate(at.J_wheel * (push - turning), 1)}


@closed_form("without angular momentum, the wheels turned at any rates: ω = -J⁻¹ J_wheel φ', integrated at 1e-13")
def steered(t: NDArray, at: Values, *, wheels: Callable[[float], ArrayLike]) -> dict[str, NDArray]:
    """``wheels`` gives φ' [rad/s], (3,), at an instant; it must not change within a 400th of the time."""
    follows = -at.J_wheel * np.linalg.inv(_tensor("steered", at))

    def rates(t: float, q: NDArray) -> NDArray:
        return rotations.product(q, np.concatenate([[0.0], follows @ np.asarray(wheels(t), dtype=float) / 2]))

    start = rotations.unit(at.array("q_w_0", "q_x_0", "q_y_0", "q_z_0"))
    q = integrate("Satellite.steered", rates, start, t, longest=float(np.max(t, initial=1e-300)) / 400)
    return dict(zip(Orientation.quaternion, q, strict=True))


# ---- SpatialCat ----------------------------------------------------------------------------------------------------


@closed_form("the angle Φ [rad] by which χ turns the cat about a + b, once round at constant bend")
def turn(bend: float, at: Values) -> float:
    c, s = np.cos(bend / 2), np.sin(bend / 2)
    return float(2 * np.pi * at.inertia_axial * c / (at.inertia_transverse * s**2 + at.inertia_axial * c**2))


@closed_form("free fall, and without momentum and twist, at constant bend, a turn that χ alone determines")
def bent(t: NDArray, at: Values, *, azimuth: ArrayLike, azimuth_0: float = 0.0) -> dict[str, NDArray]:
    """``azimuth`` [rad] is χ at the times, ``azimuth_0`` at the start, where half A is not turned."""
    chi = np.asarray(azimuth, dtype=float)
    psi = turn(at.bend, at) * (chi - azimuth_0) / (2 * np.pi)
    start = rotations.product(rotations.about(2, azimuth_0), rotations.about(0, at.bend / 2))
    back = rotations.product(rotations.about(0, -at.bend / 2)[:, None], rotations.about(2, -chi.ravel()))
    q = rotations.product(start[:, None], rotations.about(2, psi.ravel()), back)
    return free_fall(t, at) | dict(zip(Orientation.quaternion, q.reshape(4, *chi.shape), strict=True))


@closed_form("the bend [rad] that turns the cat by Φ once round: (I - J) Φ c² + 2π J c = I Φ")
def bend_for(turn: float, at: Values) -> float:
    """For 0 < ``turn`` <= 2π and I >= J."""
    I, J = at.inertia_transverse, at.inertia_axial  # noqa: E741
    require(0 < turn <= 2 * np.pi and I >= J, f"SpatialCat.bend_for: turn = {turn} must be > 0, <= 2π, and I >= J")
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
    """``half_angle`` of the cone [rad], more than the ``tilt`` of its axis."""
    ratio = at.inertia_axial / at.inertia_transverse
    (s, c), (sb, cb) = ((np.sin(angle), np.cos(angle)) for angle in (tilt, half_angle))

    def rate(theta: float) -> float:
        T = c * cb - s * sb * np.cos(theta)
        S = -sb * (c * sb + s * cb * np.cos(theta))
        return ratio * S * np.sqrt(2 / (1 + T)) / ((T - 1) * (1 - T + ratio * (1 + T)))

    return float(quad(rate, 0, 2 * np.pi, epsabs=1e-13)[0])


# ---- PlanarCat -----------------------------------------------------------------------------------------------------


@closed_form("a parabola, and with the limbs held still a uniform turn")
def falling(t: NDArray, at: Values) -> dict[str, NDArray]:
    motion = free_fall(t, at)
    for q in ("com_x", "phi"):
        start, rate = at.array(f"{q}_0", f"{q}_dot_0")
        motion |= {q: start + rate * t, f"{q}_dot": np.full_like(t, rate)}
    return motion


@closed_form("the trunk's rate [rad/s] without angular momentum, φ' = -(J_1 ψ_1' + J_2 ψ_2')/I (M eq. 58)")
def turn_rate(psi_1: ArrayLike, psi_2: ArrayLike, psi_1_dot: ArrayLike, psi_2_dot: ArrayLike, at: Values) -> NDArray:
    """Of shapes [rad] and their rates, any shape; by reduced masses."""
    m_0, m_1, m_2 = at.array("mass_0", "mass_1", "mass_2")
    total, h, c_1, c_2 = m_0 + m_1 + m_2, at.hinge, at.arm_1, at.arm_2
    mu_1, mu_2, mu = m_1 * (total - m_1) / total, m_2 * (total - m_2) / total, m_1 * m_2 / total
    cosines = np.cos(psi_1), np.cos(psi_2), np.cos(np.subtract(psi_1, psi_2))
    A, B, C = h * c_1 * (mu_1 + mu) * cosines[0], h * c_2 * (mu_2 + mu) * cosines[1], c_1 * c_2 * mu * cosines[2]
    own_1, own_2 = at.inertia_1 + c_1**2 * mu_1, at.inertia_2 + c_2**2 * mu_2
    inertia = at.inertia_0 + own_1 + own_2 + h**2 * (mu_1 + mu_2 + 2 * mu) + 2 * (A + B + C)
    return -((own_1 + A + C) * np.asarray(psi_1_dot) + (own_2 + B + C) * np.asarray(psi_2_dot)) / inertia
