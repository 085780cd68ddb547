"""Linear feedback of sampled systems: controllable subspaces, and gains of least quadratic cost."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are

from liaisons.planning.goals import Array

Step = tuple[Array, Array]
"""A and B of x' = A x + B u, from one communication point to the next."""

RANK = 1e-8
"""Controllable directions have singular values above this, relative to the largest."""
_CONVERGED = 1e-11
"""Gains that change by less in a round, relative to the largest, are constant."""
_MOST_STEPS = 20000
"""Limit of the steps that the periodic recursion takes until its gains are constant."""


def reachable_subspace(A: Array, B: Array) -> tuple[Array, Array]:
    """Orthonormal bases of the controllable subspace of x' = A x + B u and of its complement (staircase algorithm)."""
    n, new = len(A), B
    V: Array = np.zeros((n, 0))
    while new.size and V.shape[1] < n:
        for _ in range(2):  # once more, against rounding
            new = new - V @ (V.T @ new)
        directions, sizes, _ = np.linalg.svd(new, full_matrices=False)
        new = directions[:, sizes > RANK * max(1.0, float(np.linalg.norm(A)))]
        V = np.hstack([V, new])
        new = A @ new
    whole = np.linalg.svd(V)[0] if V.size else np.eye(n)
    return V, whole[:, V.shape[1] :]


def image(projection: Array) -> Array:
    """Orthonormal basis of the image of a projection, whose singular values are 0, or 1 or more."""
    vectors, sizes, _ = np.linalg.svd(projection, full_matrices=False)
    return vectors[:, sizes > 0.5]


def spectral_radius(matrices: Array | Sequence[Array]) -> float:
    """Greatest absolute value of the eigenvalues of all matrices; 0 if there are none."""
    return float(np.max(np.abs(np.linalg.eigvals(matrices)), initial=0.0))


def named_sum(names: Sequence[str], parts: Array, sizes: Array) -> str:
    """Text of Σ parts/sizes · names, its first coefficient 1."""
    vector = parts / sizes
    terms = np.flatnonzero(np.abs(parts) > 1e-3 * np.max(np.abs(parts))).tolist()  # the rest is of order H
    signed = [(f"{vector[i] / vector[terms[0]]:+.3g}", names[i]) for i in terms]
    text = " ".join(f"{number[0]} {number[1:]} {name}" for number, name in signed)
    return text.removeprefix("+ ").removeprefix("1 ")


def rest_targets(A: Array, C: Array, V: Array, U: Array) -> tuple[Array, Array]:
    """Coordinates along V at which x rests with C x = 0 for each direction of U, and the norms of the residuals."""
    left = np.vstack([V.T @ (np.eye(len(A)) - A) @ V, C @ V])
    right = np.vstack([V.T @ A @ U, -C @ U])
    solution: Any = np.linalg.lstsq(left, right, rcond=1e-12)[0]
    return solution, np.linalg.norm(left @ solution - right, axis=0)


def lqr_gains(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Gains K of u = -K x that minimise Σ xᵀQx + uᵀRu over all steps x' = A x + B u."""
    return _gains(A, B, solve_discrete_are(A, B, Q, R), R)


def _gains(A: Array, B: Array, P: Array, R: Array) -> Array:
    """Gains K of one step whose final deviation costs xᵀPx."""
    return np.asarray(np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A), dtype=float)


def riccati_recursion(steps: Sequence[Step], costs: Sequence[Array], R: Array, P: Array) -> tuple[list[Array], Array]:
    """Gains of each step, and the cost matrix of initial deviations.

    :param P: the matrix of the cost of final deviations.
    """
    gains: list[Array] = []
    for (A, B), Q in zip(reversed(steps), reversed(costs), strict=True):
        K = _gains(A, B, P, R)
        closed = A - B @ K
        P = Q + K.T @ R @ K + closed.T @ P @ closed
        P = (P + P.T) / 2
        gains.append(K)
    return gains[::-1], P


def periodic_riccati(steps: Sequence[Step], costs: Sequence[Array], R: Array) -> tuple[list[Array], Array] | None:
    """Periodic gains of endlessly repeated steps, and the cost matrix; None if they do not converge.

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


def transition_matrix(steps: Sequence[Step], gains: Sequence[Array] | None = None) -> Array:
    """Product of the matrices of all steps; with gains that of the closed loop."""
    matrices = [A if gains is None else A - B @ gains[k] for k, (A, B) in enumerate(steps)]
    return reduce(lambda before, A: A @ before, matrices)


def least_defects(matrices: Sequence[Array], end: Array) -> Array:
    """Columns from 0 to ``end`` whose steps deviate from the matrices by the least sum of squares."""
    to_end = [np.eye(len(end))]
    for A in reversed(matrices[1:]):
        to_end.append(to_end[-1] @ A)
    weights, *_ = np.linalg.lstsq(sum(P @ P.T for P in to_end), end, rcond=None)
    columns = [np.zeros_like(end)]
    for A, P in zip(matrices, reversed(to_end), strict=True):
        columns.append(A @ columns[-1] + P.T @ weights)
    return np.transpose(columns)


def input_matrix(steps: Sequence[Step]) -> Array:
    """Effect of the inputs of all steps on the last state: the controllability matrix."""
    columns: Array = np.zeros((len(steps[0][0]), 0))
    for A, B in steps:
        columns = np.hstack([A @ columns, B])
    return columns
