"""Hermite polynomials: value and derivatives at both ends of an interval determine them.

Hairer, Norsett, Wanner, Solving ODEs I, II.6.  Plain arithmetic: data may be numbers, arrays or CasADi's symbols.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Data = Sequence[Any] | NDArray[Any]
_UPPER = {1: [[1]], 2: [[3, -1], [-2, 1]], 3: [[10, -4, 0.5], [-15, 7, -1], [6, -3, 0.5]]}
"""Number m of data at each end -> coefficients of the powers m ... 2m - 1, by the difference of the
data at the end and the Taylor polynomial from the start.
"""


def upper_coefficients(begin: Data, end: Data, size: Any) -> list[Any]:
    """Coefficients of θ^m ... θ^(2m - 1) in the Hermite polynomial; those of lower powers are of the Taylor polynomial.

    :param begin: value and derivatives by time at the start, θ = 0: m numbers, at most 3.
    :param end: the same at the end, θ = 1.
    :param size: length of the interval [s].
    """
    count = len(begin)
    lacks: list[Any] = []
    for order in range(count):
        taylor = begin[order]
        for n in range(order + 1, count):
            taylor = taylor + begin[n] * size ** (n - order) / math.factorial(n - order)
        lacks.append((end[order] - taylor) * size**order)
    return [sum(factor * lack for factor, lack in zip(factors, lacks, strict=True)) for factors in _UPPER[count]]


@cache
def coefficient_matrix(count: int) -> NDArray[np.float64]:
    """Matrix from data at both ends to coefficients of a Hermite polynomial in θ, 0 ≤ θ ≤ 1; shape (2 count, 2 count).

    The data are value and derivatives by θ, ``count`` at θ = 0, then as many at θ = 1.
    """
    data = np.eye(2 * count)
    lower = [row / math.factorial(order) for order, row in enumerate(data[:count])]
    return np.array([*lower, *upper_coefficients(data[:count], data[count:], 1.0)])
