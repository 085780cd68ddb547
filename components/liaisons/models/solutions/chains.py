"""Chains that move little, or hang together by springs: sums of normal modes, whose frequencies are known."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import eval_laguerre, jv, roots_laguerre

from liaisons.language import Values, closed_form
from liaisons.models.solutions.linear import superposition
from liaisons.models.solutions.validity import require

Modes = tuple[NDArray, NDArray]  # frequencies [rad/s], (n,), and modes as columns, (n, n)

# ---- OscillatorChain: both ends are free ---------------------------------------------------------------------------


@closed_form("frequencies [rad/s] from 0 upward, (n,), and modes φ_k(j) as columns, (n, n)")
def free_modes(at: Values) -> Modes:
    k, j = np.arange(at.n), np.arange(1, at.n + 1)[:, None]
    return 2 * np.sqrt(at.stiffness / at.mass) * np.sin(k * np.pi / (2 * at.n)), np.cos(k * np.pi * (j - 0.5) / at.n)


@closed_form("superposition of the normal modes", t=">= 0")
def free(t: NDArray, at: Values) -> dict[str, NDArray]:
    return dict(zip(("u", "u_dot"), superposition(t, *free_modes(at), at.u_0, at.u_dot_0), strict=True))


# ---- DrivenChain: an operator holds the left end -------------------------------------------------------------------


@closed_form("with the grip at rest: frequencies [rad/s], (n,), and modes φ_k(j) as columns, (n, n)")
def driven_modes(at: Values) -> Modes:
    j = np.arange(1, at.n + 1)
    alpha = (2 * j - 1) * np.pi / (2 * at.n + 1)
    return 2 * np.sqrt(at.stiffness / at.mass) * np.sin(alpha / 2), np.sin(alpha * j[:, None])


@closed_form("a sum over the modes, from rest under σ = amplitude · sin(angular_frequency t)", t=">= 0")
def driven(t: NDArray, at: Values, *, amplitude: float = 0.1, angular_frequency: float = 1.0) -> dict[str, NDArray]:
    push = np.where(np.arange(at.n) == 0, at.stiffness / at.mass, 0.0)  # only the first mass feels the grip
    sine = (-1j * amplitude, angular_frequency)  # Re(-i e^(iωt)) = sin ωt
    u, u_dot = superposition(t, *driven_modes(at), 0.0, 0.0, push=push, forces=[sine])
    sigma = amplitude * np.sin(angular_frequency * t)
    return {"u": u, "u_dot": u_dot, "drive_force": at.stiffness * (sigma - u[..., 0])}


@closed_form("a bound of what precedes a sudden unit push at mass j before j Δx/c, J_2j(x)/√(1 - (x/2j)²)")
def forerunner(t: NDArray, j: ArrayLike, at: Values) -> NDArray:
    """x = 2 √(κ/m) t < 2j; an endless chain answers a step by u_j = ∫ 2j J_2j(x) dt/t."""
    order, x = 2 * np.asarray(j), 2 * np.sqrt(at.stiffness / at.mass) * t
    require(bool(np.all(x < order)), f"DrivenChain.forerunner: at t = {np.max(t)} s the push is there")
    return jv(order, x) / np.sqrt(1 - (x / order) ** 2)


# ---- PendulumChain, DoublePendulum: small angles -------------------------------------------------------------------


@closed_form("frequencies [rad/s] from the slowest, (n,), and modes as columns of angles, (n, n)", gravity="> 0")
def hanging_modes(at: Values) -> Modes:
    zeros = roots_laguerre(at.n)[0]
    displacements = eval_laguerre(np.arange(at.n, -1, -1)[:, None], zeros)  # of pivot and bobs, from the top
    return np.sqrt(zeros * at.gravity / at.length), np.diff(displacements, axis=0) / at.length


@closed_form("the motion for sin θ ≈ θ with fixed pivot: the sum of the normal modes", t=">= 0", gravity="> 0")
def hanging(t: NDArray, at: Values) -> dict[str, NDArray]:
    return dict(
        zip(("theta", "theta_dot"), superposition(t, *hanging_modes(at), at.theta_0, at.theta_dot_0), strict=True)
    )


@closed_form("frequencies [rad/s] (2,), the slow one first, and modes (1, θ_2/θ_1) as columns (2, 2)", gravity="> 0")
def double_pendulum_modes(at: Values) -> Modes:
    """In the slow mode both bobs swing to the same side, in the fast one to opposite sides."""
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
def double_pendulum(t: NDArray, at: Values) -> dict[str, NDArray]:
    start, rates = at.array("theta_1_0", "theta_2_0"), at.array("theta_1_dot_0", "theta_2_dot_0")
    theta, theta_dot = superposition(t, *double_pendulum_modes(at), start, rates)
    names = ("theta_1", "theta_2", "theta_1_dot", "theta_2_dot")
    return dict(zip(names, (*np.moveaxis(theta, -1, 0), *np.moveaxis(theta_dot, -1, 0)), strict=True))
