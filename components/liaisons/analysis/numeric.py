"""Expressions as functions of numbers: symbols frozen at their values, motions integrated, samples checked."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.analysis.quantity import symbol_values
from liaisons.base.reference_integration import integrate
from liaisons.errors import ComponentError
from liaisons.mechanics.equations import Equations


def with_values(equations: Equations, expression: ca.SX, values: Mapping[str, ArrayLike], moving: ca.SX) -> ca.SX:
    """The expression with numbers for all symbols of the mechanism except the moving ones."""
    variables = {symbol.__hash__() for symbol in ca.vertsplit(moving)}
    numbers = symbol_values(equations, values)
    symbols = {name: symbol for name, symbol in equations.symbols.items() if symbol.__hash__() not in variables}
    column = ca.DM([float(numbers[name]) for name in symbols])
    return ca.substitute(expression, ca.vertcat(*symbols.values()), ca.SX(column))


def at_zero(expression: ca.SX, t: ca.SX) -> float:
    """Value of a function of time at t = 0."""
    return float(ca.Function("start", [t], [expression])(0))


def final_state(
    rate: ca.SX, X: ca.SX, start: NDArray, *, t: ca.SX, duration: float, tolerance: float, owner: str
) -> NDArray:
    """X at the end of Ẋ = rate(t, X) over [0, duration].

    :param owner: name of the component, for the message.
    :raises ComponentError: where the integration cannot go on.
    """
    function = ca.Function("velocity", [t, X], [ca.densify(rate)])

    def velocity(instant: float, state: NDArray) -> NDArray:
        """Rate of the state, (n,)."""
        return np.asarray(function(instant, state))[:, 0]

    tolerances = {"rtol": tolerance, "atol": tolerance}
    span, error = (0.0, duration), ComponentError
    return integrate(owner, velocity, start, span, times=[duration], **tolerances, error=error)[:, -1]


def checked_times(equations: Equations, time: ArrayLike, shape: tuple[int, ...]) -> NDArray:
    """Times of samples as an array, checked to increase and to be as many as the samples."""
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0):
        raise ComponentError(f"{equations.name}: time of shape {t.shape} must hold increasing instants, 2 at least")
    if shape != t.shape:
        raise ComponentError(
            f"{equations.name}: {t.size} instants for samples of shape {shape}; give one sample an instant"
        )
    return t


def eigenproblem(K: NDArray, M: NDArray) -> tuple[NDArray, NDArray]:
    """Eigenvalues, ascending, and eigenvectors of K u = Ω² M u as columns, uᵀ M u = 1 (K eq. 139, 151)."""
    from scipy.linalg import eigh

    return eigh(K, M)
