"""The integrator of references: SciPy's DOP853, which shares no code with the solvers of FMUs and motions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.errors import LiaisonsError


def integrate(
    label: str,
    rates: Callable[[float, NDArray[np.float64]], ArrayLike],
    start: ArrayLike,
    span: tuple[float, float],
    *,
    times: ArrayLike | None = None,
    rtol: float,
    atol: ArrayLike,
    max_step: float = np.inf,
    error: type[Exception] = LiaisonsError,
) -> NDArray[np.float64]:
    """Solution y of y' = rates(t, y) at times, by DOP853; shape (n, times).

    :param label: of the error.
    :param start: y at the start of the span, shape (n,).
    :param times: ascending; None: those of the steps, the end of the span last.
    :param atol: absolute tolerance, of all or each.
    :param max_step: largest step.
    :raises error: where no step is small enough, or the solution is not finite.
    """
    from scipy.integrate import solve_ivp  # takes half a second, which not every import of the mechanics needs

    solution = solve_ivp(rates, span, start, "DOP853", times, rtol=rtol, atol=atol, max_step=max_step)
    if not solution.success or not np.all(np.isfinite(solution.y)):
        reached = solution.t[-1] if len(solution.t) else span[0]
        raise error(f"{label}: stopped at t = {reached:g}: {solution.message}")
    return solution.y
