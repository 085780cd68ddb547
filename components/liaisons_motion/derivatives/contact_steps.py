"""Steps of a motion through the events of its contacts, in C, with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import lane_blocks, rows_of_blocks
from liaisons_motion.derivatives.compiled_steps import DIRECTIONS, CompiledSteps, refuse_many, stage_room
from liaisons_motion.derivatives.contact_events import ContactRecord
from liaisons_motion.derivatives.contacts import Contacts, Kind
from liaisons_motion.derivatives.steps import METHOD, Floats, Segment


@final
@dataclass(frozen=True, eq=False)
class Entries:
    """Steps and events of a segment, one after another.

    :param rows: as ``Entry`` in C.
    :param limits: as of the segment; ``table``: shared values with the memory of the contacts, row by row.
    """

    rows: NDArray[Any]
    limits: Floats
    table: Floats

    def __getitem__(self, name: str) -> Any:
        """A column."""
        return self.rows[name]

    def __len__(self) -> int:
        """Number of the entries."""
        return len(self.rows)

    @property
    def shared(self) -> Floats:
        """The row of the table of shared values that each entry refers to, shape (entries, shared values)."""
        return self.table[self["row"]]

    def arguments(self, k: Floats) -> list[Any]:
        """The first arguments of the C functions that take entries."""
        return [len(self), self.rows, self.limits, k, self.table]

    def part(self, numbers: Any) -> Self:
        """Entries by their numbers."""
        return replace(self, rows=self.rows[numbers])

    def of_kind(self, kind: Kind) -> Self:
        """The entries of a kind."""
        return self.part(self["kind"] == kind)


@final
class ContactSteps:
    """C functions that take the steps and events of a motion with contacts."""

    def __init__(self, contacts: Contacts, steps: CompiledSteps) -> None:
        """Take the contacts, and the C functions of the motion."""
        self._contacts, self._steps = contacts, steps

    def follow(
        self,
        segment: Segment,
        k: Floats,
        y: Floats,
        size: Floats,
        memory: Floats,
        *,
        record: ContactRecord,
        tolerance: float,
        sizes: Floats,
    ) -> tuple[Entries, float]:
        """Entries of a segment, and the time from which on no step is small enough; not-a-number if there is none.

        :param y: at the start; then where the segment ends; so is the ``memory`` of the contacts.
        :param size: of the first step; then of the next one.
        :param record: of its events.
        """
        most, (events, acts) = 4 * len(segment.rows) + 1000, record
        motion = [len(segment.rows), segment.instants, segment.rows, segment.limits, k, segment.table, float(tolerance)]
        while True:
            changing, short_at = [x.copy() for x in (size, y, memory)], np.full(1, np.nan)
            rows, table = np.empty(most + 1, self._contacts.entry), np.empty((most + 1, segment.table.shape[1]))
            states = [*changing[:2], stage_room(1, y), most, rows, table, segment.records, changing[2]]
            states += [len(events), events, acts, short_at]
            count = self._steps.call("run", "follow", *motion, sizes, *states)
            if count <= most:
                size[:], y[:], memory[:] = changing
                return Entries(rows[:count], segment.limits, table), float(short_at[0])
            refuse_many(most, rows["t"][most - 1])
            most *= 4

    def retrace(self, entries: Entries, k: Floats, y: Floats, *, keep: bool = False) -> tuple[Floats, Floats]:
        """Repeat entries: the state after each, (entries, states); with ``keep`` also before it, or at its stages."""
        states, stages = np.empty((len(entries), len(y))), stage_room(len(entries) if keep else 1, y)
        self._steps.call(
            "run", "retrace", *entries.arguments(k), y.copy(), states, stages, stages[0].size if keep else 0
        )
        return states, stages

    def tangents(
        self,
        entries: Entries,
        k: Floats,
        stages: Floats,
        *,
        of_y: Floats,
        slopes: tuple[Floats, Floats],
        saved: NDArray[Any],
    ) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
        """Derivatives of state and instant by the values, (values,), behind saved entries and behind the last one.

        :param of_y: derivatives of the first state.
        :param slopes: derivatives of the last instant of an event, and of the end of the segment.
        """
        states, count = of_y.shape
        directions = (lane_blocks(x, DIRECTIONS) for x in (np.eye(count), of_y))
        dk, dy = (np.vstack([blocks, np.zeros_like(blocks[:1])]) for blocks in directions)
        slope, last = (lane_blocks(x[None], DIRECTIONS) for x in slopes)
        blocks, number = len(slope), np.where(saved, np.cumsum(saved) - 1, -1)
        dt, dh = np.zeros((blocks + 1, DIRECTIONS)), np.zeros((blocks + 1, DIRECTIONS))
        dh[-1] = 1
        records, instants = (np.empty((int(saved.sum()), blocks, size, DIRECTIONS)) for size in (states, 1))
        work = np.empty((blocks + 1, METHOD.stages, states, DIRECTIONS))
        seeds = [stages, blocks, dk, last, slope, dt, dh, dy, work]
        self._steps.call("tangents", "sweep_tangents", *entries.arguments(k), *seeds, number, records, instants)
        behind = rows_of_blocks(dy[:-1], count), rows_of_blocks(slope, count)[0]
        return (rows_of_blocks(records, count), rows_of_blocks(instants, count)[:, 0]), behind

    def adjoint(
        self, entries: Entries, k: Floats, stages: Floats, weights: Floats, *, of_y: Floats, of_slope: Floats
    ) -> tuple[Floats, float]:
        """Derivatives of a sum by the values, and by the end of the segment.

        :param weights: derivatives by the states at all recorded times, (times, states).
        :param of_y: derivatives by the last state; then by the first one; ``of_slope``: by the last instant of an
            event, (1,); then by the first one.
        """
        of_k, of_last = np.zeros(len(k)), np.zeros(1)
        sums = [weights, of_y, of_k, of_slope, of_last]
        self._steps.call("adjoint", "sweep_adjoint", *entries.arguments(k), stages, *sums)
        return of_k, float(of_last[0])
