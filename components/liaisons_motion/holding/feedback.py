"""Linear feedback of sampled systems: controllable subspaces, and gains of least quadratic cost."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are

from liaisons.base.arrays import Floats

Step = tuple[Floats, Floats]
"""A and B of x' = A x + B u, from one communication point to the next."""

RANK = 1e-8
"""Controllable directions have singular values above this, relative to the largest."""
_CONVERGED = 1e-11
"""Gains that change by less in a round, relative to the largest, are constant."""
_MOST_STEPS = 20000
"""Limit of the steps that the periodic recursion takes until its gains are constant."""


def reachable_subspace(A: Floats, B: Floats) -> tuple[Floats, Floats]:
    """Orthonormal bases of the controllable subspace of x' = A x + B u and of its complement (staircase algorithm)."""
    n, new = len(A), B
    V: Floats = np.zeros((n, 0))
    while new.size and V.shape[1] < n:
        for _ in range(2):  # once more, against rounding
            new = new - V @ (V.T @ new)
        directions, sizes, _ = np.linalg.svd(new, full_matrices=False)
        new = directions[:, sizes > RANK * max(1.0, float(np.linalg.norm(A)))]
        V = np.hstack([V, new])
        new = A @ new
    whole = np.linalg.svd(V)[0] if V.size else np.eye(n)
    return V, whole[:, V.shape[1] :]


def image_basis(projection: Floats) -> Floats:
    """Orthonormal basis of the image of a projection.

    Its singular values are 0, or at least 1.
    """
    vectors, sizes, _ = np.linalg.svd(projection, full_matrices=False)
    return vectors[:, sizes > 0.5]


def spectral_radius(matrix: Floats) -> float:
    """Greatest absolute value of the eigenvalues; 0 for an empty matrix."""
    return float(np.max(np.abs(np.linalg.eigvals(matrix)), initial=0.0))


def named_sum(names: Sequence[str], coefficients: Floats, sizes: Floats) -> str:
    """Text of a linear combination of names, "theta - 0.5 p_theta": coefficients/sizes, the first made 1."""
    vector = coefficients / sizes
    large = np.abs(coefficients) > 1e-3 * np.max(np.abs(coefficients))  # the rest is of order H
    terms = np.flatnonzero(large).tolist()
    signed = [(f"{vector[i] / vector[terms[0]]:+.3g}", names[i]) for i in terms]
    text = " ".join(f"{number[0]} {number[1:]} {name}" for number, name in signed)
    return text.removeprefix("+ ").removeprefix("1 ")


def rest_offsets(A: Floats, C: Floats, V: Floats, U: Floats) -> tuple[Floats, Floats]:
    """Controllable parts of x at rest, x = A x and C x = 0, for unit uncontrollable parts; and residual norms.

    :param V: basis of the controllable subspace; ``U``: of its complement.
    :returns: coordinates along V, a column for each of U, by least squares; and the norms of what remains.
    """
    left = np.vstack([V.T @ (np.eye(len(A)) - A) @ V, C @ V])
    right = np.vstack([V.T @ A @ U, -C @ U])
    solution: Any = np.linalg.lstsq(left, right, rcond=1e-12)[0]
    return solution, np.linalg.norm(left @ solution - right, axis=0)


def discrete_lqr_gains(A: Floats, B: Floats, Q: Floats, R: Floats) -> Floats:
    """Gains K of u = -K x that minimise Σ xᵀQx + uᵀRu over all steps x' = A x + B u."""
    return _gains(A, B, solve_discrete_are(A, B, Q, R), R)


def _gains(A: Floats, B: Floats, P: Floats, R: Floats) -> Floats:
    """Gains K of u = -K x that minimise uᵀRu + x'ᵀPx' over one step x' = A x + B u."""
    return np.asarray(np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A), dtype=float)


def riccati_recursion(
    steps: Sequence[Step], costs: Sequence[Floats], R: Floats, P: Floats
) -> tuple[list[Floats], Floats]:
    """Gains of each step, and the matrix P of the least cost xᵀPx of an initial deviation, by backward recursion.

    :param costs: matrices Q of the cost of deviations before each step; ``P``: of that at the end.
    """
    gains: list[Floats] = []
    for (A, B), Q in zip(reversed(steps), reversed(costs), strict=True):
        K = _gains(A, B, P, R)
        closed = A - B @ K
        P = Q + K.T @ R @ K + closed.T @ P @ closed
        P = (P + P.T) / 2
        gains.append(K)
    return gains[::-1], P


def periodic_riccati(steps: Sequence[Step], costs: Sequence[Floats], R: Floats) -> tuple[list[Floats], Floats] | None:
    """Gains of steps that are repeated endlessly, and the cost matrix P; None if they do not converge.

    Uncontrollable deviations may persist: their cost grows, and does not act on the gains.
    """
    P, last = costs[0], np.zeros(0)
    for _ in range(max(2, _MOST_STEPS // len(steps))):
        gains, P = riccati_recursion(steps, costs, R, P)
        flattened = np.concatenate([K.ravel() for K in gains])
        if last.size and np.max(np.abs(flattened - last)) <= _CONVERGED * np.max(np.abs(flattened)):
            return gains, P
        last = flattened
    return None


def transition_matrix(steps: Sequence[Step], gains: Sequence[Floats] | None = None) -> Floats:
    """Product of the matrices A of all steps; with gains of A - B K, the closed loop."""
    matrices = [A if gains is None else A - B @ gains[k] for k, (A, B) in enumerate(steps)]
    return reduce(lambda before, A: A @ before, matrices)


def distributed_correction(matrices: Sequence[Floats], end: Floats) -> Floats:
    """Corrections of all states of a linear motion, (states, steps + 1), from 0 to that of its end.

    They follow x' = A x up to additions in each step, whose sum of squares is least.
    """
    to_end = [np.eye(len(end))]
    for A in reversed(matrices[1:]):
        to_end.append(to_end[-1] @ A)
    weights, *_ = np.linalg.lstsq(sum(P @ P.T for P in to_end), end, rcond=None)
    columns = [np.zeros_like(end)]
    for A, P in zip(matrices, reversed(to_end), strict=True):
        columns.append(A @ columns[-1] + P.T @ weights)
    return np.transpose(columns)


def controllability_matrix(steps: Sequence[Step]) -> Floats:
    """Derivatives of the last state by the inputs of all steps, (states, inputs · steps)."""
    columns: Floats = np.zeros((len(steps[0][0]), 0))
    for A, B in steps:
        columns = np.hstack([A @ columns, B])
    return columns
