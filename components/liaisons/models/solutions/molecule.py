"""Normal modes of the linear molecule of three atoms (K eq. 148-158); masses and displacements numbers or symbols."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def frequencies(m: Any, M: Any, stiffness: Any) -> tuple[Any, Any, Any]:
    """Ω_k of K eq. 157; m is the mass of each outer atom, M that of the inner one."""
    return 0.0, (stiffness / m) ** 0.5, (stiffness * (1 / m + 2 / M)) ** 0.5


def normal_coordinates(u: Sequence[Any], m: Any, M: Any) -> tuple[Any, Any, Any]:
    """q_k of displacements u: u_kᵀ M u/(u_kᵀ M u_k), the modes being orthogonal in the masses."""
    left, middle, right = u
    alpha = m / M
    return (
        3**0.5 * (m * left + M * middle + m * right) / (2 * m + M),
        (right - left) / 2**0.5,
        (4 * alpha**2 + 2) ** 0.5 * (left - 2 * middle + right) / (2 * (1 + 2 * alpha)),
    )


def modes(m: float, M: float) -> NDArray:
    """The unit vectors u_k of K eq. 158 as columns, shape (3, 3)."""
    columns = np.array([[1, 1, 1], [-1, 0, 1], [1, -2 * m / M, 1]]).T
    return columns / np.linalg.norm(columns, axis=0)
