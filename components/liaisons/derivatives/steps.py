"""Steps of one motion: where they begin and end, between events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.ensembles.methods import METHODS

METHOD = METHODS["rk8"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int_]


@final
@dataclass(frozen=True, eq=False)
class Segment:
    """Intervals between two events.

    :param cuts: their ends, ascending.
    :param rows: index of the row of shared values, one an interval.
    :param limits: first and last instant at which the equations of this segment hold.
    :param table: shared values, (rows, values).
    """

    cuts: Floats
    rows: Integers
    limits: Floats
    table: Floats


@final
@dataclass(frozen=True, eq=False)
class Steps:
    """Steps between two events: starts, sizes, and, as of :class:`Segment`, rows, limits and table.

    :param of_t: derivatives of starts by the values, (steps, values); (1, values) if all are 0; of_h: of sizes.
    :param record: number of the record that is written at the end of a step; -1: none.
    :param records: count.
    """

    t: Floats
    h: Floats
    rows: Integers
    limits: Floats
    table: Floats
    of_t: Floats
    of_h: Floats
    record: Integers
    records: int

    def arguments(self, k: Floats) -> list[Any]:
        """What C functions take."""
        return [len(self.t), self.t, self.h, self.rows, self.limits, k, self.table]
