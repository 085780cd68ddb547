"""Hermite polynomials between two communication points, as the derivatives that FMI takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from liaisons.cosim.coupling.signals import Curve, Vector

HIGHEST = 5
"""Order of the highest derivative that an FMU of ours takes."""

_DENSE = 4096
"""Matrices up to this size are multiplied faster as they are than by their non-zeros."""

# Coefficients of the powers m+1 ... 2m+1 of θ = (τ - t)/H, for a polynomial that has value and m derivatives 0 at
# θ = 0, from its value and derivatives at θ = 1 (Hairer, Norsett, Wanner, Solving ODEs I, II.6).
_LAST = {
    1: np.array([[1.0]]),
    2: np.array([[3.0, -1.0], [-2.0, 1.0]]),
    3: np.array([[10.0, -4.0, 0.5], [-15.0, 7.0, -1.0], [6.0, -3.0, 0.5]]),
}


def coefficients(count: int) -> NDArray[np.float64]:
    """Coefficients of the powers of θ, shape (2 count, 2 count), from ``count`` data at θ = 0 and as many at θ = 1.

    The data are derivatives with respect to θ, those of order 0 first.
    """
    first = np.diag([1 / math.factorial(i) for i in range(count)])
    taylor = np.array([[1 / math.factorial(n - i) if n >= i else 0.0 for n in range(count)] for i in range(count)])
    last = _LAST[count]
    return np.block([[first, np.zeros((count, count))], [-last @ taylor, last]])


def polynomials(
    curves: Sequence[Curve], width: int, highest: int
) -> tuple[list[tuple[int, int]], Callable[[Vector, float], Vector]]:
    """Derivatives of some inputs at the begin of a step, a linear function of the signals at both its ends.

    :param curves: what each input follows.
    :param width: number of signals at one end.
    :param highest: order of the highest derivative; 1 leaves straight lines.
    :returns: input and order of each derivative; and what calculates them from the signals at t and t + H, flat, and
        H [s].
    """
    which = [(k, order) for k in range(len(curves)) for order in range(1, highest + 1)]
    rows, columns, factors, after = [], [], [], []
    for row, (k, order) in enumerate(which):
        curve = curves[k] if highest > 1 else curves[k].alone()
        power = order + curve.order
        after.append(-power)
        if power >= 2 * len(curve.data):
            continue
        for place, factor in enumerate(coefficients(len(curve.data))[power]):
            end, i = divmod(place, len(curve.data))
            rows.append(row)
            columns.append((end * width + curve.data[i], i))
            factors.append(factor * math.factorial(power))
    known = {column: k for k, column in enumerate(dict.fromkeys(columns))}
    shape = len(which), len(known)
    sparse = coo_array((factors, (rows, [known[column] for column in columns])), shape)
    matrix: Any = sparse.toarray() if math.prod(shape) <= _DENSE else sparse.tocsr()
    signals = np.array([signal for signal, _ in known], dtype=np.intp)
    powers = np.array([power for _, power in known], dtype=float), np.array(after, dtype=float)

    @lru_cache(maxsize=2)
    def scales(size: float) -> tuple[Vector, Vector]:  # the matrix is that for H = 1; H changes by rounding at least
        return size ** powers[0], size ** powers[1]

    def derivatives(ends: Vector, size: float) -> Vector:
        before, after = scales(size)
        return after * (matrix @ (before * ends[signals]))

    return which, derivatives
