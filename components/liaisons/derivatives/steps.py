"""Steps of one motion: where they begin and end, between events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias, final

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


@final
@dataclass(frozen=True, eq=False)
class Cuts:
    """Instants at which steps end.

    :param slopes: their derivatives by the values, (instants, values).
    :param events: which of them are events.
    :param records: number of the recorded time; -1: none.
    """

    times: Floats
    slopes: Floats
    events: NDArray[np.bool_]
    records: Integers

    def order(self) -> tuple[bytes, bytes]:
        """Which kinds of instants follow each other."""
        return self.events.tobytes(), self.records.tobytes()


Parts: TypeAlias = tuple[Floats, Integers]
"""Ends of steps as parts of their intervals, one after another, and how many there are in each interval."""
NOT_FIXED: tuple[tuple[bytes, bytes], list[Parts]] = (b"", b""), []


def steps_between(cuts: Cuts, inside: slice, parts: Parts, segment: Segment) -> tuple[Steps, Integers]:
    """Steps of a segment, and the numbers of the recorded times."""
    ends, counts = parts
    slopes, records = cuts.slopes[inside], cuts.records[inside][1:]
    which, last = np.repeat(np.arange(len(counts)), counts), np.cumsum(counts) - 1
    begins = np.concatenate([[0.0], ends[:-1]])
    begins[last[:-1] + 1] = 0.0
    sizes, spans = ends - begins, np.diff(segment.cuts)[which]
    if slopes.any():
        changes = np.diff(slopes, axis=0)[which]
        of_t, of_h = slopes[which] + begins[:, None] * changes, sizes[:, None] * changes
    else:
        of_t = of_h = slopes[:1]
    recorded, record = records[records >= 0], np.full(len(which), -1)
    record[last[records >= 0]] = np.arange(len(recorded))
    t, h = segment.cuts[which] + begins * spans, sizes * spans
    rows, limits, table = segment.rows[which], segment.limits, segment.table
    return Steps(t, h, rows, limits, table, of_t, of_h, record, len(recorded)), recorded


def part_of(steps: Steps, recorded: Integers, begin: int, end: int) -> tuple[Steps, Integers]:
    """Steps from one number to another, and the numbers of the recorded times."""
    part = slice(begin, end)
    record = steps.record[part]
    inside = record[record >= 0]
    local = np.where(record >= 0, record - (inside[0] if inside.size else 0), -1)
    of_t, of_h = (rows[part] if len(rows) == len(steps.t) else rows for rows in (steps.of_t, steps.of_h))
    t, h, rows = steps.t[part], steps.h[part], steps.rows[part]
    return Steps(t, h, rows, steps.limits, steps.table, of_t, of_h, local, len(inside)), recorded[inside]
