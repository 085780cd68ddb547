"""The coupled step of a whole system: group after group, sources before what they feed."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from contextlib import suppress
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim import schedule
from liaisons.cosim.bus import Bus
from liaisons.cosim.coupling.group import Group
from liaisons.cosim.coupling.handed import Handed, Others
from liaisons.cosim.coupling.member import Member
from liaisons.cosim.coupling.signals import Curve, Signals
from liaisons.cosim.drives import SIGNALS
from liaisons.cosim.instances import Instance
from liaisons.cosim.simulation import Simulation
from liaisons.errors import SimulationError


@final
class Coupled:
    """All groups of a system, each step of which is repeated until everything fits."""

    def __init__(self, simulation: Simulation, instances: Mapping[str, Instance], bus: Bus) -> None:
        self._bus = bus
        self._times = simulation.times
        parts, feeds = simulation.parts, simulation.feeds
        places = [place for name in (SIGNALS, *parts) for place in bus.outputs(name, every=False)]
        between = {target: source for target, source in feeds.items() if source[0] != SIGNALS}
        groups = schedule.groups(parts, between)
        cyclic = schedule.in_cycles(groups, between)
        alone = {name for name, part in parts.items() if part.left_alone and name not in cyclic}
        self.signals = signals = Signals(parts, feeds, places, alone)
        self._drives = [(drive, [signals.index[place] for place in drive.places]) for drive in simulation.drives]
        self._groups: list[Group] = []
        for names in groups:
            cycle = names if names[0] in cyclic else []
            members = [Member(parts[name], instances[name], bus, signals, cycle, alone=name in alone) for name in names]
            self._groups.append(Group(members, signals, simulation, cyclic=bool(cycle)))
        group_of = {name: k for k, group in enumerate(groups) for name in group} | {SIGNALS: len(groups)}
        leading: list[list[Curve]] = [[] for _ in range(len(groups) + 1)]
        for target, (source, _) in feeds.items():
            if group_of[source] != group_of[target[0]] and target[0] not in alone:
                leading[group_of[source]].append(signals.curve(target))
        *self._handed, self._driven = (Handed(signals, curves) for curves in leading)

    def begin_anew(self) -> None:
        """Forget everything."""
        self.signals.begin_anew()
        for handed in (self._driven, *self._handed):
            handed.begin_anew()
        for group in self._groups:
            group.begin_anew()

    @property
    def order(self) -> int:
        """Order of the error in H: that of the coarsest polynomial."""
        return min((group.order for group in self._groups), default=6)

    def settle(self, *, initial: bool) -> None:
        """Make everything fit at the begin, which the clock shows."""
        time = self._bus.end
        self._drive(time, self._times[1])
        for group in self._groups:
            group.settle(time, initial=initial)
            self.signals.measure()
        self.signals.before[:] = self.signals.now

    def step(self) -> None:
        """One step, of the size and from the instant that the clock shows."""
        end, size = self._bus.end, self._bus.size.value
        self.signals.predict(size)
        self._drive(end, end - size)
        self._driven.shape(size, self._ahead(end, size))
        for group, handed in zip(self._groups, self._handed, strict=True):
            others = group.advance_in_thirds(handed.made, size) if handed.fresh else None
            if others is None:
                group.advance(end, size)
            handed.shape(size, others)
        for handed in (self._driven, *self._handed):
            handed.accept(size)
        self.signals.accept(size)

    def _ahead(self, end: float, size: float) -> Others | None:
        """Functions of time at the two points after the step, where their past does not show how they move."""
        place = bisect_right(self._times, end)
        instants = self._times[place : place + 2]
        if not self._driven.fresh or len(instants) < 2:
            return None
        ahead = np.zeros((2, self.signals.count))
        with suppress(SimulationError):  # its turn will come
            for drive, indices in self._drives:
                ahead[:, indices] = [drive(instant) for instant in instants]
            return (instants[0] - end + size, instants[1] - end + size), ahead[:, self._driven.made]
        return None

    def _drive(self, time: float, other: float) -> None:
        """Values of the functions of time, and the slope of an acceleration, by the other end of the step [s]."""
        for drive, indices in self._drives:
            values = drive(time)
            self.signals.now[indices] = values
            if len(values) == 3:
                self.signals.now[self.signals.slope(self.signals.places[indices[2]])] = _jerk(
                    values, drive(other), time - other
                )


def _jerk(here: NDArray[np.float64], there: NDArray[np.float64], size: float) -> float:
    """Third derivative, here, of the quintic with these values, rates and accelerations; there is ``size`` before."""
    change = (60 * (here[0] - there[0]) / size - 36 * here[1] - 24 * there[1]) / size
    return float((change + 9 * here[2] - 3 * there[2]) / size)
