"""What a closed form demands of its arguments, said in one line when it does not get it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from liaisons.errors import ValidityError


def require(holds: bool, message: str) -> None:
    """Raise a ValidityError with the message unless the condition holds."""
    if not holds:
        raise ValidityError(message)


def positive_definite(name: str, matrix: NDArray) -> NDArray:
    """The symmetric matrix, or a ValidityError that names it."""
    require(bool(np.all(np.linalg.eigvalsh(matrix) > 0)), f"{name} = {matrix.tolist()} must be positive definite")
    return matrix
