"""Inputs of a Model Exchange FMU within a step, as polynomials of time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import final

import numpy as np

from liaisons.cosim.arrays import Indices, Numbers
from liaisons.cosim.compiled.calls import Call


@final
class InputMotion:
    """Taylor polynomials of inputs, from their values at the start of a step.

    :param orders: of the derivatives, each of the input with the number in ``rows``.
    :param derivatives: a buffer, and the indices of the derivatives in it.
    :param places: indices of the inputs among the held ones.
    :ivar values: of the inputs, shape (inputs,).
    :ivar first: these at ``start`` [s].
    :ivar slopes: the factors of the powers of time, shape (orders,).
    :ivar read: a call that reads the inputs into the values; ``write``: one that sets them.
    """

    read: Call
    write: Call

    def __init__(
        self,
        orders: Sequence[int],
        rows: Sequence[int],
        derivatives: tuple[Numbers, Sequence[int]],
        places: Indices,
    ) -> None:
        self.orders, self.rows, self._moving = (
            np.array(numbers, dtype=np.intp) for numbers in (orders, rows, derivatives[1])
        )
        self._all, self.places = np.asarray(derivatives[0]), places
        self._factorials = np.array([math.factorial(order) for order in orders])
        self.values = np.zeros(places.size)
        self.first, self.slopes, self.start = np.empty(places.size), np.empty(len(orders)), 0.0

    def begin(self, time: float) -> None:
        """Start the polynomials from the present values at a time [s]."""
        self.first[:], self.start = self.values, time
        np.divide(self._all[self._moving], self._factorials, out=self.slopes)

    def evaluate(self, time: float) -> None:
        """Set the values to those at a time [s]."""
        self.values[:] = self.first
        np.add.at(self.values, self.rows, self.slopes * (time - self.start) ** self.orders)
