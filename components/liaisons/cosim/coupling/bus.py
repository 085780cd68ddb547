"""The bus of a run: one array of all values that FMUs exchange, and the clock.

The values lie in one array, so that a row of a recording is one copy of it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from ctypes import c_double
from itertools import count, filterfalse, repeat
from typing import final

import numpy as np

from liaisons.base.arrays import as_indices
from liaisons.base.unit_definitions import Conversion
from liaisons.cosim.compiled.calls import CONVERT, COPY, RAISED, WARNING, Call, Indices, Vector
from liaisons.cosim.structure.schedule import Feeds, OutputInput, VariableReference


@final
class Bus:
    """All connected and recorded numbers, those of one call side by side, and the communication step under way.

    :param order: components, and what else has outputs.
    :param feeds: input -> output.
    :param watched: outputs that are read as if they were connected.
    :param recorded: further variables that are wanted.
    :param conversions: of inputs that are not what feeds them.
    :ivar connected_outputs: component -> variables that feed inputs; ``recorded_only`` variables that feed none;
        ``inputs`` connected inputs.
    :ivar index: variable -> its column in ``values``.
    :ivar slope_columns: output -> column of its derivative by time.
    :ivar gain_columns: output and input -> column of ∂(output)/∂(input).
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
        self.connected_outputs = _by_component(sources)
        self.recorded_only = _by_component(filterfalse({*feeds, *sources}.__contains__, dict.fromkeys(recorded)))
        self.inputs = _by_component(feeds)
        references, room = list[VariableReference](), 0  # for slopes, derivatives by inputs, integrals
        for name in order:
            outputs, inputs = self.outputs(name), self.inputs[name]
            references += (*outputs, *inputs)
            room += (1 + len(inputs)) * (1 + len(outputs))
        self.index = dict(zip(references, count()))
        self._store = np.zeros(3 * len(references) + room)
        self.values = self._store[: len(references)]
        self.slope_columns: dict[VariableReference, int] = {}
        self.gain_columns: dict[OutputInput, int] = {}
        self.start, self.size, self.end = c_double(), c_double(), c_double()

    def set_step(self, start: float, end: float) -> None:
        """Set start and end of the communication step [s]."""
        self.start.value, self.size.value, self.end.value = start, end - start, end

    def perform(self, calls: Iterable[Call]) -> None:
        """Make calls, one after the other.

        :raises SimulationError: if an FMU refuses one.
        """
        for call in calls:
            if status := call():
                self.check_status(call, status)

    def check_status(self, call: Call, status: int) -> None:
        """Raise the error of a status that is neither OK nor Warning.

        :raises SimulationError: the FMU's; for an exception in Python, that exception.
        """
        if status == RAISED and call.raised is not None:
            error, call.raised = call.raised, None
            raise error
        if status != WARNING:
            since = f"from t = {self.start.value:.10g} s to" if call.action == "step" else "at"
            raise call.error(status, f" {since} t = {self.end.value:.10g} s")

    def outputs(self, name: str) -> list[VariableReference]:
        """Variables of a component on the bus, except its inputs: those that feed inputs come first."""
        return [*self.connected_outputs[name], *self.recorded_only[name]]

    def view(self, references: Sequence[VariableReference]) -> Vector:
        """The values of variables that lie side by side, as a view."""
        first = self.index[references[0]] if references else 0
        return self.values[first : first + len(references)]

    def columns(self, references: Iterable[VariableReference]) -> Indices:
        """Columns of variables."""
        return as_indices([*map(self.index.__getitem__, references)])

    def add_columns(self, size: int) -> tuple[int, Vector]:
        """Add columns without names; returns the index of the first, and a view of their values."""
        first = len(self.values)
        self.values = self._store[: first + size]
        return first, self.values[first:]

    def add_slopes(self, outputs: Collection[VariableReference]) -> Vector:
        """Add columns for the derivatives of outputs by time; returns a view of their values."""
        first, values = self.add_columns(len(outputs))
        self.slope_columns |= zip(outputs, count(first))
        return values

    def add_gains(self, outputs: Collection[VariableReference], input_: VariableReference) -> Vector:
        """Add columns for the derivatives of outputs by an input; returns a view of their values."""
        first, values = self.add_columns(len(outputs))
        self.gain_columns |= zip(zip(outputs, repeat(input_)), count(first))
        return values

    def copies(self, inputs: Sequence[VariableReference]) -> list[Call]:
        """Calls that set inputs on the bus to the outputs that feed them, units converted."""
        runs: list[tuple[int, int, int]] = []
        converted: list[Call] = []
        for reference in inputs:
            target, source = self.index[reference], self.index[self._feeds[reference]]
            if reference in self._conversions:
                converted.append(self._conversion_call(target, source, self._conversions[reference]))
            elif runs and (target, source) == (runs[-1][0] + runs[-1][2], runs[-1][1] + runs[-1][2]):
                runs[-1] = (*runs[-1][:2], runs[-1][2] + 1)
            else:
                runs.append((target, source, 1))
        return [*(self._copy_call(target, source, count) for target, source, count in runs), *converted]

    def _copy_call(self, target: int, source: int, count: int) -> Call:
        bus = self.values.data
        call = Call(bus[target : target + count].__setitem__, slice(None), bus[source : source + count])
        return call.set_record(COPY, None, source=self._address(source), count=count, values=self._address(target))

    def _conversion_call(self, target: int, source: int, conversion: Conversion) -> Call:
        numbers = np.array(conversion)
        call = Call(_convert, self.values.data, target, source, conversion)
        call.buffers = numbers
        return call.set_record(CONVERT, numbers.ctypes.data, source=self._address(source), values=self._address(target))

    def _address(self, index: int) -> int:
        return self.values.ctypes.data + index * self.values.itemsize


def _convert(bus: memoryview[float], target: int, source: int, conversion: Conversion) -> None:
    bus[target] = conversion.apply(bus[source])


def _by_component(references: Iterable[VariableReference]) -> Mapping[str, list[VariableReference]]:
    """Component -> its variables."""
    grouped: defaultdict[str, list[VariableReference]] = defaultdict(list)
    for reference in references:
        grouped[reference[0]].append(reference)
    return grouped
