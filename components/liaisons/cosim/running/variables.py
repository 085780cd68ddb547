"""Variables of a run by their names: inputs that its caller sets, values that it reads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, final

import numpy as np

from liaisons.base.arguments import shown
from liaisons.base.arrays import as_indices
from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.instances.texts import text
from liaisons.cosim.running.stepping import FreeInput
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import SimulationError

Reading = tuple[Sequence[Call], Vector, Callable[[Vector], Any]]
"""Calls that read a variable, the numbers that they write, and a function from these to its value."""


@final
class RunVariables:
    """The variables of a run; calls are prepared when a name is used first."""

    def __init__(self, simulation: Simulation, instances: Instances, bus: Bus) -> None:
        self._simulation, self._instances, self._bus = simulation, instances, bus
        self._free_inputs: dict[str, FreeInput] = {}
        self._readings: dict[str, Reading] = {}

    def reference(self, name: str) -> VariableReference:
        """Component and variable of a name in the result or in the system."""
        if not isinstance(name, str):
            raise SimulationError(f"{self._simulation.title}: a variable is read by its name, not by {shown(name)}")
        return self._simulation.recorded.get(name) or self._simulation.document.reference("variable", name)

    def columns(self, names: Sequence[str]) -> Indices:
        """Columns of the bus of variables that are recorded or connected.

        :raises SimulationError: for another one.
        """
        columns = [self._bus.index.get(self.reference(name)) for name in names]
        if None in columns:
            words = f"{names[columns.index(None)]} is not recorded; name it in record=[...]"
            raise SimulationError(f"{self._simulation.title}: {words}")
        return as_indices(columns)

    def recorded(self) -> dict[str, float]:
        """Present values of what is in the result."""
        recorded = self._simulation.recorded
        return dict(zip(recorded, self._bus.values[self._bus.columns(recorded.values())].tolist(), strict=True))

    def free_input(self, name: str) -> FreeInput:
        """The input of a name.

        :raises SimulationError: if there is none, or if something feeds it.
        """
        if name not in self._free_inputs:
            owner, variable = self.reference(name)
            part, feeds = self._simulation.parts[owner], self._simulation.feeds
            self._free_inputs[name] = FreeInput(part, variable, self._instances[owner], feeds)
        return self._free_inputs[name]

    def read(self, name: str) -> Any:
        """The present value of a variable; of an array, all of them."""
        if not isinstance(name, str) or name not in self._readings:
            self._readings[name] = self._prepare_reading(name)
        calls, values, convert = self._readings[name]
        self._bus.perform(calls)
        return convert(values)

    def _prepare_reading(self, name: str) -> Reading:
        owner, variable = self.reference(name)
        part, column = self._simulation.parts[owner], self._bus.index.get((owner, variable))
        scalars, shape = [part.scalar(n) for n in part.recordable_names(variable)], part.fmu.arrays.get(variable)
        if column is None:
            values = np.empty(len(scalars))
            calls = [self._instances[owner].getter(scalars, values)]
        else:
            values, calls = self._bus.values[column : column + 1], list[Call]()
        if scalars[0].type == "String":
            return calls, values, lambda values: text(values[0]).decode(errors="replace")
        return calls, values, lambda values: float(values[0]) if shape is None else values.reshape(shape).copy()

    def save(self) -> dict[str, Vector]:
        """Values of inputs that were set last, for :meth:`restore`."""
        return {name: free.values.copy() for name, free in self._free_inputs.items()}

    def restore(self, saved: Mapping[str, Vector]) -> None:
        """Set them to saved ones; those that were not set then are unknown."""
        for name, free in self._free_inputs.items():
            free.values[:] = saved.get(name, np.nan)
