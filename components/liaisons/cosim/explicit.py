"""Explicit coupling: the program of :mod:`liaisons.cosim.schedule` as calls of FMUs, prepared once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import final

from numpy.typing import NDArray

from liaisons.cosim import schedule
from liaisons.cosim.bus import Bus, Clock
from liaisons.cosim.calls import Call
from liaisons.cosim.drives import SIGNALS, Drive
from liaisons.cosim.instances import AnyInstance
from liaisons.cosim.messages import Action
from liaisons.cosim.parts import Part
from liaisons.cosim.schedule import Depends, Feeds, Operation


@final
class Explicit:
    """Calls of all FMUs of a system, in the order that the coupling asks for.

    :param order: components, :data:`SIGNALS` among them, sources before what they feed.
    :ivar owners: action and component of each call of an FMU.
    """

    def __init__(
        self,
        parts: Mapping[str, Part],
        instances: Mapping[str, AnyInstance],
        feeds: Feeds,
        bus: Bus,
        *,
        order: Sequence[str],
        signals: Sequence[Drive],
        clock: Clock,
    ) -> None:
        self.owners: dict[Call, tuple[Action, str]] = {}
        self._parts = parts
        self._instances = instances
        self._feeds = feeds
        self._bus = bus
        self._order = order
        self._signals = signals
        self._clock = clock

    def consistent(self, depends: Depends, *, initial: bool) -> list[Call]:
        """Make everything belong to the present instant; in initialization, only what is connected is read."""
        return self._prepared(schedule.consistent(self._order, self._feeds, depends), initial=initial)

    def step(self, depends: Depends, coupling: schedule.Coupling) -> list[Call]:
        """One communication step."""
        newest = {name for name, part in self._parts.items() if part.takes_newest}
        return self._prepared(schedule.step(self._order, self._feeds, depends, coupling, newest), initial=False)

    def _prepared(self, program: Iterable[Operation], *, initial: bool) -> list[Call]:
        return [call for operation in program for call in self._lowered(operation, initial)]

    def _lowered(self, operation: Operation, initial: bool) -> Iterator[Call]:
        action, name = operation
        bus = self._bus
        if name == SIGNALS:
            if action == "get":
                yield from (partial(self._evaluate, s, bus.view(s.places)) for s in self._signals)
            return
        instance, variables = self._instances[name], self._parts[name].fmu.variables
        if action == "step":
            call = instance.stepper(self._clock.start, self._clock.size)
        else:
            places = bus.inputs[name] if action == "set" else bus.outputs(name, every=not initial)
            if not places:
                return
            if action == "set":
                yield from bus.copies(places)
            prepare = instance.setter if action == "set" else instance.getter
            call = prepare([variables[variable] for _, variable in places], bus.buffer(places))
        self.owners[call] = operation
        yield call

    def _evaluate(self, source: Drive, view: NDArray) -> None:
        view[:] = source(self._clock.end)
