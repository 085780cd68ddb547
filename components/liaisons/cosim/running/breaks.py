"""Breaks: instants at which the source of an input jumps, or one of its first two derivatives does.

FMUs announce them by a variable, functions of time by their ``breaks``.  Between two of them, in a *piece*, every
signal is smooth, and no polynomial crosses one.  A communication step ends shortly before a break; a tiny one, in which
every input is extrapolated, leads to it, and there the next piece starts with the limits from the right.
"""

from __future__ import annotations

import math
from typing import final

import numpy as np

from liaisons.base.clocks import CLOCK_ERROR
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import rounding

_NEVER = 1e300
"""An announced instant beyond this is none: FMUs announce the largest floating-point number [s]."""
_SHORT = 1e-9
"""Size of the tiny step to a break, relative to a communication step."""
_APART = 4 * CLOCK_ERROR
"""The same, relative to a period of samples, which FMUs of ours take by one CLOCK_ERROR too early."""


@final
class Breaks:
    """The breaks of a simulation, in order of time.

    :ivar divides: whether steps can be divided: all FMUs take steps of any size.
    :ivar are_samples: whether all are samples and late outputs of sampled FMUs, which hold between them.
    :ivar next: the next one [s]; infinite if there is none; set to one before it that was found in between.
    """

    def __init__(self, simulation: Simulation, instances: Instances, bus: Bus) -> None:
        parts, sources = simulation.parts, {name for name, _ in simulation.feeds.values()}
        self.divides = all(part.fmu.variable_step for part in parts.values())
        announcing = {n: event for n, part in parts.items() if n in sources and (event := part.fmu.next_event_time)}
        events = announcing if self.divides else {}
        self.are_samples = not simulation.drives and all(parts[name].fmu.is_sampled for name in events)
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
        """Start a smooth piece: functions of time return their limits from the right at this instant [s]."""
        for drive in self._drives:
            drive.begin_piece(time)

    def gap(self, time: float, size: float) -> float:
        """Size of the tiny step to a break, beside steps of a size [s]."""
        return max(_SHORT * size, 10 * rounding(time), self._nearest)

    def find_next(self, time: float) -> None:
        """Find the next break after an instant [s] that all FMUs have reached."""
        if not (self._calls or self._drives):
            return
        self._bus.perform(self._calls)
        instants: list[float] = self._announced.tolist()
        if self.divides:
            instants += [instant for drive in self._drives if (instant := drive.next_break(time)) is not None]
        self.next = min((t for t in instants if time + rounding(time) < t < _NEVER), default=math.inf)
