"""Numbers that a claim is judged by: the largest error and the order of convergence."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from liaisons.arguments import finite, numbers
from liaisons.errors import ValidityError


def max_error(values: ArrayLike, reference: ArrayLike) -> float:
    """Largest absolute difference, max |values - reference|.

    :param values: what was computed, any shape.
    :param reference: what it should be: the same shape, or one number.
    :returns: a number in the unit of the values; NaN if one of them is NaN.
    :raises ValidityError: for empty or different shapes.
    """
    computed = numbers("max_error: values", values, ValidityError)
    expected = numbers("max_error: reference", reference, ValidityError)
    if computed.size == 0 or (expected.ndim > 0 and computed.shape != expected.shape):
        raise ValidityError(
            f"max_error: shapes {computed.shape} and {expected.shape} cannot be compared; "
            "sample both at the same instants"
        )
    return float(np.max(np.abs(computed - expected)))


def slope(h: ArrayLike, errors: ArrayLike, *, floor: float = 0.0) -> float:
    """Order of convergence: the slope of log(error) against log(h), by least squares.

    :param h: step sizes, shape (n,), all > 0 and not all equal.
    :param errors: errors at these step sizes, shape (n,), all > 0 unless at the floor.
    :param floor: rounding level of the errors; points at or below it say nothing of the order and are left out.
    :raises ValidityError: if fewer than three points are left, or a number is not positive or not finite.
    """
    steps, sizes = numbers("slope: h", h, ValidityError), numbers("slope: errors", errors, ValidityError)
    finite("slope: floor", floor, ValidityError)
    if steps.ndim != 1 or steps.shape != sizes.shape:
        raise ValidityError(f"slope: {steps.shape} step sizes for {sizes.shape} errors; give one error a step size")
    above = ~(sizes <= floor) if floor > 0 else np.ones(sizes.shape, dtype=bool)  # NaN stays and is refused below
    steps, sizes = steps[above], sizes[above]
    if steps.size < 3:
        raise ValidityError(f"slope: {steps.size} points above the floor {floor:g}; a slope needs at least 3")
    for name, given in (("step size", steps), ("error", sizes)):
        if not np.all(np.isfinite(given) & (given > 0)):
            raise ValidityError(f"slope: {name}s {given.tolist()} must be finite and > 0 to have a logarithm")
    x, y = np.log(steps), np.log(sizes)
    x -= x.mean()
    if not np.any(x):
        raise ValidityError(f"slope: all step sizes are {steps[0]:g}; give different ones")
    return float(x @ y / (x @ x))
