"""Communication points, and how far clocks of importers may be off."""

from __future__ import annotations

import math

import numpy as np

from liaisons.base.arguments import checked_stop_and_step
from liaisons.base.memory import check_memory

_ROUNDING = 1e-12
"""Relative tolerance of instants, as in FMUs of liaisons."""
CLOCK_ERROR = 1e-6
"""Part of the sampling period by which clocks may miss a sample."""


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
