"""Small linear algebra on CasADi expressions."""

from __future__ import annotations

from collections.abc import Iterable

import casadi as ca


def stack(expressions: Iterable[ca.SX]) -> ca.SX:
    """A column of scalars or columns; (0, 1) for none."""
    rows = list(expressions)
    return ca.vertcat(*rows) if rows else ca.SX(0, 1)


def gradient(expression: ca.SX, column: ca.SX) -> ca.SX:
    """∂expression/∂column as a column; unlike CasADi's own, (0, 1) for an empty column."""
    return ca.jacobian(expression, column).T


def solve_symmetric(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """matrix⁻¹ right for a symmetric positive definite matrix: LDLᵀ without pivoting keeps the expressions short."""
    if matrix.shape == (1, 1):
        return right / matrix
    D, LT, order = ca.ldl(ca.densify(matrix), False)
    return ca.ldl_solve(right, D, LT, order)
