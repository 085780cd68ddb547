"""Free fall of the plane cat, and the rate of its trunk without angular momentum (M eq. 58)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.linear import coordinate_motion


@closed_form("a parabola, and with the limbs held still a uniform turn")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    motion = {}
    for name, acceleration in (("com_x", 0.0), ("com_z", -at.gravity), ("phi", 0.0)):
        motion |= coordinate_motion(t, at, name, forces=[(acceleration, 0.0)])
    return motion


@closed_form("the trunk's rate [rad/s] without angular momentum, φ' = -(J_1 ψ_1' + J_2 ψ_2')/I (M eq. 58)")
def turn_rate(psi_1: ArrayLike, psi_2: ArrayLike, psi_1_dot: ArrayLike, psi_2_dot: ArrayLike, at: Values) -> NDArray:
    """Return the rate at angles [rad] and rates [rad/s] of any shape, by reduced masses."""
    m_0, m_1, m_2 = at.array("mass_0", "mass_1", "mass_2")
    total, h, c_1, c_2 = m_0 + m_1 + m_2, at.hinge, at.arm_1, at.arm_2
    mu_1, mu_2, mu = m_1 * (total - m_1) / total, m_2 * (total - m_2) / total, m_1 * m_2 / total
    cosines = np.cos(psi_1), np.cos(psi_2), np.cos(np.subtract(psi_1, psi_2))
    A, B, C = h * c_1 * (mu_1 + mu) * cosines[0], h * c_2 * (mu_2 + mu) * cosines[1], c_1 * c_2 * mu * cosines[2]
    own_1, own_2 = at.inertia_1 + c_1**2 * mu_1, at.inertia_2 + c_2**2 * mu_2
    inertia = at.inertia_0 + own_1 + own_2 + h**2 * (mu_1 + mu_2 + 2 * mu) + 2 * (A + B + C)
    return -((own_1 + A + C) * np.asarray(psi_1_dot) + (own_2 + B + C) * np.asarray(psi_2_dot)) / inertia
