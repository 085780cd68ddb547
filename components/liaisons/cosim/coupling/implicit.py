"""The coupled step of a whole system: group after group, sources before what they feed."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from ctypes import CDLL, addressof, byref
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.compiled.calls import COUPLED, RAISED, Action, Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.node import INSIDE, Node
from liaisons.cosim.coupling.records import HandedRecord, StrongComponentRecord, SystemRecord
from liaisons.cosim.coupling.signal_history import Past, SignalHistory
from liaisons.cosim.coupling.signals import Curve, Signals, State
from liaisons.cosim.coupling.strong_component import StrongComponent
from liaisons.cosim.instances import Instance
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS, rounding
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
        groups, cyclic = simulation.groups, simulation.cyclic
        alone = {name for name, part in parts.items() if part.left_alone and name not in cyclic}
        self.signals = signals = Signals(parts, feeds, places, alone)
        self._drives = [(drive, [signals.index[place] for place in drive.places]) for drive in simulation.drives]
        self._slopes = [signals.slope(drive.places[2]) if len(drive.places) == 3 else -1 for drive, _ in self._drives]
        self._groups: list[StrongComponent] = []
        for names in groups:
            cycle = frozenset(names if names[0] in cyclic else ())
            members = [Node(parts[name], instances[name], bus, signals, cycle, alone=name in alone) for name in names]
            self._groups.append(StrongComponent(members, signals, bus, simulation, cyclic=bool(cycle)))
        group_of = {name: k for k, group in enumerate(groups) for name in group} | {SIGNALS: len(groups)}
        leading: list[list[Curve]] = [[] for _ in range(len(groups) + 1)]
        for target, (source, _) in feeds.items():
            if group_of[source] != group_of[target[0]] and target[0] not in alone:
                leading[group_of[source]].append(signals.curve(target))
        *self._handed, self._driven = (SignalHistory(signals, curves) for curves in leading)

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
        record.groups = (StrongComponentRecord * len(self._groups))(*self._records)
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
        for call in self._asked:
            if status == RAISED and call.raised is not None:
                self._bus.check_status(call, status)
        self._groups[failure.group].fail(failure, status)
        raise AssertionError(status)

    def reset(self) -> None:
        """Forget everything."""
        self.signals.reset()
        for handed in (self._driven, *self._handed):
            handed.reset()
        for group in self._groups:
            group.reset()

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
    def slopes(self) -> dict[VariableReference, int]:
        """Outputs whose slopes are on the bus, and where."""
        return {place: k for group in self._groups for member in group.members for place, k in member.slopes_at.items()}

    @property
    def gains(self) -> dict[tuple[VariableReference, VariableReference], int]:
        """Outputs and inputs, and where on the bus the derivative of the one by the other is."""
        return {pair: k for group in self._groups for member in group.members for pair, k in member.gains.items()}

    @property
    def order(self) -> int:
        """Order of the error in H: that of the coarsest polynomial."""
        return min((group.order for group in self._groups), default=6)

    def settle(self, *, initial: bool) -> None:
        """Make everything fit at the begin of a piece, which the clock shows."""
        time = self._bus.end.value
        self._drive(time, self._ahead(time))
        for group in self._groups:
            group.settle(time, initial=initial)
            self.signals.measure()
        self.signals.before[:] = self.signals.now

    def cross(self) -> None:
        """Make the step that the clock shows, which is tiny, to an instant where something jumps; forget the past.

        Until its end every input goes on as it was known at its begin.
        """
        signals, time = self.signals, self._bus.end.value
        signals.now[:] = signals.before
        self._drive(time, self._ahead(time))
        for group in self._groups:
            for member in group.members:
                member.go_on()
                member.collect(signals.now)
        signals.since[:] = 0.0
        for handed in (*self._handed, self._driven):
            handed.reset()
        self.settle(initial=False)

    def _ahead(self, time: float) -> float | None:
        """An instant of the piece that begins at this one [s], if there is one, and anything that asks for it."""
        if not self._drives:
            return None
        place = bisect_right(self._times, time + rounding(time))
        if place == len(self._times):
            return None
        breaks = [(time + instant) / 2 for drive, _ in self._drives if (instant := drive.next_break(time)) is not None]
        return min([self._times[place], *breaks])

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
        """Functions of time, and inside the step those whose slopes are made.

        :returns: 1 if there are such.
        """
        start, end, size, driven = self._bus.start.value, self._bus.end.value, self._bus.size.value, self._driven
        self._drive(end, start)
        if not driven.made.size:
            return 0
        inside = np.zeros((2, self.signals.count))
        driven.instants[:] = size / 3, 2 * size / 3
        for drive, indices in self._drives:
            if len(indices) < 3:
                inside[:, indices] = [drive(start + instant) for instant in driven.instants]
        driven.others[:] = inside[:, driven.made]
        driven.reset()  # what is seen inside a step is better than the past
        return 1

    def _drive(self, time: float, other: float | None) -> None:
        """Values of the functions of time, and the slope of an acceleration, by another instant of its piece [s]."""
        for (drive, indices), slope in zip(self._drives, self._slopes, strict=True):
            values = drive(time)
            self.signals.now[indices] = values
            if slope >= 0:
                self.signals.now[slope] = 0.0 if other is None else _jerk(values, drive(other), time - other)


def _jerk(here: NDArray[np.float64], there: NDArray[np.float64], size: float) -> float:
    """Third derivative, here, of the quintic with these values, rates and accelerations; there is ``size`` before."""
    change = (60 * (here[0] - there[0]) / size - 36 * here[1] - 24 * there[1]) / size
    return float((change + 9 * here[2] - 3 * there[2]) / size)
