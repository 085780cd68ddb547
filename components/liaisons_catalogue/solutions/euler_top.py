"""The torque-free rigid body: Jacobi's elliptic functions for ω, Legendre's third integral for the attitude.

Along the principal axes (c, b, a), moments C, B, A, let a be the extreme one that ω goes round and b the middle one; H
is the angular momentum, 2E twice the energy.  With a, c pointed so that ω_a > 0 and the axes are right-handed::

    ω_b ~ sn u,  ω_c ~ cn u,  ω_a ~ dn u,    u = u_0 ± √((A - B)(H² - 2EC)/ABC) t
    1 - k² = (A - C)(H² - 2EB) / ((A - B)(H² - 2EC))
    ψ' = H/A + H (1/C - 1/A) / (1 - n sn²u),    n = A (B - C) / (C (B - A)) <= 0

ψ is the precession of axis a about H.  Differences such as H² - 2EC = A (A - C) ω_a² + B (B - C) ω_b² are computed in
this form, in which no digits cancel.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipkm1, elliprf, elliprj

from liaisons.errors import ValidityError
from liaisons_catalogue.solutions import rotations
from liaisons_catalogue.solutions.elliptic import inverse_jacobi, jacobi

_STEADY = 1e-15  # sine of the angle between ω and H that is rounding
_SEPARATRIX = 1e-13  # 1 - k² that is rounding
_ENDS_ON_SEPARATRIX = "euler_top: the rotation ends about the middle axis (separatrix); change the start a little"


def euler_top(t: NDArray, inertia: NDArray, rate: NDArray, attitude: NDArray) -> tuple[NDArray, NDArray]:
    """Angular velocity and attitude of a free rigid body.

    :param t: times since the start [s], any shape.
    :param inertia: [kg.m2], shape (3, 3), positive definite, in the body frame.
    :param rate: initial angular velocity in the body frame [rad/s], shape (3,).
    :param attitude: initial unit quaternion, body to fixed frame, shape (4,).
    :returns: angular velocity (3, ...) and unit quaternion (4, ...), continuous in t.
    :raises ValidityError: on the separatrix, where the rotation about the middle axis ends.
    """
    H = inertia @ rate
    if np.linalg.norm(np.cross(rate, H)) <= _STEADY * np.linalg.norm(rate) * np.linalg.norm(H):
        constant = np.broadcast_to(rate[(...,) + (None,) * t.ndim], (3, *t.shape))
        return constant, rotations.product(attitude, rotations.exponential(constant * t))

    moments, axes = np.linalg.eigh(inertia)
    size = float(np.linalg.norm(H))
    along = axes.T @ rate
    # H² - 2EB decides which of the extreme axes ω goes round.
    decides = float(np.sum(moments * (moments - moments[1]) * along**2))
    order = [0, 1, 2] if decides > 0 else [2, 1, 0]  # c, b, a
    (C, B, A), axes, (omega_c, omega_b, omega_a) = moments[order], axes[:, order], along[order]
    about_c = A * (A - C) * omega_a**2 + B * (B - C) * omega_b**2  # H² - 2EC
    about_a = B * (B - A) * omega_b**2 + C * (C - A) * omega_c**2  # H² - 2EA
    m_1 = float((A - C) * decides / ((A - B) * about_c)) if A != B else 0.0
    if m_1 <= _SEPARATRIX:
        raise ValidityError(_ENDS_ON_SEPARATRIX)
    flip_a = 1.0 if omega_a >= 0 else -1.0
    flip_c = float(np.sign(np.linalg.det(axes))) * flip_a
    axes, omega_a, omega_c = axes * [flip_c, 1.0, flip_a], flip_a * omega_a, flip_c * omega_c

    # Constants of ω; the start's phase from sn : cn, whose common factor drops out.
    big_a = np.sqrt(about_c / (A * (A - C)))
    big_b = np.sqrt(about_a / (B * (B - A)))
    big_c = np.sqrt(about_a / (C * (C - A)))
    u_0 = inverse_jacobi(omega_b * np.sqrt(B * abs(B - A)), omega_c * np.sqrt(C * abs(C - A)), m_1)
    speed = np.sign(A - C) * np.sqrt((A - B) * about_c / (A * B * C))
    u = u_0 + speed * t
    am, sn, cn, dn = jacobi(u, m_1)
    omega = np.stack([big_c * cn, big_b * sn, big_a * dn])

    n = A * (B - C) / (C * (B - A))
    third = _third_kind(u, n, m_1) - _third_kind(np.array(u_0), n, m_1)
    psi = size / A * t + size * (1 / C - 1 / A) / speed * third
    to_H = _momentum_frame(omega, np.array([C, B, A]), am)
    principal = rotations.quaternion_of_matrix(axes)
    first = _momentum_frame(np.array([omega_c, omega_b, omega_a]), np.array([C, B, A]), np.array(jacobi(u_0, m_1)[0]))
    at_start = rotations.product(attitude, principal, rotations.conjugate(first))
    quaternion = rotations.product(at_start, rotations.about_axis(2, psi), to_H, rotations.conjugate(principal))
    return np.tensordot(axes, omega, 1), quaternion


def _momentum_frame(omega: NDArray, moments: NDArray, am: NDArray) -> NDArray:
    """Quaternion of the rotation of the axes (c, b, a) that takes the angular momentum H onto the third axis."""
    H_c, H_b, H_a = (moment * rate for moment, rate in zip(moments, omega, strict=True))
    spin = np.arctan2(H_b, H_c)
    spin = spin + 2 * np.pi * np.round((am - spin) / (2 * np.pi))  # it lies in the quadrant of am: continuous
    tilt = np.arctan2(np.hypot(H_b, H_c), H_a)
    return rotations.product(rotations.about_axis(1, -tilt), rotations.about_axis(2, -spin))


def _third_kind(u: NDArray, n: float, m_1: float) -> NDArray:
    """Elliptic integral ∫ dv / (1 - n sn²v) from 0 to u, n <= 0, by Carlson's forms."""
    quarter = float(ellipkm1(m_1))
    half_periods = np.round(u / (2 * quarter))
    parity = 1 - 2 * (half_periods % 2)
    _, sn, cn, _ = jacobi(u, m_1)
    s, c = parity * sn, cn**2

    def within(s: NDArray, c: NDArray) -> NDArray:
        """Integral from 0 to u in [-K, K], with s = sn u and c = cn² u."""
        modular = c + m_1 * s**2
        return s * elliprf(c, modular, 1.0) + n / 3 * s**3 * elliprj(c, modular, 1.0, 1 - n * s**2)

    return within(s, c) + 2 * half_periods * within(np.array(1.0), np.array(0.0))
