"""Flow of Hamilton's equations from H alone, a reference that shares no code with our equations of motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arguments import float_array
from liaisons.base.arrays import Floats
from liaisons.base.reference_integration import integrate
from liaisons.errors import ValidityError

_STEP = 1e-30
"""Complex step, whose square vanishes beside any number: derivatives are exact to rounding."""


def hamiltonian_flow(hamiltonian: Callable[..., ArrayLike], start: ArrayLike, times: ArrayLike) -> Floats:
    """Solution of q' = ∂H/∂p, p' = -∂H/∂q, Hamilton's equations, by DOP853 at a tolerance of 1e-13.

    ::

        q, p = hamiltonian_flow(lambda q, p: p**2 / 2 + 2 * q**2, [1.0, 0.0], np.pi / 4)   # 0, -2

    :param hamiltonian: H(q_1, ..., q_n, p_1, ..., p_n), of arrays of complex numbers, analytic: no abs, no max.
    :param start: q and p at t = 0, shape (2n,).
    :param times: instants of the solution [s], ascending from 0 or later, any shape; the last is > 0.
    :returns: shape ``(2n, *times.shape)``.
    :raises ValidityError: for an odd number of values, times that decrease, or an H that is not finite on the way.
    """
    z = float_array("hamiltonian_flow: start", start, ValidityError)
    t = float_array("hamiltonian_flow: times", times, ValidityError)
    n, odd = divmod(z.size, 2)
    if z.ndim != 1 or odd or not n:
        raise ValidityError(f"hamiltonian_flow: start of shape {z.shape}; give as many p as q")
    instants = np.append(0.0, t.ravel())
    if not (np.all(np.diff(instants) >= 0) and instants[-1] > 0):
        raise ValidityError("hamiltonian_flow: times must ascend from 0 or later, and end after it")
    directions = 1j * _STEP * np.eye(2 * n)

    def rate(_: float, state: NDArray) -> NDArray:
        """Rates of q and p, by complex steps."""
        slope = np.broadcast_to(np.imag(hamiltonian(*(state[:, None] + directions))) / _STEP, 2 * n)
        return np.append(slope[n:], -slope[:n])

    points, tolerances = np.unique(instants), {"rtol": 1e-13, "atol": 1e-13}
    states = integrate("hamiltonian_flow", rate, z, (0, instants[-1]), times=points, **tolerances, error=ValidityError)
    return states[:, np.searchsorted(points, t)]
