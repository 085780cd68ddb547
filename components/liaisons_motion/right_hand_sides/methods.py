"""Explicit Runge-Kutta methods by their coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import final


@final
@dataclass(frozen=True, slots=True)
class Tableau:
    """Butcher tableau of an explicit method: order, nodes c, matrix a (row s has s entries), weights b."""

    order: int
    nodes: tuple[float, ...]
    matrix: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]

    @property
    def stages(self) -> int:
        """Number of stages, the evaluations of the right-hand side a step."""
        return len(self.nodes)

    @property
    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Weights of the rates of the stages, for the state at each stage and after the step."""
        return *self.matrix, self.weights

    @property
    def adjoint_rows(self) -> list[list[float]]:
        """Weights of the adjoint step: row q has those of the rate of stage q, in the step and in later stages."""
        return [[row[q] if q < len(row) else 0.0 for row in (self.weights, *self.matrix)] for q in range(self.stages)]


_RK4 = Tableau(
    order=4,
    nodes=(0.0, 0.5, 0.5, 1.0),
    matrix=((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    weights=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
)

_S = sqrt(21.0)
_P, _M = (7 + _S) / 14, (7 - _S) / 14
# Cooper and Verner, SIAM J. Numer. Anal. 9 (1972) 389: eleven stages on the nodes of Lobatto's quadrature.
_RK8 = Tableau(
    order=8,
    nodes=(0.0, 1 / 2, 1 / 2, _P, _P, 1 / 2, _M, _M, 1 / 2, _P, 1.0),
    matrix=(
        (),
        (1 / 2,),
        (1 / 4, 1 / 4),
        (1 / 7, (-7 - 3 * _S) / 98, (21 + 5 * _S) / 49),
        ((11 + _S) / 84, 0.0, (18 + 4 * _S) / 63, (21 - _S) / 252),
        ((5 + _S) / 48, 0.0, (9 + _S) / 36, (-231 + 14 * _S) / 360, (63 - 7 * _S) / 80),
        (
            *((10 - _S) / 42, 0.0, (-432 + 92 * _S) / 315, (633 - 145 * _S) / 90),
            *((-504 + 115 * _S) / 70, (63 - 13 * _S) / 35),
        ),
        (1 / 14, 0.0, 0.0, 0.0, (14 - 3 * _S) / 126, (13 - 3 * _S) / 63, 1 / 9),
        (1 / 32, 0.0, 0.0, 0.0, (91 - 21 * _S) / 576, 11 / 72, (-385 - 75 * _S) / 1152, (63 + 13 * _S) / 128),
        (
            *(1 / 14, 0.0, 0.0, 0.0, 1 / 9, (-733 - 147 * _S) / 2205),
            *((515 + 111 * _S) / 504, (-51 - 11 * _S) / 56, (132 + 28 * _S) / 245),
        ),
        (
            *(0.0, 0.0, 0.0, 0.0, (-42 + 7 * _S) / 18, (-18 + 28 * _S) / 45),
            *((-273 - 53 * _S) / 72, (301 + 53 * _S) / 72, (28 - 28 * _S) / 45, (49 - 7 * _S) / 18),
        ),
    ),
    weights=(1 / 20, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 49 / 180, 16 / 45, 49 / 180, 1 / 20),
)

METHODS = {"rk4": _RK4, "rk8": _RK8}
