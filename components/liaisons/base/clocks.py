"""Communication points, the memory that their recording takes, and how far clocks of importers may be off."""

from __future__ import annotations

import math
import os
import re
from contextlib import suppress
from pathlib import Path

import numpy as np

from liaisons.base.arguments import checked_stop_and_step
from liaisons.errors import SimulationError

_ROUNDING = 1e-12
"""Relative tolerance of instants, as in FMUs of liaisons."""
CLOCK_ERROR = 1e-6
"""Part of the sampling period by which clocks may miss a sample."""
_POINT = 40
"""Bytes that a communication point takes."""
_SIGNAL = 16
"""Bytes that a signal takes at a communication point: in the row of the bus and in the result."""
_ALWAYS_FREE = 1e8
"""Bytes below which free memory is not looked up."""


def communication_points(
    start_time: float, stop_time: float | None, step_size: float | None, *, signals: int = 1
) -> list[float]:
    """Communication points t_i = start_time + i * step_size, and stop_time [s].

    The last step may be longer than the others by a millionth, which counts as rounding.

    :param signals: number of recorded signals.
    :raises SimulationError: unless all are finite, step_size > 0 and stop_time > start_time; or if the recording is
        larger than the memory.
    """
    stop_time, step_size = checked_stop_and_step(start_time, stop_time, step_size)
    check_memory(start_time, stop_time, step_size, signals)
    steps = max(1, math.ceil((stop_time - start_time) / step_size - 1e-6))
    return [*(start_time + step_size * np.arange(steps)).tolist(), float(stop_time)]


def time_rounding(time: float) -> float:
    """Distance [s] from a time within which an instant is the same."""
    return _ROUNDING * (1 + abs(time))


def check_memory(start_time: float, stop_time: float, step_size: float, signals: int) -> None:
    """Raise a SimulationError if a recording of so many signals does not fit into free memory.

    :raises SimulationError: with its size, and ways to store less.
    """
    points = (stop_time - start_time) / step_size + 1
    needed = points * (_POINT + _SIGNAL * signals)
    if needed > _ALWAYS_FREE and needed > (free := _free_memory()):
        raise SimulationError(
            f"steps of {step_size:g} s from {start_time:g} to {stop_time:g} s are {points:.3g} points, and "
            f"{signals} signal{'s' * (signals != 1)} at each of them {needed / 1e9:.3g} GB where {free / 1e9:.3g} GB "
            "of memory are free: store less by larger steps, an earlier end, or fewer signals to record"
        )


def _free_memory() -> float:
    """Free memory [B] on Linux, all memory on macOS, else a guess."""
    with suppress(OSError, AttributeError, TypeError):  # Linux
        return 1024.0 * int(re.search(r"MemAvailable:\s*(\d+) kB", Path("/proc/meminfo").read_text())[1])  # type: ignore[index]
    with suppress(OSError, AttributeError, ValueError):  # macOS
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    return 8e9
