"""Least squares with exact derivatives, within bounds."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from scipy.optimize import least_squares

from liaisons.errors import LiaisonsError
from liaisons_motion.identification.problems import Floats, Objective

_MAX_EVALUATIONS = 200
_NEXT = 1e-9
"""Relative distance between the values at which a search ends and others without a motion, which have ended it."""
_COST_ROUNDING = 1e-14
"""Relative rounding error of the cost; a predicted decrease below it ends the search."""


LOSSES: Mapping[str, Callable[[Floats], Floats]] = {
    "linear": lambda z: np.array([z, np.ones_like(z), np.zeros_like(z)]),
    "soft_l1": lambda z: np.array([2 * ((1 + z) ** 0.5 - 1), (1 + z) ** -0.5, -((1 + z) ** -1.5) / 2]),
}
"""Name -> function of squared residuals that returns the loss, its first and its second derivative."""


@final
@dataclass(frozen=True, eq=False)
class Minimum:
    """Unknowns at which a cost is least.

    :param cost: half the sum of the losses of squared residuals.
    :param message: of the method; empty if it has converged.
    """

    values: Floats
    cost: float
    message: str


@final
class _SearchEnd(Exception):  # noqa: N818 - not an error
    """Ends the search, with a minimum as its argument."""


@final
class _Search:
    """Residuals and derivatives as SciPy asks for them, of the unknowns that are not held.

    :ivar free: indices of these.
    :ivar refused: latest unknowns for which there is no motion, and the error.
    """

    def __init__(self, objective: Objective, start: Floats, held: Collection[int]) -> None:
        self._objective, self._start, self._loss = objective, start, objective.problem.loss
        self.free = np.setdiff1d(np.arange(len(start)), list(held))
        self._first, _ = objective(start)
        self.refused: list[tuple[Floats, LiaisonsError]] = []

    def all_values(self, unknowns: Floats) -> Floats:
        """Values of all unknowns, from those that are not held."""
        values = self._start.copy()
        values[self.free] = unknowns
        return values

    @property
    def first_cost(self) -> float:
        """Cost at the start."""
        return self._cost(self._first)

    def _cost(self, residuals: Floats) -> float:
        """Half the sum of the losses."""
        return float(LOSSES[self._loss](residuals**2)[0].sum() / 2)

    def residuals_or_nan(self, unknowns: Floats) -> Floats:
        """Residuals; not-a-number outside of the domain, after which SciPy tries a shorter step."""
        try:
            return self._objective(self.all_values(unknowns))[0]
        except LiaisonsError as error:
            self.refused[:] = [(unknowns.copy(), error)]
            return np.full_like(self._first, np.nan)

    def derivatives_or_end(self, unknowns: Floats) -> Floats:
        """Derivatives of the residuals; a _SearchEnd where the cost can fall by rounding only, or at the deadline."""
        values = self.all_values(unknowns)
        residuals, derivatives = self._objective(values)
        gradient, curvature = loss_derivatives(self._loss, residuals)
        weights = np.sqrt(np.maximum(curvature, np.finfo(float).eps))
        lowered = np.linalg.qr(weights[:, None] * derivatives[:, self.free])[0].T @ (gradient / weights)
        least = self._cost(residuals)
        if float(lowered @ lowered) / 2 <= _COST_ROUNDING * least:
            raise _SearchEnd(Minimum(values, least, ""))
        if time.monotonic() > self._objective.problem.deadline:
            raise _SearchEnd(Minimum(values, least, "time_limit has passed;"))
        return derivatives[:, self.free]


def minimise(objective: Objective, start: Floats, held: Collection[int] = (), accuracy: float = 1e-12) -> Minimum:
    """Minimum of the cost near a start.

    The search ends, with a message, at the deadline of the problem.

    :param held: indices of unknowns that keep their values.
    :param accuracy: relative, of cost and unknowns.
    :raises LiaisonsError: if residuals have no value at the start.
    """
    typical = np.abs(objective.rounded_to_zero(start))
    search = _Search(objective, start, held)
    free = search.free
    if not free.size:
        return Minimum(start.copy(), search.first_cost, "")
    try:
        solution: Any = least_squares(
            search.residuals_or_nan,
            start[free],
            search.derivatives_or_end,  # type: ignore[arg-type]  # SciPy takes functions, too
            bounds=objective.limits[:, free],
            loss=objective.problem.loss,  # type: ignore[arg-type]  # one of the names that SciPy has
            x_scale=np.where(typical[free] == 0, 1.0, typical[free]),
            ftol=accuracy,
            xtol=accuracy,
            gtol=None,  # type: ignore[arg-type]  # as SciPy documents
            max_nfev=_MAX_EVALUATIONS,
        )
    except _SearchEnd as end:
        return end.args[0]
    return Minimum(search.all_values(solution.x), float(solution.cost), _failure_message(solution, search.refused))


def _failure_message(solution: Any, refused: Sequence[tuple[Floats, LiaisonsError]]) -> str:
    """Reason why a search has not converged; empty if it has.

    :param refused: latest unknowns for which there is no motion, and the error.
    """
    for unknowns, error in refused:
        if np.allclose(unknowns, solution.x, rtol=_NEXT, atol=0):
            return f"least squares lead to where there is no motion ({error});"
    return "" if solution.status > 0 else solution.message


def loss_derivatives(loss: str, residuals: Floats) -> tuple[Floats, Floats]:
    """First and second derivative of half the loss by the residual."""
    squares = residuals**2
    _, slope, curvature = LOSSES[loss](squares)
    return slope * residuals, slope + 2 * squares * curvature
