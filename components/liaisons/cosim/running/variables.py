"""Variables of a run by their names: inputs that its caller sets, values that it reads."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import float_array, name_dictionary, shown
from liaisons.base.arrays import as_indices
from liaisons.cosim.compiled.calls import Call, Indices, Vector
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.buffer_layouts import text_of
from liaisons.cosim.instances.protocol import Instance, Instances
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.schedule import Feeds, VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import InvalidValueError, SimulationError
from liaisons.fmu_files import NUMBERS, integer_range

Reading = tuple[Sequence[Call], Vector, Callable[[Vector], Any]]
"""Calls that read a variable, the numbers that they write, and a function from these to its value."""


@final
class FreeInput:
    """An input of numbers, or an array of inputs, that nothing feeds.

    :ivar values: those that were set last, shape (elements,); not-a-number before.
    :ivar put: a call that sets the FMU to them.
    :raises SimulationError: if it is none.
    """

    def __init__(self, part: SystemComponent, name: str, instance: Instance, feeds: Feeds) -> None:
        scalars = [part.scalar(element) for element in part.recordable_names(name)]
        self._label, self._variable, self._shape = f"{part.name}.{name}", scalars[0], part.fmu.arrays.get(name, ())
        if self._variable.causality != "input" or self._variable.type not in NUMBERS:
            words = f"is {self._variable.type} of causality {self._variable.causality!r}"
            raise SimulationError(f"{self._label} {words}, which a step cannot set; give numbers to inputs")
        if fed := [scalar.name for scalar in scalars if (part.name, scalar.name) in feeds]:
            raise SimulationError(f"{part.name}.{fed[0]} is connected or driven, so that a step cannot set it")
        self._is_number = self._variable.type == "Real" and not self._shape
        self.values = np.full(len(scalars), np.nan)
        self.put: Call = instance.setter(scalars, self.values)
        self._view: Any = self.values.data  # numbers of Python, since scalars of NumPy take three times as long

    def checked_numbers(self, value: ArrayLike) -> Vector | float:
        """A value of the input as numbers.

        :raises SimulationError: if it is not finite, or not of the type or the shape of the input.
        """
        if type(value) is float and self._is_number and math.isfinite(value):
            return value
        checked = float_array(self._label, value)
        if checked.shape != self._shape:
            raise InvalidValueError(f"{self._label} = {shown(value)}: give numbers of shape {self._shape}")
        if not np.isfinite(checked).all():
            raise InvalidValueError(f"{self._label} = {shown(value)}: must be finite")
        if self._variable.type != "Real":
            least, most = integer_range(self._variable.base)
            if not (checked == np.clip(np.round(checked), least, most)).all():
                raise InvalidValueError(f"{self._label} = {shown(value)}: give whole numbers from {least} to {most}")
        return checked.ravel() if self._shape else checked.item()

    def assign(self, numbers: Vector | float) -> Call | None:
        """Set :attr:`values`; returns :attr:`put` if they have changed."""
        if self._shape:
            same = np.array_equal(self.values, numbers)
            self.values[:] = numbers
        else:
            same = self._view[0] == numbers
            self._view[0] = numbers
        return None if same else self.put


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
            return calls, values, lambda values: text_of(values[0]).decode(errors="replace")
        return calls, values, lambda values: float(values[0]) if shape is None else values.reshape(shape).copy()

    def save(self) -> dict[str, Vector]:
        """Values of inputs that were set last, for :meth:`restore`."""
        return {name: free.values.copy() for name, free in self._free_inputs.items()}

    def restore(self, saved: Mapping[str, Vector]) -> None:
        """Set them to saved ones; those that were not set then are unknown."""
        for name, free in self._free_inputs.items():
            free.values[:] = saved.get(name, np.nan)


def named_values(values: Mapping[str, ArrayLike] | None, further: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    """Values of inputs by their names.

    :raises SimulationError: unless they are a dictionary.
    """
    try:
        return {**({} if values is None else values), **further}
    except TypeError:
        return name_dictionary("inputs", values)  # says what is wrong


def one_number_each(title: str, inputs: Sequence[str], values: ArrayLike) -> list[float]:
    """Values of inputs in an array as numbers.

    :param title: of the simulation.
    :param inputs: their names.
    :raises SimulationError: unless there is one for each.
    """
    if type(values) is list and len(values) == len(inputs) and set(map(type, values)) == {float}:
        return values
    try:
        numbers = np.asarray(values)
    except ValueError:  # of several lengths
        numbers = float_array("inputs", values)
    if numbers.shape != (len(inputs),):
        raise SimulationError(f"{title}: inputs = {shown(values)}: give one number for each of {inputs}")
    return numbers.tolist()
