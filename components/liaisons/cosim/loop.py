"""Communication steps in a row, recorded: by compiled code where that is possible, else by Python, to the same bits.

The loop of ``loop.c`` is compiled once and lies in the user's cache from then on.  It makes the calls that are
:class:`liaisons.cosim.calls.Prepared`; where a system has others (functions of time, FMI 3.0 arrays that are connected
in part), or there is no C compiler, Python makes them.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from ctypes import CDLL, POINTER, Structure, byref, c_double, c_int, c_size_t, c_void_p, pointer
from functools import lru_cache
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons import cache
from liaisons.compiler import FLAGS, compile_library, host
from liaisons.cosim.bus import Bus, Clock
from liaisons.cosim.calls import Call, Prepared, Record
from liaisons.cosim.messages import logger
from liaisons.errors import BuildError, SimulationError
from liaisons.files import replacing
from liaisons.folders import passing_folder


@final
class Loop:
    """Steps from each communication point to the next one.

    :param calls: those of one step.
    :param times: communication points [s].
    :param rows: takes what is on the bus at each of them, shape (points, width of the bus).
    :param judge: is given a call and what it returned, unless that was OK; raises, unless it was a warning.
    :ivar done: so many rows are filled.
    """

    def __init__(
        self,
        calls: Sequence[Call],
        clock: Clock,
        bus: Bus,
        times: Sequence[float],
        *,
        rows: NDArray[np.float64],
        judge: Callable[[Call, int], None],
    ) -> None:
        self.rows = rows
        self.done = 0
        self._calls, self._clock, self._bus, self._times, self._judge = calls, clock, bus, times, judge
        prepared = [call for call in calls if isinstance(call, Prepared)]
        library = compiled() if len(prepared) == len(calls) else None
        self._compiled = None if library is None else _Compiled(library, prepared, clock, bus, times)

    def begin(self) -> None:
        """Record what is on the bus as the first row."""
        self.rows[0] = self._bus.values
        self.done = 1

    def advance(self, rows: int) -> None:
        """Make steps until so many rows are filled."""
        if self._compiled is None:
            self._advance(rows)
            return
        refused = self._compiled.advance(self, rows)
        if refused is not None:
            call, status = refused
            self._clock.set(*self._times[self.done - 1 : self.done + 1])
            self._judge(self._calls[call], status)

    def _advance(self, rows: int) -> None:
        clock, bus, flat, width = self._clock, self._bus.values.data, self.rows.reshape(-1).data, self.rows.shape[1]
        start, size, calls = clock.start, clock.size, self._calls
        place = self.done * width
        for now, then in pairwise(self._times[self.done - 1 : rows]):
            start.value = now  # Clock.set written out: a Python call less a step
            size.value = then - now
            clock.end = then
            for call in calls:
                if status := call():
                    self._judge(call, status)
            flat[place : place + width] = bus
            place += width
            self.done += 1


@final
class _Program(Structure):
    """As in ``loop.c``."""

    _fields_ = [
        ("calls", POINTER(Record)),
        ("count", c_size_t),
        ("start", POINTER(c_double)),
        ("size", POINTER(c_double)),
        ("bus", c_void_p),
        ("width", c_size_t),
    ]


@final
class _Refusal(Structure):
    """As in ``loop.c``."""

    _fields_ = [("call", c_size_t), ("status", c_int)]


@final
class _Compiled:
    """The same loop in C."""

    def __init__(
        self, library: CDLL, calls: Sequence[Prepared], clock: Clock, bus: Bus, times: Sequence[float]
    ) -> None:
        self._times = np.array(times)
        self._refusal = _Refusal()
        records = (Record * len(calls))(*(call.record for call in calls))
        self._program = _Program(
            records, len(calls), pointer(clock.start), pointer(clock.size), bus.values.ctypes.data, bus.values.size
        )
        self._function: Any = library.advance
        self._function.restype = c_size_t

    def advance(self, loop: Loop, rows: int) -> tuple[int, int] | None:
        """Fill rows; number and status of the call that was refused, if one was."""
        steps = rows - loop.done
        done = self._function(
            byref(self._program),
            c_void_p(self._times.ctypes.data + (loop.done - 1) * self._times.itemsize),
            c_size_t(steps),
            c_void_p(loop.rows.ctypes.data + loop.done * loop.rows.strides[0]),
            byref(self._refusal),
        )
        loop.done += done
        return None if done == steps else (self._refusal.call, self._refusal.status)


@lru_cache(maxsize=1)
def compiled() -> CDLL | None:
    """The library of ``loop.c``; None where it cannot be had."""
    source = Path(__file__).with_name("loop.c").read_bytes()
    try:
        target = host()
        key = sha256(repr((source, target, FLAGS)).encode()).hexdigest()[:16]
        path = cache.folder() / f"loop-{key}{target.extension}"
        if not path.exists():
            path = _written(path, compile_library({"loop.c": source}, target))
        return CDLL(str(path))
    except (BuildError, OSError) as error:
        logger.info("communication steps are made by Python: %s", error)
        return None


def _written(path: Path, content: bytes) -> Path:
    """A file of this content: here, or where this cannot be written, in a folder that lasts as long as the process."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            part.write_bytes(content)
    except (OSError, SimulationError):
        path = _passing() / path.name
        path.write_bytes(content)
    return path


@lru_cache(maxsize=1)
def _passing() -> Path:
    stack = ExitStack()
    atexit.register(stack.close)
    return stack.enter_context(passing_folder())
