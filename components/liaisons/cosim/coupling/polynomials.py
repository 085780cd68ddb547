"""Hermite polynomials between two communication points, as the derivatives that FMI takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, final

import numpy as np

from liaisons.base.hermite import coefficients
from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.coupling.signals import Curve

HIGHEST = 5
"""Order of the highest derivative that an FMU of ours takes."""

_MOST = 6
"""Largest number of data of a curve: three at either end of a step."""


@final
@dataclass(frozen=True)
class Polynomials:
    """Derivatives of inputs at the start of a step, as linear functions of the signals at both its ends.

    :param which: input and order of each derivative.
    :param signals: indices of the signals that they depend on, at both ends, flat; ``scaling``: times which power of H.
    :param terms: of each derivative those of the known that it is a sum of, with ``factors``; shape (derivatives,
        terms).
    :param after: by which power of H it is divided then.
    """

    which: Sequence[tuple[int, int]]
    signals: Indices
    scaling: Indices
    terms: Indices
    factors: Vector
    after: Indices


def polynomials(curves: Sequence[Curve], width: int, highest: int) -> Polynomials:
    """Derivatives of inputs at the start of a step, by the signals at its ends.

    :param curves: what each input follows.
    :param width: number of signals at one end.
    :param highest: order of the highest derivative; 1 leaves straight lines.
    """
    curves = curves if highest > 1 else [curve.linear() for curve in curves]
    signals: dict[tuple[int, int], int] = {}
    for curve in curves:
        for end in (0, width):
            for i, index in enumerate(curve.data):
                signals.setdefault((end + index, i), len(signals))
    terms = [tuple(signals[end + index, i] for end in (0, width) for i, index in enumerate(c.data)) for c in curves]
    orders = tuple(curve.order for curve in curves)
    indices = np.array([index for index, _ in signals], dtype=np.intp)
    return Polynomials(signals=indices, **_alike(tuple(terms), orders, tuple(i for _, i in signals), highest))


@lru_cache(maxsize=1024)
def _alike(terms: tuple[tuple[int, ...], ...], orders: tuple[int, ...], scaling: tuple[int, ...], highest: int) -> Any:
    """The fields of :class:`Polynomials` that do not depend on indices; shared, to stay in the processor's cache."""
    which = [(k, order) for k in range(len(terms)) for order in range(1, highest + 1)]
    columns = np.empty((len(which), _MOST), dtype=np.intp)
    factors = np.zeros(columns.shape)
    for row, (k, order) in enumerate(which):
        power, many = order + orders[k], len(terms[k])
        columns[row] = terms[k][0]  # beyond the terms, times 0
        if power < many:
            columns[row, :many] = terms[k]
            factors[row, :many] = coefficients(many // 2)[power] * math.factorial(power)
    after = np.array([order + orders[k] for k, order in which], dtype=np.intp)
    powers_before = np.array(scaling, dtype=np.intp)
    return {"which": which, "scaling": powers_before, "terms": columns, "factors": factors, "after": after}
