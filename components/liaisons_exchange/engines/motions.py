"""Prescribed motions of joints, and the force that an operator needs for them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from liaisons.errors import InvalidValueError

Motion = Callable[[float], tuple[float, float, float]]
"""Of a time [s]: σ, σ̇, σ̈ of a joint, in rad or m."""


def require_motions(motions: Mapping[str, Motion]) -> None:
    """:raises InvalidValueError: where no joint is prescribed."""
    if not motions:
        raise InvalidValueError('motions is empty; prescribe a joint: {"pivot": lambda t: (σ, σ̇, σ̈)}')


def evaluated(motions: Iterable[tuple[str, Motion]], time: float) -> NDArray[np.float64]:
    """σ, σ̇, σ̈ of each joint, in columns of (3, number of joints).

    :raises InvalidValueError: where a motion does not return three finite numbers.
    """
    values = []
    for name, motion in motions:
        value = np.asarray(motion(time), dtype=float)
        if value.shape != (3,) or not np.all(np.isfinite(value)):
            raise InvalidValueError(
                f"motion of {name!r} at t = {time:g} s: {value}; it must return three finite numbers, σ, σ̇, σ̈"
            )
        values.append(value)
    return np.array(values).T


def multipliers(
    inverse_mass: NDArray[np.float64], rows: NDArray[np.intp], lacking: NDArray[np.float64]
) -> NDArray[np.float64]:
    """λ = Θ (σ̈ - q̈⁰_α), by which the joints α get what they lack; likewise impulses, for what rates lack.

    Θ = ((M⁻¹)_αα)⁻¹ is the effective mass at the joints (M eq. 50); ``inverse_mass`` has the rows α of M⁻¹, (k, nv).
    """
    return np.linalg.solve(inverse_mass[:, rows], lacking).astype(float, copy=False)
