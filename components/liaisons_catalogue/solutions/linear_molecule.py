"""Normal modes of the linear molecule of three atoms (K eq. 148-158); masses and displacements numbers or symbols."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.linear import superposition


def frequencies(m: Any, M: Any, stiffness: Any) -> tuple[Any, Any, Any]:
    """Normal frequencies Ω_1, Ω_2, Ω_3 of K eq. 157, for masses m of the outer atoms and M of the inner one."""
    return 0.0, (stiffness / m) ** 0.5, (stiffness * (1 / m + 2 / M)) ** 0.5


def normal_coordinates(u: Sequence[Any], m: Any, M: Any) -> tuple[Any, Any, Any]:
    """Normal coordinates q_k = u_kᵀ M u/(u_kᵀ M u_k) of displacements u, with the modes u_k of K eq. 158."""
    left, middle, right = u
    alpha = m / M
    return (
        3**0.5 * (m * left + M * middle + m * right) / (2 * m + M),
        (right - left) / 2**0.5,
        (4 * alpha**2 + 2) ** 0.5 * (left - 2 * middle + right) / (2 * (1 + 2 * alpha)),
    )


@closed_form("the unit vectors u_k of K eq. 158 as columns, shape (3, 3)")
def modes(at: Values) -> NDArray:
    columns = np.array([[1, 1, 1], [-1, 0, 1], [1, -2 * at.mass_outer / at.mass_inner, 1]]).T
    return columns / np.linalg.norm(columns, axis=0)


@closed_form("superposition of the three modes (K eq. 148 and 150)", t=">= 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    m, M, rest = at.mass_outer, at.mass_inner, at.spacing * np.arange(3)
    start, rates = at.array("x_1_0", "x_2_0", "x_3_0") - rest, at.array("x_1_dot_0", "x_2_dot_0", "x_3_dot_0")
    u, u_dot = superposition(t, np.array(frequencies(m, M, at.stiffness)), modes(at), start, rates)
    names = [f"{form}_{k}{rate}" for form, rate in (("x", ""), ("x", "_dot"), ("mode", "")) for k in (1, 2, 3)]
    q = normal_coordinates(list(np.moveaxis(u, -1, 0)), m, M)
    columns = (*np.moveaxis(u + rest, -1, 0), *np.moveaxis(u_dot, -1, 0), *q)
    return dict(zip(names, columns, strict=True))
