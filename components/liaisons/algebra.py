"""Small linear algebra on CasADi expressions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self, final

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.expressions import without_zero_directions


def stack(expressions: Iterable[ca.SX | float]) -> ca.SX:
    """Scalars or columns stacked into one column; (0, 1) for none."""
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
    """∂expression/∂column as a column; unlike CasADi's own, (0, 1) for an empty column."""
    return ca.jacobian(expression, column).T


def jacobian(expression: ca.SX, column: ca.SX) -> ca.SX:
    """∂expression/∂column without terms that are zero because a call does not depend on the column."""
    return without_zero_directions(ca.jacobian(expression, column))


def hessian(expression: ca.SX, column: ca.SX) -> ca.SX:
    """∂²expression/∂column∂column without terms that are zero because a call does not depend on the column."""
    return without_zero_directions(ca.hessian(expression, column)[0])


def at_zero(expression: ca.SX, symbols: ca.SX) -> ca.SX:
    """Expression with zeros in place of a column of symbols."""
    return ca.substitute(expression, symbols, type(symbols).zeros(*symbols.shape))


def is_quadratic(expression: ca.SX, column: ca.SX) -> bool:
    """Whether the second derivatives of an expression by a column do not depend on it."""
    return not ca.depends_on(hessian(expression, column), column)


@final
@dataclass(frozen=True, eq=False)
class Factors:
    """L D Lᵀ of a symmetric matrix with its rows and columns in another order."""

    order: list[int]
    D: ca.SX
    LT: ca.SX

    @classmethod
    def of(cls, matrix: ca.SX, order: list[int] | None = None) -> Self:
        """L D Lᵀ without pivoting, which keeps the expressions short; dense unless an order is given.

        :param matrix: symmetric, with nonzero pivots in this order, as those of a positive definite one are in any.
        """
        if order is None:
            order, matrix = list(range(matrix.shape[0])), ca.densify(matrix)
        D, LT, _ = ca.ldl(matrix[order, order], False)
        return cls(order, D, LT)

    def solve(self, right: ca.SX) -> ca.SX:
        """Solution of matrix x = right, for a column or a matrix."""
        n = len(self.order)
        inverse = sorted(range(n), key=self.order.__getitem__)
        return ca.ldl_solve(right[self.order, :], self.D, self.LT, list(range(n)))[inverse, :]


def solve_symmetric(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solution of matrix x = right for a symmetric positive definite matrix."""
    return right / matrix if matrix.shape == (1, 1) else Factors.of(matrix).solve(right)
