"""Expressions as functions of numbers: symbols frozen at their values, motions integrated, samples checked."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.reference_integration import integrate
from liaisons.errors import ComponentError
from liaisons.mechanics import Equations
from liaisons_motion.analysis.quantity import symbol_values

_TOLERANCE = 1e-12
"""Of integrations, relative and absolute."""


def with_values(equations: Equations, expression: ca.SX, values: Mapping[str, ArrayLike], moving: ca.SX) -> ca.SX:
    """Expression with numbers in place of all symbols of the mechanism but the moving ones."""
    variables, numbers = set(map(str, ca.vertsplit(moving))), symbol_values(equations, values)
    symbols = {name: symbol for name, symbol in equations.symbols.items() if name not in variables}
    column = ca.DM([float(numbers[name]) for name in symbols])
    return ca.substitute(expression, ca.vertcat(*symbols.values()), ca.SX(column))


def value_at_zero(expression: ca.SX, t: ca.SX) -> float:
    """Value at t = 0 of an expression of t."""
    return float(ca.Function("start", [t], [expression])(0))


def final_state(rate: ca.SX, X: ca.SX, start: NDArray, *, t: ca.SX, duration: float, owner: str) -> NDArray:
    """State at the end of the motion Ẋ = rate from ``start``, over [0, duration].

    :param rate: expression of t and X.
    :param owner: name of the component, for the message.
    :raises ComponentError: where the integration cannot go on.
    """
    function = ca.Function("velocity", [t, X], [ca.densify(rate)])
    return integrate(
        owner,
        lambda instant, state: np.asarray(function(instant, state))[:, 0],
        start,
        (0.0, duration),
        times=[duration],
        rtol=_TOLERANCE,
        atol=_TOLERANCE,
        error=ComponentError,
    )[:, -1]


def checked_times(equations: Equations, time: ArrayLike, shape: tuple[int, ...]) -> NDArray:
    """Array of the times of samples; a ComponentError unless they increase and are as many as the samples."""
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0):
        raise ComponentError(f"{equations.name}: time of shape {t.shape} must hold increasing instants, 2 at least")
    if shape != t.shape:
        raise ComponentError(
            f"{equations.name}: {t.size} instants for samples of shape {shape}; give one sample an instant"
        )
    return t
