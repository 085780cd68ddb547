"""References whose last step is a quadrature or an integration, done to rounding."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base import reference_integration
from liaisons.errors import ValidityError


def integrate(
    owner: object,
    rates: Callable[[float, NDArray], ArrayLike],
    start: ArrayLike,
    t: ArrayLike,
    longest: float = np.inf,
) -> NDArray:
    """Solution y(t) of y' = rates(t, y), y(0) = start, at a relative tolerance of 1e-13.

    :param owner: closed form, by its name in the error.
    :param start: shape (n,).
    :param t: times [s], any shape and order, >= 0.
    :param longest: largest step [s].
    :returns: shape (n, *t.shape).
    :raises ValidityError: for a negative time, or where the integration cannot go on.
    """
    times, order = np.unique(np.ravel(np.asarray(t, dtype=float)), return_inverse=True)
    if np.any(times < 0):
        raise ValidityError(f"{owner}: t = {np.min(times)} must be >= 0")
    y = np.repeat(np.reshape(np.asarray(start, dtype=float), (-1, 1)), times.size, axis=1)
    if times[-1] > 0:
        y = reference_integration.integrate(
            *(f"{owner}", rates, y[:, 0], (0.0, times[-1])),
            times=times,
            rtol=1e-13,
            atol=1e-14,
            max_step=longest,
            error=ValidityError,
        )
    return y[:, order].reshape(-1, *np.shape(t))
