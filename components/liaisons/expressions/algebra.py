"""Small linear algebra on CasADi expressions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.expressions.calls import without_zero_directions


def stack(expressions: Iterable[ca.SX | float]) -> ca.SX:
    """Return scalars or columns stacked into one column; (0, 1) for none."""
    rows = list(expressions)
    return ca.vertcat(*rows) if rows else ca.SX(0, 1)


def closure(uses: NDArray[np.bool_], first: ArrayLike) -> list[int]:
    """Indices of variables that are used: the first ones, and all that these use, directly or through others.

    :param uses: whether a variable, by row, uses another one, by column.
    :param first: whether a variable is among the first.
    """
    reached = np.asarray(first, dtype=bool)
    while (more := reached | uses[reached].any(axis=0)).sum() > reached.sum():
        reached = more
    return np.flatnonzero(reached).tolist()


def gradient(expression: ca.SX, column: ca.SX) -> ca.SX:
    """Return ∂expression/∂column as a column; unlike CasADi's own, (0, 1) for an empty column."""
    return ca.jacobian(expression, column).T


def jacobian(expression: ca.SX, column: ca.SX) -> ca.SX:
    """Return ∂expression/∂column without terms that are zero because a call does not depend on the column."""
    return without_zero_directions(ca.jacobian(expression, column))


def hessian(expression: ca.SX, column: ca.SX) -> ca.SX:
    """Return ∂²expression/∂column∂column without terms that are zero because a call does not depend on the column."""
    return without_zero_directions(ca.hessian(expression, column)[0])


def term_sizes(matrix: ca.SX, column: ca.SX) -> ca.SX:
    """Return the sums of the absolute values of the terms of matrix @ column."""
    return ca.fabs(matrix) @ ca.fabs(column)


def at_zero(expression: ca.SX, symbols: ca.SX) -> ca.SX:
    """Return an expression with zeros in place of a column of symbols."""
    return ca.substitute(expression, symbols, type(symbols).zeros(*symbols.shape))


def is_quadratic(expression: ca.SX, column: ca.SX) -> bool:
    """Whether the second derivatives of an expression by a column do not depend on it."""
    return not ca.depends_on(hessian(expression, column), column)


@dataclass(frozen=True, eq=False)
class Factors:
    """L D Lᵀ of a symmetric matrix with its rows and columns in another order."""

    order: list[int]
    D: ca.SX
    LT: ca.SX

    def solve(self, right: ca.SX) -> ca.SX:
        """Return matrix⁻¹ right, for a column or a matrix."""
        n = len(self.order)
        inverse = sorted(range(n), key=self.order.__getitem__)
        return ca.ldl_solve(right[self.order, :], self.D, self.LT, list(range(n)))[inverse, :]


def factorise(matrix: ca.SX, order: list[int] | None = None) -> Factors:
    """Return L D Lᵀ without pivoting, which keeps the expressions short; dense unless an order is given.

    :param matrix: symmetric, with nonzero pivots in this order, as those of a positive definite one are in any.
    """
    if order is None:
        order, matrix = list(range(matrix.shape[0])), ca.densify(matrix)
    D, LT, _ = ca.ldl(matrix[order, order], False)
    return Factors(order, D, LT)


def solve_symmetric(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Return matrix⁻¹ right for a symmetric positive definite matrix."""
    return right / matrix if matrix.shape == (1, 1) else factorise(matrix).solve(right)


def elimination_order(pattern: ca.Sparsity, after: Mapping[int, set[int]]) -> tuple[list[int], int]:
    """Return the order of elimination by minimum degree, which has little fill-in, and its cost.

    :param pattern: of a symmetric matrix.
    :param after: for each unknown, those to be eliminated before it, so that its pivot does not vanish.
    :returns: unknowns in this order, and the number of products that it takes.
    """
    neighbours = [set(pattern.row()[start:end]) - {i} for i, (start, end) in enumerate(pairwise(pattern.colind()))]
    left, order, work = set(range(len(neighbours))), [], 0
    waits = [0] * len(neighbours)  # for so many pivots, one after the other
    while left:
        ready = (i for i in left if not after.get(i, set()) & left)
        chosen = min(ready, key=lambda i: (len(neighbours[i]), waits[i], i))
        for i in neighbours[chosen]:
            neighbours[i] |= neighbours[chosen]
            neighbours[i] -= {i, chosen}
            waits[i] = max(waits[i], waits[chosen] + 1)
        left.remove(chosen)
        order.append(chosen)
        work += len(neighbours[chosen]) ** 2
    return order, work
