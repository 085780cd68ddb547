"""The numbers of one instance, as arrays that its parts share."""

from __future__ import annotations

import math

import numpy as np

from .calls import Array
from .table import Table


class Vectors:
    """Arrays of numbers, named as in the functions of :class:`~.table.Table`.

    :ivar values: all Real variables by value reference: k, given (inputs as set by the importer), z, drawn; those below
        the first parameter belong to none.
    :ivar moving: what a step changes: t, y, u (inputs at the present time), m, past.
    :ivar now: (t, y, u), the first part of it.
    :ivar past: H and u of the last step at its start, H = 0 if there was none; then the distances and the time of the
        last comparison, see :mod:`~.prescribed`.
    :ivar H: length of the present step, shape (1,).
    :ivar size: nominal values of y, which the tolerance is relative to.
    """

    def __init__(self, table: Table) -> None:
        start, inputs = table.functions["start"], len(table.inputs)
        states, memory = start.numel_out(0), start.numel_out(1)
        self.values = np.array([math.nan] * table.first + [entry.start or 0.0 for entry in table.variables])
        _, self.k, self.given, self.z, self.drawn = _parts(
            self.values, table.first, len(table.parameters), inputs, len(table.outputs)
        )
        self.moving = np.zeros(1 + states + inputs + memory + 1 + inputs + len(table.active) + 1)
        self.t, self.y, self.u, self.m, self.past = _parts(self.moving, 1, states, inputs, memory)
        self.past_H, self.past_u, self.went, self.compared_at = _parts(self.past, 1, inputs, len(table.active))
        self.now = self.moving[: 1 + states + inputs]
        self.H, self.size = np.zeros(1), np.ones(states)


def _parts(array: Array, *sizes: int) -> list[Array]:
    """Views of consecutive parts; the last one is the rest."""
    return np.split(array, np.cumsum(sizes))
