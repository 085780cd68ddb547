"""Communication steps and their recording, by compiled code if there is a C compiler, else by Python, to the same bits.

Compiled code calls Python for calls without a :class:`liaisons.cosim.compiled.calls.Record` (functions of time, FMI 3.0
arrays that are connected in part).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import deepcopy
from ctypes import byref, c_size_t, c_ssize_t, c_void_p
from functools import partial
from itertools import pairwise
from typing import Any, final

import numpy as np

from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.compiled.calls import Call, CallRecord
from liaisons.cosim.coupling.bus import Bus
from liaisons.errors import EndedError, SimulationError

_ROUNDING = 1e-6
"""Tolerance for the end of a step, relative to its size."""


@final
class Loop:
    """Communication steps, and the recorded values of the bus after each.

    :param calls: those of one step.
    :param capacity: expected number of communication points.
    :ivar rows: what was on the bus at each of :attr:`times`, shape (points, width of the bus), as far as ``done``.
    :ivar internal: points that are not in the result; ``after_break``: breaks, with the values right of them.
    """

    def __init__(self, calls: Sequence[Call], bus: Bus, capacity: int) -> None:
        self.done, self.times, self.rows = 0, np.empty(capacity), np.empty((capacity, bus.values.size))
        self.internal: set[int] = set()
        self.after_break: list[int] = []
        self._result_times: dict[int, float] = {}
        self._calls, self._bus = calls, bus
        self._addresses = self.times.ctypes.data, self.rows.ctypes.data  # looked up once, since that takes 1 µs
        self._compiled: Callable[..., int] | None = None
        if (library := compiled.steps()) is not None:
            records = [call.compiled() for call in calls]
            self._refusal = (c_ssize_t * 2)()
            library.advance.restype = c_size_t
            program = (CallRecord * len(records))(*records), c_size_t(len(records))
            clock = byref(bus.start), byref(bus.size), byref(bus.end)
            values = c_void_p(bus.values.ctypes.data), c_size_t(bus.values.size)
            self._compiled = partial(library.advance, *program, *clock, *values)

    def reset(self) -> None:
        """Remove all points."""
        self.done = 0
        self.internal.clear()
        self.after_break.clear()
        self._result_times.clear()

    def add(self, time: float, values: Vector, *, result_time: float | None = None, after_break: bool = False) -> None:
        """Record a point that was reached without :meth:`advance`.

        :param result_time: its time in the result [s], which may differ by rounding; None: it is not in the result.
        :param after_break: it is a break, with the values right of it.
        """
        self._make_room(1)
        if result_time is None:
            self.internal.add(self.done)
        elif result_time != time:
            self._result_times[self.done] = result_time
        if after_break:
            self.after_break.append(self.done)
        self.rows[self.done], self.times[self.done] = values, time
        self.done += 1

    @property
    def time(self) -> float:
        """The last point [s]."""
        return self._result_times.get(self.done - 1) or float(self.times[self.done - 1])

    def begin_piece(self, tiny: float) -> None:
        """Make a break of the last point, to which a tiny step [s] leads."""
        last = self.done - 1
        if last and self.after_break[-1:] != [last]:
            time, result_time = float(self.times[last]), None if last in self.internal else self.time
            self._result_times.pop(last, None)
            self.times[last] -= tiny
            self.internal.add(last)
            self.add(time, self.rows[last], result_time=result_time, after_break=True)

    def withdraw(self, done: int) -> None:
        """Remove the points after the first so many."""
        self.internal.difference_update(range(done, self.done))
        self.after_break[:] = [point for point in self.after_break if point < done]
        self.done = done

    def save(self) -> list[Any]:
        """All points, for :meth:`restore`."""
        points = self.rows[: self.done], self.times[: self.done]
        return deepcopy([*points, self.internal, self.after_break, self._result_times])

    def restore(self, saved: Sequence[Any]) -> None:
        """Return to the points that were saved."""
        rows, times, self.internal, self.after_break, self._result_times = deepcopy(saved)
        self.done = 0
        self._make_room(len(times))
        self.done = len(times)
        self.rows[: self.done], self.times[: self.done] = rows, times

    def result_rows(self) -> tuple[Indices, Vector]:
        """Indices of the rows in the result, and their times [s]."""
        rows = np.delete(np.arange(self.done), sorted(self.internal))
        times = self.times[: self.done].copy()
        times[list(self._result_times)] = list(self._result_times.values())
        return rows, times[rows]

    def advance(self, instants: Sequence[float], *, in_result: bool = True) -> None:
        """Make steps to these instants [s], one after the other.

        :raises SimulationError: if an FMU refuses a call, or ends the simulation; :attr:`done` says how far it came.
        """
        first, steps = self.done, len(instants)
        self._make_room(steps)
        self.times[first : first + steps] = instants
        if not in_result:
            self.internal.update(range(first, first + steps))
        if self._compiled is None:
            self._advance(steps)
            return
        done = self._compiled(
            c_void_p(self._addresses[0] + (first - 1) * self.times.itemsize),
            c_size_t(steps),
            c_void_p(self._addresses[1] + first * self.rows.strides[0]),
            self._refusal,
        )
        self.done += done
        if done < steps:
            self.internal.difference_update(range(self.done, first + steps))
            call, status = self._refusal
            self._raise_refusal(self._calls[call], status)

    def _make_room(self, points: int) -> None:
        while self.done + points > len(self.rows):
            self.rows, self.times = np.concatenate([self.rows] * 2), np.concatenate([self.times] * 2)
            self._addresses = self.times.ctypes.data, self.rows.ctypes.data

    def _advance(self, steps: int) -> None:
        bus, flat, width = self._bus, self.rows.reshape(-1).data, self.rows.shape[1]
        values, start, size, end, calls = bus.values.data, bus.start, bus.size, bus.end, self._calls
        offset = self.done * width
        for first, last in pairwise(self.times[self.done - 1 : self.done + steps].tolist()):
            start.value = first  # Bus.set_step and Bus.perform written out: two Python calls less a step
            size.value = last - first
            end.value = last
            for call in calls:
                if status := call():
                    self.internal.difference_update(range(self.done, self.done + steps))
                    self._raise_refusal(call, status)
            flat[offset : offset + width] = values
            offset += width
            self.done += 1

    def _raise_refusal(self, call: Call, status: int) -> None:
        """Raise the error of a status; the end that an FMU asks for is recorded if all other FMUs reach it."""
        bus, calls = self._bus, self._calls
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
