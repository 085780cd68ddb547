"""Inputs that the caller of a run sets from step to step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NoReturn, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import float_array, shown
from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.description.start_values import integer_range
from liaisons.cosim.description.variables import NUMBERS
from liaisons.cosim.instances.protocol import Instance
from liaisons.cosim.running.kernel import Kernel
from liaisons.cosim.running.moment import Moment
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.schedule import Feeds
from liaisons.errors import InvalidValueError, SimulationError

RunState = Moment
"""Older name."""


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
        self.values = np.full(len(scalars), np.nan)
        self.put: Call = instance.setter(scalars, self.values)
        self._view: Any = self.values.data  # numbers of Python, since scalars of NumPy take three times as long

    def checked_numbers(self, value: ArrayLike) -> Vector | float:
        """A value of the input as numbers.

        :raises SimulationError: if it is not finite, or not of the type or the shape of the input.
        """
        if type(value) is float and self._variable.type == "Real" and not self._shape and math.isfinite(value):
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


def refuse_step(kernel: Kernel) -> NoReturn:
    """Say why there is no next communication point to which a caller can step."""
    simulation, progress = kernel.simulation, kernel.progress
    words = f"it has reached its end, t = {kernel.recorder.time:.10g} s; give a later stop_time"
    if simulation.adapts or simulation.error_tolerance is not None:
        words = "errors choose its steps; give step_size, and leave error_tolerance out"
    raise SimulationError(f"{simulation.title}: {progress.end or words}")


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
