"""Steps of one motion: where they begin and end, between events."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import Floats
from liaisons_motion.right_hand_sides import METHODS

METHOD = METHODS["rk8"]

Integers = NDArray[np.int_]
Event: TypeAlias = tuple[float, Floats]
"""Instant of an event [s], and its derivatives by the values, (values,)."""
StepEnds: TypeAlias = tuple[Floats, Integers]
"""Ends of steps as fractions of their intervals, one after another, and the number of steps in each interval."""


@final
@dataclass(frozen=True, eq=False)
class Segment:
    """The motion between two events, divided at all instants at which a step has to end.

    :param instants: ends of the intervals [s], ascending, (intervals + 1,).
    :param slopes: derivatives of the instants by the values, (intervals + 1, values).
    :param records: number of the recorded time at each instant; -1: none.
    :param rows: index of the row of shared values, one an interval.
    :param limits: first and last instant at which the equations of this segment hold.
    :param table: shared values, (rows, values).
    :param event: with which the segment begins; None at the start of the motion.
    """

    instants: Floats
    slopes: Floats
    records: Integers
    rows: Integers
    limits: Floats
    table: Floats
    event: Event | None


@final
@dataclass(frozen=True, eq=False)
class Steps:
    """Steps of a segment: starts and sizes [s]; and, as of :class:`Segment`, rows, limits and table.

    :param of_t: derivatives of starts by the values, (steps, values); (1, values) if all are 0; of_h: of sizes.
    :param records: number of the recorded time at the end of each step; -1: none.
    :param event: just before the first step; None: no event.
    """

    t: Floats
    h: Floats
    rows: Integers
    limits: Floats
    table: Floats
    of_t: Floats
    of_h: Floats
    records: Integers
    event: Event | None

    @property
    def recorded_indices(self) -> Integers:
        """Indices of the recorded times at which steps end, ascending."""
        return self.records[self.records >= 0]

    def arguments(self, k: Floats) -> list[Any]:
        """First arguments of the C functions that take these steps."""
        return [len(self.t), self.t, self.h, self.rows, self.limits, k, self.table]

    def part(self, begin: int, end: int) -> Steps:
        """Steps with numbers from begin to end - 1."""
        part = slice(begin, end)
        of_t, of_h = (rows[part] if len(rows) == len(self.t) else rows for rows in (self.of_t, self.of_h))
        t, h, rows, records = self.t[part], self.h[part], self.rows[part], self.records[part]
        event = None if begin else self.event
        return replace(self, t=t, h=h, rows=rows, of_t=of_t, of_h=of_h, records=records, event=event)


def segment_steps(segment: Segment, step_ends: StepEnds) -> Steps:
    """Steps of a segment, with ends at fractions of its intervals."""
    ends, counts = step_ends
    slopes, records = segment.slopes, np.full(len(ends), -1)
    interval, last = np.repeat(np.arange(len(counts)), counts), np.cumsum(counts) - 1
    begins = np.concatenate([[0.0], ends[:-1]])
    begins[last[:-1] + 1] = 0.0
    sizes, spans = ends - begins, np.diff(segment.instants)[interval]
    of_t = of_h = slopes[:1]
    if slopes.any():
        changes = np.diff(slopes, axis=0)[interval]
        of_t, of_h = slopes[interval] + begins[:, None] * changes, sizes[:, None] * changes
    records[last] = segment.records[1:]
    return Steps(
        segment.instants[interval] + begins * spans,
        sizes * spans,
        segment.rows[interval],
        segment.limits,
        segment.table,
        of_t,
        of_h,
        records,
        segment.event,
    )
