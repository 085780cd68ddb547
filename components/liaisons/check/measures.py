"""Measures of signals: errors, orders of convergence, zero crossings and frequencies."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_finite, float_array
from liaisons.base.arrays import Floats
from liaisons.errors import ValidityError


def max_error(values: ArrayLike, reference: ArrayLike) -> float:
    """Largest absolute difference, ``max |values - reference|``.

    :param values: computed values, any shape.
    :param reference: expected values of the same shape, or one number.
    :returns: a number in the unit of the values; NaN if one of them is NaN.
    :raises ValidityError: for empty or different shapes.
    """
    computed = float_array("max_error: values", values, ValidityError)
    expected = float_array("max_error: reference", reference, ValidityError)
    if computed.size == 0 or (expected.ndim > 0 and computed.shape != expected.shape):
        raise ValidityError(
            f"max_error: shapes {computed.shape} and {expected.shape} cannot be compared; "
            "sample both at the same instants"
        )
    return float(np.max(np.abs(computed - expected)))


def slope(h: ArrayLike, errors: ArrayLike) -> float:
    """Order of convergence: slope of log(error) over log(h), by least squares.

    :param h: step sizes, shape (n,), n >= 3, all > 0 and not all equal.
    :param errors: errors at these step sizes, shape (n,), all > 0.
    :raises ValidityError: for fewer than three points, or a number that is not positive or not finite.
    """
    steps, sizes = float_array("slope: h", h, ValidityError), float_array("slope: errors", errors, ValidityError)
    if steps.ndim != 1 or steps.shape != sizes.shape:
        raise ValidityError(f"slope: {steps.shape} step sizes for {sizes.shape} errors; give one error per step size")
    if steps.size < 3:
        raise ValidityError(f"slope: {steps.size} points; a slope needs at least 3")
    for name, values in (("step size", steps), ("error", sizes)):
        if not np.all(np.isfinite(values) & (values > 0)):
            raise ValidityError(f"slope: {name}s {values.tolist()} must be finite and > 0 to have a logarithm")
    x, y = np.log(steps), np.log(sizes)
    x -= x.mean()
    if not np.any(x):
        raise ValidityError(f"slope: all step sizes are {steps[0]:g}; give different ones")
    return float(x @ y / (x @ x))


def crossings(time: ArrayLike, signal: ArrayLike, rate: ArrayLike, *, rising: bool = False) -> Floats:
    """Instants of the zeros of a signal, by a cubic Hermite spline: the error is of fourth order in the step.

    :param time: instants [s], shape (n,), increasing.
    :param signal: its values there, shape (n,).
    :param rate: its time derivative there, shape (n,).
    :param rising: only those at which it grows.
    :raises ValidityError: for different shapes, or instants that do not increase.
    """
    from scipy.interpolate import CubicHermiteSpline

    arguments = {"time": time, "signal": signal, "rate": rate}
    t, x, x_dot = (float_array(f"crossings: {name}", values, ValidityError) for name, values in arguments.items())
    if not (t.ndim == 1 and t.shape == x.shape == x_dot.shape and t.size > 1 and np.all(np.diff(t) > 0)):
        raise ValidityError(f"crossings: time, signal, rate of shapes {t.shape}, {x.shape}, {x_dot.shape}; give one of "
                            "each per instant, and increasing instants")  # fmt: skip
    spline = CubicHermiteSpline(t, x, x_dot)
    roots = spline.roots(extrapolate=False)
    return roots[spline(roots, 1) > 0] if rising else roots


def frequencies(cosines: ArrayLike, step: float) -> Floats:
    """Angular frequencies of cosines [rad/s], from q(t + h) + q(t - h) = 2 cos(Ωh) q(t) by least squares.

    :param cosines: at equal steps, shape (..., n), n at least 3; each without offset, slower than π/h.
    :param step: h [s].
    :returns: shape (...).
    :raises ValidityError: for fewer than three values of one.
    """
    q = float_array("frequencies: cosines", cosines, ValidityError)
    check_finite("frequencies: step", step, ValidityError)
    if q.ndim == 0 or q.shape[-1] < 3:
        raise ValidityError(f"frequencies: cosines of shape {q.shape}; give at least three values of each")
    around, middle = q[..., 2:] + q[..., :-2], q[..., 1:-1]
    return np.arccos(np.sum(around * middle, axis=-1) / np.sum(middle**2, axis=-1) / 2) / step
