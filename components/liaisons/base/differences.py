"""Derivatives by differences of function values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from liaisons.base.arrays import Floats
from liaisons.errors import LiaisonsError

SIZES = (1e-3, 5e-4)
"""Of differences that are extrapolated, relative to the size of the variable, for values that are exact to rounding."""


def extrapolated_derivative(
    function: Callable[[float], Floats], unit: float, sizes: Sequence[float] = SIZES
) -> tuple[Floats, Floats]:
    """Derivative by Richardson's extrapolation of central differences, and an estimate of its error.

    :param function: of the multiple of ``unit`` by which its variable is moved.
    """
    try:
        row, ratio = [(function(h) - function(-h)) / (2 * h * unit) for h in sizes], 4.0
    except LiaisonsError:  # the edge of a domain: differences to one side
        begin, ratio = function(0.0), 2.0
        try:
            row = [(function(h) - begin) / (h * unit) for h in sizes]
        except LiaisonsError:
            row = [(begin - function(-h)) / (h * unit) for h in sizes]
    error, factor = np.zeros_like(row[0]), ratio
    while len(row) > 1:
        finer = [(factor * small - large) / (factor - 1) for large, small in pairwise(row)]
        error, row, factor = np.abs(finer[-1] - row[-1]), finer, ratio * factor
    return row[0], error
