"""The bus of a run: one array of all values that FMUs exchange, and the clock.

The values lie in one array, so that a row of a recording is one copy of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from ctypes import c_double
from typing import final

import numpy as np

from liaisons.base.unit_definitions import Conversion
from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import CONVERT, COPY, RAISED, Call
from liaisons.cosim.messages import WARNING
from liaisons.cosim.structure.schedule import Feeds, OutputInput, VariableReference


@final
class Bus:
    """All connected and recorded numbers, those of one call side by side, and the communication step under way.

    :param order: components, and what else has outputs.
    :param feeds: input -> output.
    :param watched: outputs that are read as if they were connected.
    :param recorded: further variables that are wanted.
    :param conversions: of inputs that are not what feeds them.
    :ivar start: begin, ``size`` and ``end`` of the step [s], where foreign functions see them.
    """

    def __init__(
        self,
        order: Sequence[str],
        feeds: Feeds,
        watched: Iterable[VariableReference],
        recorded: Iterable[VariableReference],
        conversions: Mapping[VariableReference, Conversion],
    ) -> None:
        sources = dict.fromkeys([*feeds.values(), *watched])
        self.order = order
        self._feeds = feeds
        self._conversions = conversions
        self._connected = _by_component(order, sources)
        not_connected = [r for r in dict.fromkeys(recorded) if r not in feeds and r not in sources]
        self._recorded_only = _by_component(order, not_connected)
        self.inputs = _by_component(order, feeds)
        references = [p for name in order for p in (*self.outputs(name), *self.inputs[name])]
        self.index = {reference: k for k, reference in enumerate(references)}
        most = sum((1 + len(self.inputs[name])) * (1 + len(self.outputs(name))) for name in order)
        most += 2 * len(references)
        self._store = np.zeros(len(references) + most)  # with room for slopes, derivatives by inputs, integrals
        self.values = self._store[: len(references)]
        self.start, self.size, self.end = c_double(), c_double(), c_double()

    def set_step(self, start: float, end: float) -> None:
        """Set start and end of the communication step [s]."""
        self.start.value, self.size.value, self.end.value = start, end - start, end

    def perform(self, calls: Iterable[Call]) -> None:
        """Make calls, one after the other.

        :raises SimulationError: if one is refused.
        """
        for call in calls:
            if status := call():
                self.check_status(call, status)

    def check_status(self, call: Call, status: int) -> None:
        """Check a status other than OK.

        :raises SimulationError: unless it was a warning.
        """
        if status == RAISED and call.raised is not None:
            error, call.raised = call.raised, None
            raise error
        if status != WARNING:
            since = f"from t = {self.start.value:.10g} s to" if call.action == "step" else "at"
            raise call.error(status, f" {since} t = {self.end.value:.10g} s")

    def outputs(self, name: str, *, every: bool = True) -> list[VariableReference]:
        """Outputs of a component that feed inputs and, with ``every``, its other recorded variables."""
        return [*self._connected[name], *(self._recorded_only[name] if every else ())]

    def recorded_only(self, name: str) -> list[VariableReference]:
        """Variables of a component that are recorded and feed no input."""
        return self._recorded_only[name]

    def view(self, references: Sequence[VariableReference]) -> Vector:
        """View of neighbouring values."""
        first = self.index[references[0]] if references else 0
        return self.values[first : first + len(references)]

    def source(self, input_: VariableReference) -> int | None:
        """Column of the output that feeds an input; None if none does."""
        return self.index[self._feeds[input_]] if input_ in self._feeds else None

    def add_columns(self, size: int) -> tuple[int, Vector]:
        """Add columns without names; returns the index of the first, and a view of all."""
        first = len(self.values)
        self.values = self._store[: first + size]
        return first, self.values[first:]

    def add_derivatives(
        self, outputs: Iterable[VariableReference], input_: VariableReference
    ) -> tuple[Vector, dict[OutputInput, int]]:
        """Add columns for the derivatives of outputs by an input; returns a view of them, and the index of each."""
        pairs = [(output, input_) for output in outputs]
        first, column = self.add_columns(len(pairs))
        return column, {pair: first + k for k, pair in enumerate(pairs)}

    def copies(self, inputs: Sequence[VariableReference]) -> list[Call]:
        """Calls that copy outputs to the inputs that they feed, or convert them; neighbours are one call."""
        runs: list[tuple[int, int, int]] = []
        converted: list[Call] = []
        for reference in inputs:
            target, source = self.index[reference], self.index[self._feeds[reference]]
            if reference in self._conversions:
                converted.append(self._convert(target, source, self._conversions[reference]))
            elif runs and (target, source) == (runs[-1][0] + runs[-1][2], runs[-1][1] + runs[-1][2]):
                runs[-1] = (*runs[-1][:2], runs[-1][2] + 1)
            else:
                runs.append((target, source, 1))
        return [*(self._copy(target, source, count) for target, source, count in runs), *converted]

    def _copy(self, target: int, source: int, count: int) -> Call:
        bus = self.values.data
        call = Call(bus[target : target + count].__setitem__, slice(None), bus[source : source + count])
        return call.recorded(COPY, None, source=self._address(source), count=count, values=self._address(target))

    def _convert(self, target: int, source: int, conversion: Conversion) -> Call:
        numbers = np.array(conversion)
        call = Call(_convert, self.values.data, target, source, conversion)
        call.buffers = numbers
        return call.recorded(CONVERT, numbers.ctypes.data, source=self._address(source), values=self._address(target))

    def _address(self, index: int) -> int:
        return self.values.ctypes.data + index * self.values.itemsize


def _convert(bus: memoryview[float], target: int, source: int, conversion: Conversion) -> None:
    bus[target] = conversion.apply(bus[source])


def _by_component(names: Iterable[str], references: Iterable[VariableReference]) -> dict[str, list[VariableReference]]:
    """Component -> its variables."""
    grouped: dict[str, list[VariableReference]] = {name: [] for name in names}
    for reference in references:
        grouped[reference[0]].append(reference)
    return grouped
