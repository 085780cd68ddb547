"""The coupled step of a whole system: group after group, sources before what they feed."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from contextlib import suppress
from ctypes import CDLL, addressof, byref
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim import compiled, schedule
from liaisons.cosim.bus import Bus
from liaisons.cosim.calls import COUPLED, RAISED, Action, Call
from liaisons.cosim.coupling.group import Group
from liaisons.cosim.coupling.handed import Handed, Past
from liaisons.cosim.coupling.member import INSIDE, Member
from liaisons.cosim.coupling.records import GroupRecord, HandedRecord, SystemRecord
from liaisons.cosim.coupling.signals import Curve, Signals, State
from liaisons.cosim.drives import SIGNALS
from liaisons.cosim.instances import Instance
from liaisons.cosim.schedule import Place
from liaisons.cosim.simulation import Simulation
from liaisons.errors import SimulationError

Snapshot = tuple[State, list[Past]]

_ROOM = 17
"""So many numbers an unknown compiled code needs room for: points and changes, secants, and what there is now."""


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
            cycle = frozenset(names if names[0] in cyclic else ())
            members = [Member(parts[name], instances[name], bus, signals, cycle, alone=name in alone) for name in names]
            self._groups.append(Group(members, signals, bus, simulation, cyclic=bool(cycle)))
        group_of = {name: k for k, group in enumerate(groups) for name in group} | {SIGNALS: len(groups)}
        leading: list[list[Curve]] = [[] for _ in range(len(groups) + 1)]
        for target, (source, _) in feeds.items():
            if group_of[source] != group_of[target[0]] and target[0] not in alone:
                leading[group_of[source]].append(signals.curve(target))
        *self._handed, self._driven = (Handed(signals, curves) for curves in leading)

        self.advance = Call(self._step)
        if (library := compiled.steps()) is not None:
            self._compile(library)

    def _compile(self, library: CDLL) -> None:
        """Have steps made by compiled code."""
        signals = self.signals
        self._asked = [Call(self._drive_on), *(Call(self._look_inside, k) for k in range(len(self._groups)))]
        self._records = [group.record() for group in self._groups]
        asked = [call if group.source else None for call, group in zip(self._asked[1:], self._groups, strict=True)]
        handed = [one.record(ask) for one, ask in zip(self._handed, asked, strict=True)]
        handed.append(self._driven.record(None))
        self._record = record = SystemRecord(outputs=signals.count, kinds=len(signals.sizes), count=len(self._groups))
        record.groups = (GroupRecord * len(self._groups))(*self._records)
        record.handed = (HandedRecord * len(handed))(*handed)
        record.drive = self._asked[0].compiled().function if self._drives else None
        record.orders, record.instants = INSIDE.shape
        record.point(before=signals.before, now=signals.now, earlier=signals.earlier, since=signals.since)
        record.point(sizes=signals.sizes, result=signals.result, rates=signals.rates, kind=signals.kinds, inside=INSIDE)
        members = [member for group in self._records for member in group.members[: group.count]]
        record.point(held=signals.held, room=np.empty(max((m.known + m.derivatives for m in members), default=0)))
        record.point(scratch=np.empty(_ROOM * max((g.n for g in self._records), default=0) + len(signals.sizes)))
        self._kept = handed
        function = library.advance_coupled
        call = Call(function, byref(record), self._bus.start, self._bus.size).of("couple", self._failure)
        self.advance = call.recorded(COUPLED, function=function, instance=addressof(record))

    def _failure(self, _action: Action, status: int, _when: str) -> SimulationError:
        """Raises the error of a step that compiled code has not made."""
        failure = self._record.failure
        for call in self._asked if status == RAISED else ():
            self._bus.judge(call, status)
        self._groups[failure.group].fail(failure, status)
        raise AssertionError(status)

    def begin_anew(self) -> None:
        """Forget everything."""
        self.signals.begin_anew()
        for handed in (self._driven, *self._handed):
            handed.begin_anew()
        for group in self._groups:
            group.begin_anew()

    def snapshot(self) -> Snapshot:
        """What :meth:`rewind` needs."""
        return self.signals.snapshot(), [handed.snapshot() for handed in (self._driven, *self._handed)]

    def rewind(self, snapshot: Snapshot) -> None:
        """Forget what was since the snapshot."""
        signals, states = snapshot
        self.signals.rewind(signals)
        for handed, state in zip((self._driven, *self._handed), states, strict=True):
            handed.rewind(state)

    @property
    def slopes(self) -> dict[Place, int]:
        """Outputs whose slopes are on the bus, and where."""
        return {place: k for group in self._groups for member in group.members for place, k in member.slopes_at.items()}

    @property
    def gains(self) -> dict[tuple[Place, Place], int]:
        """Outputs and inputs, and where on the bus the derivative of the one by the other is."""
        return {pair: k for group in self._groups for member in group.members for pair, k in member.gains.items()}

    @property
    def order(self) -> int:
        """Order of the error in H: that of the coarsest polynomial."""
        return min((group.order for group in self._groups), default=6)

    def settle(self, *, initial: bool) -> None:
        """Make everything fit at the begin, which the clock shows."""
        time = self._bus.end.value
        self._drive(time, self._times[1])
        for group in self._groups:
            group.settle(time, initial=initial)
            self.signals.measure()
        self.signals.before[:] = self.signals.now

    def _step(self) -> None:
        """One step, of the size and from the instant that the clock shows."""
        end, size = self._bus.end.value, self._bus.size.value
        self.signals.predict(size)
        ahead = self._drive_on()
        self._driven.shape(size, others=bool(ahead))
        for k, (group, handed) in enumerate(zip(self._groups, self._handed, strict=True)):
            inside = bool(group.source and handed.fresh and self._look_inside(k))
            if not inside:
                group.advance(end, size)
            handed.shape(size, others=inside)
        for handed in (*self._handed, self._driven):
            handed.accept(size)
        self.signals.accept(size)

    def _look_inside(self, k: int) -> int:
        """Step a source in thirds, for what it hands on has no past yet; returns 1."""
        handed, size, source = self._handed[k], self._bus.size.value, self._groups[k].source
        assert source is not None
        handed.others[:] = source.step_in_thirds()[:, handed.made - source.values.start]
        handed.instants[:] = size / 3, 2 * size / 3
        source.collect(self.signals.now)
        return 1

    def _drive_on(self) -> int:
        """Functions of time, and at the two points after the step, where their past does not show how they move.

        :returns: 1 if it is known how they go on.
        """
        end, size, driven = self._bus.end.value, self._bus.size.value, self._driven
        self._drive(end, end - size)
        place = bisect_right(self._times, end)
        instants = self._times[place : place + 2]
        if not driven.fresh or len(instants) < 2:
            return 0
        ahead = np.zeros((2, self.signals.count))
        with suppress(SimulationError):  # its turn will come
            for drive, indices in self._drives:
                ahead[:, indices] = [drive(instant) for instant in instants]
            driven.instants[:] = instants[0] - end + size, instants[1] - end + size
            driven.others[:] = ahead[:, driven.made]
            return 1
        return 0

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
