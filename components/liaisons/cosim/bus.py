"""What all FMUs of a run share: the clock, and the values that go from one to another.

The values lie in one array, so that a row of a recording is one copy of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from ctypes import Array, c_double
from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.calls import Call, Kind, Prepared
from liaisons.cosim.messages import Action
from liaisons.cosim.schedule import Feeds, Place


@final
@dataclass
class Clock:
    """The communication step under way; begin and size [s] as foreign functions see them."""

    end: float
    start: c_double = field(default_factory=c_double)
    size: c_double = field(default_factory=c_double)

    def set(self, start: float, end: float) -> None:
        """Turn to the step between two instants [s]."""
        self.start.value, self.size.value, self.end = start, end - start, end

    def when(self, action: Action) -> str:
        """Where in time a call failed, for its message."""
        since = f"from t = {self.start.value:.10g} s to" if action == "step" else "at"
        return f" {since} t = {self.end:.10g} s"


@final
class Bus:
    """All connected and recorded reals, those of one call side by side.

    :param order: components, and what else has outputs.
    :param feeds: input -> output.
    :param watched: outputs that are read as if they were connected.
    :param recorded: further variables that are wanted.
    """

    def __init__(self, order: Sequence[str], feeds: Feeds, watched: Iterable[Place], recorded: Iterable[Place]) -> None:
        sources = dict.fromkeys([*feeds.values(), *watched])
        self._feeds = feeds
        self._connected = _by_component(order, sources)
        self._others = _by_component(order, [p for p in dict.fromkeys(recorded) if p not in feeds and p not in sources])
        self.inputs = _by_component(order, feeds)
        places = [p for name in order for p in (*self.outputs(name), *self.inputs[name])]
        self.index = {place: k for k, place in enumerate(places)}
        self.values = np.zeros(len(places))

    def outputs(self, name: str, *, every: bool = True) -> list[Place]:
        """What is read from a component: what feeds something, and ``every`` other thing that is recorded."""
        return [*self._connected[name], *(self._others[name] if every else ())]

    def others(self, name: str) -> list[Place]:
        """What is read from a component to be recorded only."""
        return self._others[name]

    def view(self, places: Sequence[Place]) -> NDArray[np.float64]:
        """View of places that lie side by side."""
        first = self.index[places[0]]
        return self.values[first : first + len(places)]

    def buffer(self, places: Sequence[Place]) -> Array[c_double]:
        """The same for foreign functions."""
        return (c_double * len(places)).from_buffer(self.view(places).data)

    def copies(self, inputs: Sequence[Place]) -> list[Call]:
        """Calls that copy to inputs what feeds them, neighbours at once."""
        runs: list[tuple[int, int, int]] = []
        for place in inputs:
            target, source = self.index[place], self.index[self._feeds[place]]
            if runs and (target, source) == (runs[-1][0] + runs[-1][2], runs[-1][1] + runs[-1][2]):
                runs[-1] = (*runs[-1][:2], runs[-1][2] + 1)
            else:
                runs.append((target, source, 1))
        return [self._copy(target, source, count) for target, source, count in runs]

    def _copy(self, target: int, source: int, count: int) -> Call:
        bus, address, size = self.values.data, self.values.ctypes.data, self.values.itemsize
        call = Prepared(bus[target : target + count].__setitem__, slice(None), bus[source : source + count])
        return call.recorded(Kind.COPY, given=address + source * size, count=count, values=address + target * size)


def _by_component(names: Iterable[str], places: Iterable[Place]) -> dict[str, list[Place]]:
    grouped: dict[str, list[Place]] = {name: [] for name in names}
    for place in places:
        grouped[place[0]].append(place)
    return grouped
