"""Normal modes of a chain with free ends, and their sum."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.linear import Modes, superposition


@closed_form("frequencies [rad/s] from 0 upward, (n,), and modes φ_k(j) as columns, (n, n)")
def normal_modes(at: Values) -> Modes:
    k, j = np.arange(at.n), np.arange(1, at.n + 1)[:, None]
    return 2 * np.sqrt(at.stiffness / at.mass) * np.sin(k * np.pi / (2 * at.n)), np.cos(k * np.pi * (j - 0.5) / at.n)


@closed_form("superposition of the normal modes", t=">= 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    return dict(zip(("u", "u_dot"), superposition(t, *normal_modes(at), at.u_0, at.u_dot_0), strict=True))
