"""Steps of a run, and inputs that its caller sets from step to step."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NoReturn, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import float_array, name_dictionary, shown
from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.instances.protocol import Instance
from liaisons.cosim.messages import logger
from liaisons.cosim.running.kernel import Happening, Kernel
from liaisons.cosim.running.moment import Moment
from liaisons.cosim.running.observers import Observers
from liaisons.cosim.running.pace import EachStep, EqualParts, Points, drive
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.schedule import Feeds
from liaisons.errors import EndedError, InvalidValueError, RefusedError, SimulationError
from liaisons.fmu_files import NUMBERS, integer_range
from liaisons.results import Result

_MOST_DIVISIONS = 20
"""Number of instants that divide steps for contacts at most, for each communication point."""

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
class Stepping:
    """Steps of a run from one communication point to the next, and its whole way.

    :ivar happening: what happens within steps; None: nothing does.
    """

    def __init__(self, kernel: Kernel, observers: Observers, happening: Happening | None) -> None:
        self.happening = happening
        self._kernel, self._observers, simulation = kernel, observers, kernel.simulation
        self._chooses_steps = simulation.adapts or simulation.error_tolerance is not None
        self._is_watched = bool(kernel.deviations or happening)  # something may come between points

    def drive(self, stop: int, *, reports: bool = False) -> Iterator[float]:
        """Step until a number of communication points is reached; yields instants that are reached [s]."""
        kernel, simulation, estimate = self._kernel, self._kernel.simulation, self._observers.estimate
        if simulation.error_tolerance is not None:
            return drive(kernel, EachStep(kernel, estimate))
        if simulation.adapts:
            return drive(kernel, EqualParts(kernel, estimate))
        most = 1 if self._observers.real_time.is_paced else stop
        return drive(kernel, Points(kernel, self.happening, stop, most=most, reports=reports))

    def finish(self, on_progress: Callable[[float], None] | None) -> None:
        """Step to the end; tell now and then the time that is reached [s]."""
        for time in self.drive(self._kernel.count, reports=on_progress is not None):
            if on_progress:
                on_progress(time)

    def changed_inputs(self, free: Sequence[FreeInput], values: Iterable[ArrayLike]) -> list[Call]:
        """Calls that set inputs to values, where these have changed.

        :raises SimulationError: if there is no next communication point, or for a value that an input cannot have.
        """
        progress = self._kernel.progress
        if progress.end or progress.points == self._kernel.count or self._chooses_steps:
            _refuse_step(self._kernel)
        numbers = [*map(FreeInput.checked_numbers, free, values)]  # before any is set
        return [*filter(None, map(FreeInput.assign, free, numbers))]

    def step(self, changed: Sequence[Call]) -> None:
        """Set inputs that have changed, and step to the next communication point.

        :raises SimulationError: if an FMU refuses it.
        """
        kernel, progress = self._kernel, self._kernel.progress
        points = progress.points
        try:
            if changed:
                kernel.bus.perform(changed)
                kernel.begin_piece()
            if self._is_watched or kernel.timeline.next < math.inf or points + 1 == kernel.count:
                deque(self.drive(points + 1), maxlen=0)
            else:  # nothing can happen before the next point
                kernel.recorder.step(kernel.simulation.times[points])
                progress.points += 1
        except EndedError as ended:
            progress.end = str(ended)
            logger.warning("%s", ended)
        except RefusedError as error:
            if error is self._observers.watchdog.refusal:
                progress.end = "a constraint was not kept; restore a state, or start another run"
            raise
        except KeyboardInterrupt:
            progress.end = "it was interrupted within a step; restore a state, or start another run"
            raise

    def conclude_or_divide(self, hidden: Vector) -> Result | Vector:
        """Return the result or, if a contact may be missed or falsely found, instants [s] that divide the steps there.

        :param hidden: instants [s] of points that are not in the result.
        """
        kernel, observers, times = self._kernel, self._observers, self._kernel.simulation.times
        kernel.recorder.hide(hidden)
        recorded, estimate = observers.recorded_result(kernel), observers.estimate
        divides = kernel.timeline.divides and not self._chooses_steps and math.isfinite(times[-1])
        more = estimate.divisions_between(times) if divides and estimate is not None else np.empty(0)
        if more.size and len(hidden) + len(more) <= _MOST_DIVISIONS * len(times):
            return more
        return observers.conclude(kernel, recorded)


def _refuse_step(kernel: Kernel) -> NoReturn:
    """Say why there is no next communication point to which a caller can step."""
    simulation, progress = kernel.simulation, kernel.progress
    words = f"it has reached its end, t = {kernel.recorder.time:.10g} s; give a later stop_time"
    if simulation.adapts or simulation.error_tolerance is not None:
        words = "errors choose its steps; give step_size, and leave error_tolerance out"
    raise SimulationError(f"{simulation.title}: {progress.end or words}")


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
