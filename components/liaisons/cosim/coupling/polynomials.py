"""Hermite polynomials between two communication points, as the derivatives that FMI takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, final

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


@final
class Polynomials:
    """Derivatives of some inputs at the begin of a step, a linear function of the signals at both its ends.

    :param curves: what each input follows.
    :param width: number of signals at one end.
    :param highest: order of the highest derivative; 1 leaves straight lines.
    """

    def __init__(self, curves: Sequence[Curve], width: int, highest: int) -> None:
        self.which = [(k, order) for k in range(len(curves)) for order in range(1, highest + 1)]
        rows, columns, factors, powers = [], [], [], []
        for row, (k, order) in enumerate(self.which):
            curve = curves[k] if highest > 1 else curves[k].alone()
            power = order + curve.order
            powers.append(-power)
            if power >= 2 * len(curve.data):
                continue
            for place, factor in enumerate(coefficients(len(curve.data))[power]):
                end, i = divmod(place, len(curve.data))
                rows.append(row)
                columns.append((end * width + curve.data[i], i))
                factors.append(factor * math.factorial(power))
        known = {column: k for k, column in enumerate(dict.fromkeys(columns))}
        shape = len(self.which), len(known)
        matrix = coo_array((factors, (rows, [known[column] for column in columns])), shape)
        self._matrix: Any = matrix.toarray() if math.prod(shape) <= _DENSE else matrix.tocsr()
        self._signals = np.array([signal for signal, _ in known], dtype=np.intp)
        self._powers = np.array([power for _, power in known], dtype=float), np.array(powers, dtype=float)
        self._size = math.nan
        self._before = self._after = np.empty(0)

    def __call__(self, ends: Vector, size: float) -> Vector:
        """The derivatives, in the order of :attr:`which`.

        :param ends: the signals at t and t + H, flat.
        :param size: H [s].
        """
        if size != self._size:  # the matrix is that for H = 1; between steps H changes by rounding at least
            self._before, self._after = (size**powers for powers in self._powers)
            self._size = size
        return self._after * (self._matrix @ (self._before * ends[self._signals]))
