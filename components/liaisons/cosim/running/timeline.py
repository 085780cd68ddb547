"""The instants to which steps lead: breaks, at which a source of an input jumps, or one of its first two derivatives.

FMUs announce them by a variable, functions of time by their ``breaks``; what these do not announce, a deviation tells
(:mod:`liaisons.cosim.running.breaks`).  Between two of them, in a *piece*, every signal is smooth, and no polynomial
crosses one.  A communication step ends shortly before a break; a tiny one, in which every input is extrapolated, leads
to it, and there the next piece starts with the limits from the right.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import final

import numpy as np

from liaisons.base.clocks import CLOCK_ERROR, time_rounding
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure.simulation import Simulation

_NEVER = 1e300
"""An announced instant beyond this means never: FMUs announce the largest floating-point number [s]."""
_SHORT = 1e-9
"""Size of the tiny step to a break, relative to a communication step."""
_APART = 4 * CLOCK_ERROR
"""The same, relative to the sampling period: FMUs of ours may sample one CLOCK_ERROR too early."""


@final
class Timeline:
    """The breaks of a simulation, in order of time.

    :ivar divides: whether all FMUs take steps of any size, so that steps can end at breaks.
    :ivar are_samples: whether all breaks are those of sampled FMUs, whose outputs hold between them.
    :ivar next: the next break [s], infinite if there is none; may be set to an earlier one.
    """

    def __init__(self, simulation: Simulation, instances: Instances, bus: Bus) -> None:
        parts, sources = simulation.parts, {name for name, _ in simulation.feeds.values()}
        self.divides = all(part.fmu.variable_step for part in parts.values())
        events = {
            name: event
            for name, part in parts.items()
            if self.divides and name in sources and (event := part.fmu.next_event_variable)
        }
        self.are_samples = not simulation.drives and all(parts[name].fmu.has_sampled_outputs for name in events)
        self._nearest = max((_APART * parts[name].sampling_period for name in events), default=0.0)
        self._bus = bus
        self._announced = np.zeros(len(events))
        self._calls: list[Call] = [
            instances[name].getter([event], self._announced[k : k + 1])
            for k, (name, event) in enumerate(events.items())
        ]
        self._drives = simulation.drives
        self.next = math.inf

    def begin_piece(self, time: float) -> None:
        """Start a smooth piece at an instant [s]: there, functions of time return their limits from the right."""
        for drive in self._drives:
            drive.begin_piece(time)

    def tiny_step(self, time: float, size: float) -> float:
        """Size of the tiny step to a break at a time, beside steps of some size [s]."""
        return max(_SHORT * size, 10 * time_rounding(time), self._nearest)

    def save(self) -> float:
        """The next break [s], for :meth:`restore`."""
        return self.next

    def restore(self, saved: float) -> None:
        """Set the next break to a saved one [s]."""
        self.next = saved

    def ends_before(self, now: float, ends: Sequence[float], size: float) -> Sequence[float]:
        """Those ends of steps that come before the next break, else an instant shortly before it [s].

        :param ends: of steps from an instant on, in their order.
        :param size: of a communication step [s].
        :returns: nothing if the break is so near that the next step crosses it.
        """
        if self.next == math.inf:
            return ends
        if before := bisect_left(ends, self.next - time_rounding(self.next)):
            return ends[:before]
        tiny = self.tiny_step(self.next, size)
        return [self.next - tiny] if self.next - now > 2 * tiny else []

    def is_next(self, time: float) -> bool:
        """Whether an instant [s] is the next break, or comes before it by rounding."""
        return time - self.next <= time_rounding(self.next)

    def find_next(self, time: float) -> None:
        """Set :attr:`next` to the first break after an instant [s] that all FMUs have reached."""
        if not (self._calls or self._drives):
            return
        self._bus.perform(self._calls)
        instants: list[float] = self._announced.tolist()
        if self.divides:
            instants += [instant for drive in self._drives if (instant := drive.next_break(time)) is not None]
        self.next = min((t for t in instants if time + time_rounding(time) < t < _NEVER), default=math.inf)
