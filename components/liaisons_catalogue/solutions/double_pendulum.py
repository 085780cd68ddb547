"""Small motions of the double pendulum: two normal modes, and their sum."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.linear import Modes, superposition


@closed_form("frequencies [rad/s] (2,), the slow one first, and modes (1, θ_2/θ_1) as columns (2, 2)", gravity="> 0")
def normal_modes(at: Values) -> Modes:
    """Return frequencies and modes: the bobs swing to one side in the slow mode, to opposite sides in the fast one."""
    # λ = g/Ω² solves λ² - (l_1 + l_2) λ + l_1 l_2 m_1/(m_1 + m_2) = 0 and θ_2/θ_1 = l_1/(λ - l_2); of the two
    # roots each of λ and of λ - l_2 the one with cancellation follows from the product.
    product, difference, total = at.length_1 * at.length_2, at.length_1 - at.length_2, at.mass_1 + at.mass_2
    root = np.hypot(difference, 2 * np.sqrt(product * at.mass_2 / total))
    slow = (at.length_1 + at.length_2 + root) / 2
    fast = product * at.mass_1 / total / slow
    larger = (abs(difference) + root) / 2
    smaller = product * at.mass_2 / total / larger
    behind_slow, behind_fast = (larger, -smaller) if difference >= 0 else (smaller, -larger)
    modes = np.array([[1, 1], [at.length_1 / behind_slow, at.length_1 / behind_fast]])
    return np.sqrt(at.gravity / np.array([slow, fast])), modes


@closed_form("the motion for sin θ ≈ θ with fixed pivot: the sum of two normal modes", t=">= 0", gravity="> 0")
def small_angles(t: NDArray, at: Values) -> dict[str, NDArray]:
    start, rates = at.array("theta_1_0", "theta_2_0"), at.array("theta_1_dot_0", "theta_2_dot_0")
    theta, theta_dot = superposition(t, *normal_modes(at), start, rates)
    names = ("theta_1", "theta_2", "theta_1_dot", "theta_2_dot")
    return dict(zip(names, (*np.moveaxis(theta, -1, 0), *np.moveaxis(theta_dot, -1, 0)), strict=True))
