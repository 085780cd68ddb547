"""Communication steps and their recording, by compiled code if there is a C compiler, else by Python, to the same bits.

Compiled code calls Python for calls without a :class:`liaisons.cosim.compiled.calls.Record` (functions of time, FMI 3.0
arrays that are connected in part).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from ctypes import byref, c_bool, c_size_t, c_ssize_t, c_void_p
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.compiled.calls import HEADER, Call, Indices, Vector, call_records, record_type
from liaisons.cosim.coupling.bus import Bus
from liaisons.errors import EndedError, SimulationError

_ROUNDING = 1e-6
"""Tolerance for the end of a step, relative to its size."""


@final
@dataclass(eq=False)
class _Piece:
    """Points between two saved states, which later states share; its arrays are None while the loop has them."""

    before: _Piece | None = None
    end: int = 0
    arrays: Sequence[Any] | None = None

    @property
    def span(self) -> slice:
        """Indices of its points."""
        return slice(self.before.end if self.before else 0, self.end)


@final
class _History:
    """Saved points of a loop, piece by piece: a tree, of which one branch is in the arrays of the loop.

    To save costs nothing for points that are saved already; points are copied when others take their place.
    """

    def __init__(self) -> None:
        self._latest = _Piece()

    def save(self, end: int) -> _Piece:
        """The points before an index."""
        if end > self._latest.end:
            self._latest = _Piece(self._latest, end)
        return self._latest

    def truncate(self, end: int, arrays: Sequence[NDArray[Any]]) -> None:
        """Copy what was saved from an index on: it may change in the arrays."""
        while self._latest.before and self._latest.end > end:
            self._latest.arrays = [array[self._latest.span].copy() for array in arrays]
            self._latest = self._latest.before

    def restore(self, piece: _Piece, arrays: Sequence[NDArray[Any]]) -> None:
        """Put saved points back into the arrays."""
        copied: list[_Piece] = []
        branch: _Piece | None = piece
        while branch and branch.arrays is not None:
            copied.append(branch)
            branch = branch.before
        self.truncate(branch.end if branch else 0, arrays)
        for one in reversed(copied):
            for array, values in zip(arrays, one.arrays or (), strict=True):
                array[one.span] = values
            one.arrays = None
        self._latest = piece


_LoopRecord = record_type(HEADER.with_name("loop.c"), "Loop")


@final
class Loop:
    """Communication steps, and the recorded values of the bus after each.

    :param step: calls of one step.
    :param instant: calls at one instant.
    :param capacity: expected number of communication points.
    :ivar done: number of recorded points.
    :ivar rows: values of the bus at each of :attr:`times` [s], shape (points, width of the bus).
    :ivar result_times: times of the points in the result [s], not-a-number for points that are not in it.
    :ivar after_break: breaks, with the values right of them.
    """

    def __init__(self, step: Sequence[Call], instant: Sequence[Call], bus: Bus, capacity: int) -> None:
        self.done, self.rows = 0, np.empty((capacity, bus.values.size))
        self.times, self.result_times = np.empty((2, capacity))
        self.after_break = np.zeros(capacity, dtype=bool)
        self._step, self._instant, self._bus = step, instant, bus
        self._history = _History()
        self._library = library = compiled.step_library()
        if library is not None:
            library.advance.argtypes, library.advance.restype = (c_void_p, c_size_t, c_size_t, c_bool), c_size_t
            library.settle.argtypes, library.settle.restype = (c_void_p, c_size_t), c_bool
            self._refusal = (c_ssize_t * 2)()
            record = _LoopRecord(step_calls=len(step), instant_calls=len(instant), width=bus.values.size)
            record.point(step=call_records(step), instant=call_records(instant), refusal=self._refusal)
            record.point(start=bus.start, size=bus.size, end=bus.end, bus=bus.values)
            record.point(times=self.times, result_times=self.result_times, rows=self.rows)
            self._record, self._address = record, byref(record)
            self._advance, self._settle = library.advance, library.settle

    def add(self, time: float, values: Vector, *, result_time: float | None = None, after_break: bool = False) -> None:
        """Record a point that was reached without :meth:`advance`.

        :param result_time: its time in the result [s], which may differ by rounding; None: it is not in the result.
        :param after_break: it is a break, with the values right of it.
        """
        if self.done == len(self.rows):
            self._make_room(1)
        last = self.done
        self.rows[last], self.times[last], self.after_break[last] = values, time, after_break
        self.result_times[last] = math.nan if result_time is None else result_time
        self.done += 1

    @property
    def end(self) -> float:
        """End of the last step [s]."""
        return float(self.times[self.done - 1])

    @property
    def time(self) -> float:
        """End of the last step as it is in the result [s]."""
        time = float(self.result_times[self.done - 1])
        return self.end if math.isnan(time) else time

    @property
    def begins_piece(self) -> bool:
        """Whether the last point is the start or a break."""
        return self.done == 1 or bool(self.after_break[self.done - 1])

    def join(self, steps: int, *, in_result: bool) -> None:
        """Make one step of the last ones, at whose end is a point of the result or none."""
        first, last = self.done - steps, self.done - 1
        self.truncate(first + 1)  # first: what was saved is copied before it changes
        for array in (self.rows, self.times):
            array[first] = array[last]
        self.result_times[first] = self.times[first] if in_result else math.nan

    def begin_piece(self, tiny_step: float) -> None:
        """Make a break of the last point, to be settled, and lead a tiny step to it [s]."""
        last, new = self.done - 1, self.done
        if last and not self.after_break[last]:
            if new == len(self.rows):
                self._make_room(1)
            times, result_times = self.times, self.result_times
            times[new], result_times[new] = times[last], result_times[last]
            times[last] -= tiny_step
            result_times[last] = math.nan
            self.after_break[new] = True
            self.done += 1

    def truncate(self, points: int) -> None:
        """Remove all points but the first ones."""
        self._history.truncate(points - 1, self._arrays)
        self.after_break[points : self.done] = False
        self.done = points

    def save(self) -> tuple[_Piece, list[Any]]:
        """All points, for :meth:`restore`; states share them but for the last one, the only one that may change."""
        last = self.done - 1
        return self._history.save(last), [array[last : self.done].copy() for array in self._arrays]

    def restore(self, saved: tuple[_Piece, Sequence[Any]]) -> None:
        """Replace all points by saved ones."""
        piece, ends = saved
        self._history.restore(piece, self._arrays)
        for array, end in zip(self._arrays, ends, strict=True):
            array[piece.end : piece.end + 1] = end
        self.after_break[piece.end + 1 : self.done] = False
        self.done = piece.end + 1

    @property
    def _arrays(self) -> tuple[NDArray[Any], ...]:
        return self.rows, self.times, self.result_times, self.after_break

    def hide(self, instants: Vector) -> None:
        """Leave points at these instants [s] out of the result."""
        times = self.result_times[: self.done]
        times[np.isin(times, instants)] = math.nan

    def result_rows(self) -> tuple[Indices, Vector]:
        """Indices of the rows in the result, and their times [s]."""
        rows = np.flatnonzero(~np.isnan(self.result_times[: self.done]))
        return rows, self.result_times[rows]

    def advance(self, instants: Sequence[float], *, in_result: bool = True) -> None:
        """Make steps to instants [s], one after the other, and record the bus after each.

        :raises SimulationError: if an FMU refuses a call, or ends the simulation; :attr:`done` says how far it came.
        """
        first, steps = self.done, len(instants)
        if first + steps > len(self.rows):
            self._make_room(steps)
        self.times[first : first + steps] = instants
        self._make_steps(steps, in_result)

    def step(self, end: float) -> None:
        """Make one step to an instant [s] of the result, as :meth:`advance` does."""
        if self.done == len(self.rows):
            self._make_room(1)
        self.times[self.done] = end
        self._make_steps(1, True)

    def settle(self) -> None:
        """Make the calls at the last instant, and record the bus there anew."""
        last = self.done - 1
        if self._library is None:
            self._bus.perform(self._instant)
            self.rows[last] = self._bus.values
        elif not self._settle(self._address, last):
            call, status = self._refusal
            self._bus.check_status(self._instant[call], status)

    def _make_steps(self, steps: int, in_result: bool) -> None:
        """Make steps to the times after the last point."""
        if self._library is None:
            self._advance_in_python(steps, in_result)
            return
        done = self._advance(self._address, self.done - 1, steps, in_result)
        self.done += done
        if done < steps:
            call, status = self._refusal
            self._raise_refusal(self._step[call], status)

    def _make_room(self, points: int) -> None:
        while self.done + points > len(self.rows):
            self.rows, self.times, self.result_times = (
                np.concatenate([array] * 2) for array in (self.rows, self.times, self.result_times)
            )
            self.after_break = np.append(self.after_break, np.zeros_like(self.after_break))
        if self._library is not None:
            self._record.point(times=self.times, result_times=self.result_times, rows=self.rows)

    def _advance_in_python(self, steps: int, in_result: bool) -> None:
        for first, last in pairwise(self.times[self.done - 1 : self.done + steps].tolist()):
            self._bus.set_step(first, last)
            self.result_times[self.done] = last if in_result else math.nan
            for call in self._step:
                if status := call():
                    self._raise_refusal(call, status)
            self.rows[self.done] = self._bus.values
            self.done += 1

    def _raise_refusal(self, call: Call, status: int) -> None:
        """Raise the error of a status; first record the end that an FMU has requested, if all other FMUs reach it."""
        bus, calls = self._bus, self._step
        try:
            bus.check_status(call, status)
        except EndedError as ended:
            if call.action == "couple":  # of a coupled step there is nothing but the whole
                raise
            alone = sum(other.action == "step" for other in calls) == 1
            whole = ended.time > bus.end.value - _ROUNDING * bus.size.value
            if whole or (alone and ended.time > bus.start.value + _ROUNDING * bus.size.value):
                bus.end.value = bus.end.value if whole else ended.time
                with suppress(SimulationError):  # an FMU that has ended need not do more
                    bus.perform(calls[calls.index(call) + 1 :])
                    self.add(bus.end.value, bus.values, result_time=bus.end.value)
            raise
