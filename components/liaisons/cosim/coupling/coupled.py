"""The coupled step of a whole system: group after group, sources before what they feed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim import schedule
from liaisons.cosim.bus import Bus
from liaisons.cosim.coupling.group import Group
from liaisons.cosim.coupling.member import Member
from liaisons.cosim.coupling.signals import Signals
from liaisons.cosim.drives import SIGNALS
from liaisons.cosim.instances import Instance
from liaisons.cosim.simulation import Simulation


@final
class Coupled:
    """All groups of a system, each step of which is repeated until everything fits."""

    def __init__(self, simulation: Simulation, instances: Mapping[str, Instance], bus: Bus) -> None:
        self._bus = bus
        self._following = simulation.times[1]
        parts, feeds = simulation.parts, simulation.feeds
        places = [place for name in (SIGNALS, *parts) for place in bus.outputs(name, every=False)]
        self.signals = signals = Signals(parts, feeds, places)
        self._drives = [(drive, [signals.index[place] for place in drive.places]) for drive in simulation.drives]
        self._groups: list[Group] = []
        feeds = {target: source for target, source in feeds.items() if source[0] != SIGNALS}
        own = {target for (target, _), (source, _) in feeds.items() if target == source}
        for names in schedule.groups(parts, feeds):
            cyclic = len(names) > 1 or names[0] in own
            members = [Member(parts[name], instances[name], bus, signals, repeated=cyclic) for name in names]
            self._groups.append(Group(members, signals, simulation, cyclic=cyclic))

    def begin_anew(self) -> None:
        """Forget everything."""
        self.signals.begin_anew()
        for group in self._groups:
            group.begin_anew()

    @property
    def order(self) -> int:
        """Order of the error in H: that of the coarsest polynomial."""
        return min((group.order for group in self._groups), default=6)

    def settle(self, *, initial: bool) -> None:
        """Make everything fit at the begin, which the clock shows."""
        time = self._bus.end
        self._drive(time, self._following)
        for group in self._groups:
            group.settle(time, initial=initial)
            self.signals.measure()
        self.signals.before[:] = self.signals.now

    def step(self) -> None:
        """One step, of the size and from the instant that the clock shows."""
        end, size = self._bus.end, self._bus.size.value
        self.signals.predict(size)
        self._drive(end, end - size)
        for group in self._groups:
            group.advance(end, size)
        self.signals.accept(size)

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
