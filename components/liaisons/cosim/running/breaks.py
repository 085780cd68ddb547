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
        self.divides = all(part.fmu.variable_step for part in simulation.parts.values())
        sources = {name for name, _ in simulation.feeds.values()} if self.divides else set()
        announced = {name: part.fmu.next_event_time for name, part in simulation.parts.items() if name in sources}
        variables = {name: variable for name, variable in announced.items() if variable is not None}
        self.are_samples = not simulation.drives and all(simulation.parts[name].fmu.is_sampled for name in variables)
        self._nearest = max((_APART * simulation.parts[name].sampling_period for name in variables), default=0.0)
        self._bus = bus
        self._numbers = [np.zeros(1) for _ in variables]
        self._calls: list[Call] = [
            instances[name].getter([variable], number)
            for (name, variable), number in zip(variables.items(), self._numbers, strict=True)
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
        instants = [float(number[0]) for number in self._numbers]
        if self.divides:
            instants += [instant for drive in self._drives if (instant := drive.next_break(time)) is not None]
        self.next = min((t for t in instants if time + rounding(time) < t < _NEVER), default=math.inf)
