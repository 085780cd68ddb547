"""How the inputs of an FMU of Model Exchange move within a step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from ctypes import c_double
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.instances.protocol import Numbers


@final
class InputMotion:
    """Taylor polynomials of inputs, from where they are at the begin of a step.

    :param orders: of the derivatives that are told, each of the input with the number in ``rows``.
    :param told: where the derivatives stand, and which of them.
    :param places: of the inputs among all that are held.
    :ivar values: of the inputs, shape (inputs,); ``buffer`` is the same.
    :ivar first: these at the begin, which is ``start`` [s].
    :ivar slopes: the factors of the powers of time, shape (orders,).
    :ivar read: a call that reads the inputs into the buffer; ``write``: one that sets them.
    """

    read: Call
    write: Call

    def __init__(
        self, orders: Sequence[int], rows: Sequence[int], told: tuple[Numbers, Sequence[int]], places: NDArray[np.intp]
    ) -> None:
        self.orders, self.rows, self._told = (np.array(numbers, dtype=np.intp) for numbers in (orders, rows, told[1]))
        self._all, self.places = np.ctypeslib.as_array(told[0]), places
        self._factorials = np.array([math.factorial(order) for order in orders])
        self.buffer = (c_double * places.size)()
        self.values = np.ctypeslib.as_array(self.buffer)
        self.first, self.slopes, self.start = np.empty(places.size), np.empty(len(orders)), 0.0

    def begin(self, time: float) -> None:
        """Take the inputs for what they are now [s]."""
        self.first[:], self.start = self.values, time
        np.divide(self._all[self._told], self._factorials, out=self.slopes)

    def go(self, time: float) -> None:
        """Go to a time [s]."""
        self.values[:] = self.first
        np.add.at(self.values, self.rows, self.slopes * (time - self.start) ** self.orders)
