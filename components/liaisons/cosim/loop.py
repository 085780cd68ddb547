"""Communication steps in a row, recorded: by compiled code where that is possible, else by Python, to the same bits.

Compiled code asks Python for the calls that have no :class:`liaisons.cosim.calls.Record` (functions of time, FMI 3.0
arrays that are connected in part); where there is no C compiler, Python makes them all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import byref, c_size_t, c_ssize_t, c_void_p
from functools import partial
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim import compiled
from liaisons.cosim.bus import Bus
from liaisons.cosim.calls import Call, Record
from liaisons.errors import EndedError, SimulationError

_ROUNDING = 1e-6
"""Of a communication step."""


@final
class Loop:
    """Steps from each communication point to the next one.

    :param calls: those of one step.
    :param times: communication points [s].
    :ivar rows: what was on the bus at each of :attr:`times`, shape (points, width of the bus), as far as ``done``.
    """

    def __init__(self, calls: Sequence[Call], bus: Bus, times: Sequence[float]) -> None:
        self.done, self.times, self.rows = 0, np.array(times), np.empty((len(times), bus.values.size))
        self._calls, self._bus, self._instants = calls, bus, times
        self._compiled: Callable[..., int] | None = None
        if (library := compiled.steps()) is not None:
            records = [call.compiled() for call in calls]
            self._refusal = (c_ssize_t * 2)()
            library.advance.restype = c_size_t
            program = (Record * len(records))(*records), c_size_t(len(records))
            clock = byref(bus.start), byref(bus.size), byref(bus.end)
            values = c_void_p(bus.values.ctypes.data), c_size_t(bus.values.size)
            self._compiled = partial(library.advance, *program, *clock, *values)

    def begin_anew(self) -> None:
        """Forget what was recorded."""
        self.done, self.times[: len(self._instants)] = 0, self._instants

    def add(self, time: float, values: NDArray[np.float64]) -> None:
        """Record a point that was reached otherwise."""
        if self.done == len(self.rows):
            self.rows, self.times = np.concatenate([self.rows] * 2), np.concatenate([self.times] * 2)
        self.rows[self.done], self.times[self.done] = values, time
        self.done += 1

    def advance(self, rows: int) -> None:
        """Make steps until so many rows are filled.

        :raises SimulationError: if an FMU refuses a call, or ends the simulation; :attr:`done` says how far it came.
        """
        if self._compiled is None:
            self._advance(rows)
            return
        wanted = rows - self.done
        done = self._compiled(
            c_void_p(self.times.ctypes.data + (self.done - 1) * self.times.itemsize),
            c_size_t(wanted),
            c_void_p(self.rows.ctypes.data + self.done * self.rows.strides[0]),
            self._refusal,
        )
        self.done += done
        if done < wanted:
            call, status = self._refusal
            self._judge(self._calls[call], status)

    def _advance(self, rows: int) -> None:
        bus, flat, width = self._bus, self.rows.reshape(-1).data, self.rows.shape[1]
        values, start, size, end, calls = bus.values.data, bus.start, bus.size, bus.end, self._calls
        place = self.done * width
        for now, then in pairwise(self._instants[self.done - 1 : rows]):
            start.value = now  # Bus.turn and Bus.perform written out: two Python calls less a step
            size.value = then - now
            end.value = then
            for call in calls:
                if status := call():
                    self._judge(call, status)
            flat[place : place + width] = values
            place += width
            self.done += 1

    def _judge(self, call: Call, status: int) -> None:
        """As :meth:`Bus.judge`; where an FMU ends the simulation, that point is recorded if all others get there."""
        bus, calls = self._bus, self._calls
        try:
            bus.judge(call, status)
        except EndedError as ended:
            if call.action == "couple":  # of a coupled step there is nothing but the whole
                raise
            alone = sum(other.action == "step" for other in calls) == 1
            whole = ended.time > bus.end.value - _ROUNDING * bus.size.value
            if whole or (alone and ended.time > bus.start.value + _ROUNDING * bus.size.value):
                bus.end.value = bus.end.value if whole else ended.time
                with suppress(SimulationError):  # an FMU that has ended need not do more
                    bus.perform(calls[calls.index(call) + 1 :])
                    self.add(bus.end.value, bus.values)
            raise
