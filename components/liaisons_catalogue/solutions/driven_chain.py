"""A chain whose left end an operator holds: normal modes, the motion under a sine, and what comes before a wave."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.linear import Modes, superposition


@closed_form("with the grip at rest: frequencies [rad/s], (n,), and modes φ_k(j) as columns, (n, n)")
def normal_modes(at: Values) -> Modes:
    j = np.arange(1, at.n + 1)
    alpha = (2 * j - 1) * np.pi / (2 * at.n + 1)
    return 2 * np.sqrt(at.stiffness / at.mass) * np.sin(alpha / 2), np.sin(alpha * j[:, None])


@closed_form("a sum over the modes, from rest under σ = amplitude · sin(angular_frequency t)", t=">= 0")
def exact(t: NDArray, at: Values, *, amplitude: float = 0.1, angular_frequency: float = 1.0) -> dict[str, NDArray]:
    push = np.where(np.arange(at.n) == 0, at.stiffness / at.mass, 0.0)  # only the first mass feels the grip
    sine = (-1j * amplitude, angular_frequency)  # Re(-i e^(iωt)) = sin ωt
    u, u_dot = superposition(t, *normal_modes(at), 0.0, 0.0, push=push, forces=[sine])
    sigma = amplitude * np.sin(angular_frequency * t)
    return {"u": u, "u_dot": u_dot, "drive_force": at.stiffness * (sigma - u[..., 0])}


@closed_form("a bound of what precedes a sudden unit push at mass j before j Δx/c, J_2j(x)/√(1 - (x/2j)²)")
def forerunner(t: NDArray, j: ArrayLike, at: Values) -> NDArray:
    """Return the bound from an endless chain's answer to a step, u_j = ∫ 2j J_2j(x) dt/t, x = 2 √(κ/m) t < 2j."""
    order, x = 2 * np.asarray(j), 2 * np.sqrt(at.stiffness / at.mass) * t
    at.require(np.all(x < order), f"at t = {np.max(t)} s the push is there")
    return jv(order, x) / np.sqrt(1 - (x / order) ** 2)
