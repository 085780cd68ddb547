"""A clock that a run waits for."""

from __future__ import annotations

from time import perf_counter, sleep
from typing import final

from liaisons.cosim.messages import logger

_UNNOTICED_DELAY = 1e-3
"""Lateness below which there is no warning [s]: the resolution of clocks and schedulers."""


@final
class RealTime:
    """Waits after each step until the clock has advanced as much, once it has a pace.

    :ivar is_paced: whether it has one.
    :ivar lateness: how late each step ended [s].
    """

    def __init__(self) -> None:
        self.lateness: list[float] = []
        self.reset()

    def reset(self) -> None:
        """Forget pace and lateness."""
        self.is_paced, self._begin = False, (1.0, 0.0, 0.0)  # seconds per second, instant of the clock, and simulated
        self.lateness.clear()

    def pace(self, factor: float, time: float) -> None:
        """Begin at a simulated time [s], at ``factor`` simulated seconds per second."""
        self.is_paced, self._begin = True, (factor, perf_counter(), time)

    def wait(self, time: float) -> None:
        """Wait for the instant of the clock that belongs to a simulated time [s]."""
        factor, begin, first = self._begin
        late = perf_counter() - begin - (time - first) / factor
        self.lateness.append(max(late, 0.0))
        sleep(max(-late, 0.0))

    def warn(self, title: str) -> None:
        """Warn of steps that ended late."""
        if late := [one for one in self.lateness if one > _UNNOTICED_DELAY]:
            words = "%s: %d of %d paced steps end late, by up to %.3g s: choose a smaller pace, or larger steps"
            logger.warning(words, title, len(late), len(self.lateness), max(late))
