"""Small motions of the hanging chain: normal modes by Laguerre polynomials, and their sum."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_laguerre, roots_laguerre

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.linear import Modes, superposition


@closed_form("frequencies [rad/s] from the slowest, (n,), and modes as columns of angles, (n, n)", gravity="> 0")
def normal_modes(at: Values) -> Modes:
    zeros = roots_laguerre(at.n)[0]
    displacements = eval_laguerre(np.arange(at.n, -1, -1)[:, None], zeros)  # of pivot and bobs, from the top
    return np.sqrt(zeros * at.gravity / at.length), np.diff(displacements, axis=0) / at.length


@closed_form("the motion for sin θ ≈ θ with fixed pivot: the sum of the normal modes", t=">= 0", gravity="> 0")
def small_angles(t: NDArray, at: Values) -> dict[str, NDArray]:
    return dict(
        zip(("theta", "theta_dot"), superposition(t, *normal_modes(at), at.theta_0, at.theta_dot_0), strict=True)
    )
