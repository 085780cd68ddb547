"""Linear feedback of sampled systems: what can be reached, and the gains of least cost."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are, svd

from liaisons.planning.goals import Array

Step = tuple[Array, Array]
"""A and B of x' = A x + B u, from one communication point to the next."""

RANK = 1e-8
"""Directions that inputs reach by less than this, relative to the largest, are not controllable."""
_ROUNDS = 20000
"""So often the recursion goes back at most until its gains stay."""


def reachable(A: Array, B: Array) -> tuple[Array, Array]:
    """Orthonormal bases of what x' = A x + B u can reach, and of what is perpendicular to it: the staircase."""
    n, new = len(A), B
    V: Array = np.zeros((n, 0))
    while new.size and V.shape[1] < n:
        new = new - V @ (V.T @ new)
        new = new - V @ (V.T @ new)
        decomposition: Any = svd(new, full_matrices=False)
        directions, sizes, _ = decomposition
        new = np.asarray(directions[:, sizes > RANK * max(1.0, float(np.linalg.norm(A)))], dtype=float)
        V = np.asarray(np.hstack([V, new]), dtype=float)
        new = A @ new
    whole: Any = svd(V)[0] if V.size else np.eye(n)
    return V, whole[:, V.shape[1] :]


def steady(A: Array, C: Array, V: Array, U: Array) -> tuple[Array, Array]:
    """Where V has to rest so that C x = 0 remains while each direction of U stays, and what that misses."""
    left = np.vstack([V.T @ (np.eye(len(A)) - A) @ V, C @ V])
    right = np.vstack([V.T @ A @ U, -C @ U])
    solution: Any = np.linalg.lstsq(left, right, rcond=1e-12)[0]
    return solution, np.asarray(np.linalg.norm(left @ solution - right, axis=0))


def riccati(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Gains K of u = -K x for which Σ xᵀQx + uᵀRu is least, x' = A x + B u step by step."""
    P = solve_discrete_are(A, B, Q, R)
    return np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)


def backward(steps: Sequence[Step], costs: Sequence[Array], R: Array, P: Array) -> tuple[list[Array], Array]:
    """Gains of each step and the cost of what is off at the start, from the cost P of what is off at the end."""
    gains: list[Array] = []
    for (A, B), Q in zip(reversed(steps), reversed(costs), strict=True):
        K = np.asarray(np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A), dtype=float)
        closed = A - B @ K
        P = Q + K.T @ R @ K + closed.T @ P @ closed
        P = (P + P.T) / 2
        gains.append(K)
    return gains[::-1], P


def periodic(steps: Sequence[Step], costs: Sequence[Array], R: Array) -> tuple[list[Array], Array] | None:
    """The same of steps that follow each other for ever, their gains repeating; None if there are no such gains.

    What cannot be reached may stay, at a cost that grows without acting on the gains.
    """
    P, last = costs[0], np.zeros(0)
    for _ in range(max(2, _ROUNDS // len(steps))):
        gains, P = backward(steps, costs, R, P)
        flattened = np.concatenate([K.ravel() for K in gains])
        if last.size and np.max(np.abs(flattened - last)) <= 1e-11 * np.max(np.abs(flattened)):
            return gains, P
        last = flattened
    return None


def through(steps: Sequence[Step], gains: Sequence[Array] | None = None) -> Array:
    """The matrix of all steps, with feedback if there are gains."""
    matrices = [A if gains is None else A - B @ gains[k] for k, (A, B) in enumerate(steps)]
    return reduce(lambda before, A: A @ before, matrices)


def least_defects(matrices: Sequence[Array], end: Array) -> Array:
    """What starts at 0 and ends there, column by column, with the least sum of squares of what it is off each step."""
    to_end = [np.eye(len(end))]
    for A in reversed(matrices[1:]):
        to_end.append(to_end[-1] @ A)
    weights = np.linalg.lstsq(sum(map(np.matmul, to_end, (P.T for P in to_end))), end, rcond=None)[0]
    columns = [np.zeros_like(end)]
    for A, P in zip(matrices, reversed(to_end), strict=True):
        columns.append(A @ columns[-1] + P.T @ weights)
    return np.transpose(columns)


def pushes(steps: Sequence[Step]) -> Array:
    """What each of the inputs of all steps does at the end of the last one, column by column."""
    columns: Array = np.zeros((len(steps[0][0]), 0))
    for A, B in steps:
        columns = np.hstack([A @ columns, B])
    return columns
