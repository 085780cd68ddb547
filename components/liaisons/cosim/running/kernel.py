"""All FMUs of a run as one program of prepared calls: it starts, settles at an instant, steps, and crosses a break.

All connected and recorded numbers lie in one array, the *bus*.  FMUs read into it and are set from it, each by one
prepared call for all its variables, and a row of the recording is one copy of it.  Steps make no list and look nothing
up, so that one costs little more than the bare calls.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any, Protocol, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arguments import shown
from liaisons.cosim.compiled.calls import Call, Vector
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.explicit import explicit_calls
from liaisons.cosim.instances.loading import Loaded
from liaisons.cosim.instances.protocol import Instance
from liaisons.cosim.running.breaks import Deviations, Timeline
from liaisons.cosim.running.loop import Loop
from liaisons.cosim.running.moment import Moment, Moments, Remembering
from liaisons.cosim.running.variables import RunVariables
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.components import Components
from liaisons.cosim.structure.schedule import VariableReference, component_of
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS, Drive
from liaisons.errors import RefusedError, SimulationError, suggestion

if TYPE_CHECKING:
    from liaisons.cosim.coupling.signals import Signals

_FEW_POINTS = 1024
"""Number of points for which a run without an end has room at first."""


class Happening(Remembering, Protocol):
    """Events within steps, such as impacts."""

    def advance(self, ends: Sequence[float], *, in_result: bool) -> int:
        """Step to the first instant [s], or across the first event before it; returns whether it was reached."""
        ...

    def initialize(self, solve: Callable[[], None]) -> None:
        """Solve the equations of initialization, with what happens there."""
        ...

    def start(self) -> None:
        """Begin at the start time, once all FMUs are initialized."""
        ...


class Impulses(Protocol):
    """Impulses that go through connections, by which FMUs take part in impacts of others."""

    @property
    def forces(self) -> Collection[VariableReference]:
        """Forces that are connected together with their impulses."""
        ...

    @property
    def variables(self) -> Sequence[VariableReference]:
        """What is read of them, recorded or not."""
        ...

    def happening(self, kernel: Kernel) -> Happening:
        """Steps of a kernel across impacts."""
        ...


class CouplingEstimate(Remembering, Protocol):
    """Estimate of the error that each step adds, from the recorded points.

    :param rows: values of the bus, shape (points, width); ``times`` their instants [s].
    """

    @property
    def initial_calls(self) -> Sequence[Call]:
        """Calls that calculate derivatives at the start, once all FMUs are initialized."""
        ...

    def reset(self) -> None:
        """Forget all steps."""
        ...

    def estimate(self, rows: Vector, times: Vector, crossing: NDArray[np.bool_]) -> Vector:
        """The error that each step adds, shape (points,); ``crossing`` are the ends of tiny steps to breaks."""
        ...

    def estimate_last(self, rows: Vector, times: Vector, count: int) -> Vector:
        """Errors that the last ``count`` steps add, before the steps after them are made."""
        ...

    def divisions_between(self, times: Sequence[float]) -> Vector:
        """Instants between communication points [s] that divide steps in which a contact may not be seen, sorted."""
        ...

    def warn(self, known: Sequence[float], *, is_complete: bool) -> None:
        """Warn of large errors, and of contacts that may have been missed.

        :param known: errors between communication points, if steps were chosen by them.
        :param is_complete: whether there are no other errors, which nothing estimates.
        """
        ...


@final
class Progress:
    """How far a run has come.

    :ivar points: communication points that were reached.
    :ivar errors: of the steps between them, where they are known before the end of the run.
    :ivar end: why there is no next point; empty if there is one.
    """

    def __init__(self) -> None:
        self.restore((1, [], ""))

    def save(self) -> tuple[int, list[float], str]:
        """The state for :meth:`restore`."""
        return self.points, [*self.errors], self.end

    def restore(self, saved: tuple[int, list[float], str]) -> None:
        """Return to a saved state."""
        self.points, errors, self.end = saved
        self.errors = [*errors]


@final
class Kernel:
    """The FMUs of a run, and all that it remembers.

    :param watched: variables that are on the bus in addition to those that are connected or in the result.
    :ivar coupled: the coupled step, of a coupling that repeats it; ``calls`` those of either coupling.
    :ivar recorder: makes and records steps.
    :ivar timeline: the breaks; ``deviations`` finds those of functions that nothing announces.
    :ivar are_samples: whether all breaks are samples, to which steps lead as to any other point.
    :ivar progress: how far the run has come; ``count``: number of communication points.
    """

    def __init__(
        self, simulation: Simulation, instances: Mapping[str, Instance], watched: Iterable[VariableReference]
    ) -> None:
        self.simulation, self.instances = simulation, instances
        feeds, also = simulation.feeds, list[VariableReference]()
        for source in feeds.values() if simulation.iterates else ():
            also += simulation.port_and_order(source)[0]
        order = [SIGNALS, *chain.from_iterable(simulation.strong_components)]
        self.bus = bus = Bus(order, feeds, also, [*simulation.recorded.values(), *watched], simulation.conversions)
        if simulation.iterates:
            from liaisons.cosim.coupling.implicit import Coupled  # which needs SciPy

            self.coupled: Coupled | None = Coupled(simulation, instances, bus)
            self.calls = self.coupled.calls
        else:
            self.coupled, self.calls = None, explicit_calls(simulation, instances, bus)
        moving = list[Drive]()
        for drive in simulation.drives:
            if drive.among is None:  # others are sampled
                moving.append(drive)
        self.deviations = Deviations(moving, bus, simulation.step_tolerance) if moving else None
        self.timeline, self.progress = Timeline(simulation, instances, bus), Progress()
        self.count = len(simulation.times)
        self._batch = 1  # steps for which functions of time are evaluated at once
        self._has_past = False  # whether it was started before

    def prepare(self, watch: Sequence[Call], estimate: Remembering | None, happening: Remembering | None) -> None:
        """Prepare steps and moments, once the bus is as wide as it becomes.

        :param watch: calls that may refuse a step after it.
        :param estimate: that of errors, if any can be estimated.
        :param happening: what may happen within steps.
        """
        simulation, times, estimates = self.simulation, self.simulation.times, estimate is not None
        self._estimates = self._halves = estimates and self.timeline.divides
        self.are_samples = self.timeline.are_samples and not (estimates or simulation.iterates)
        fed = {*map(component_of, simulation.feeds)}
        for name, part in simulation.parts.items():
            self._halves &= name not in fed or not part.approximation.holds_by_choice
            self.are_samples &= not part.approximation.takes_end_values
        capacity = len(times) if math.isfinite(times[-1]) else _FEW_POINTS
        self.recorder = Loop([*self.calls.step, *watch], self.calls.instant, self.bus, capacity)
        self._owners = estimate, happening

    @cached_property
    def variables(self) -> RunVariables:
        """Variables that the user reads and sets between steps."""
        return RunVariables(self.simulation, self.instances, self.bus)

    @cached_property
    def moments(self) -> Moments:
        """Saves and restores the state."""
        coupled, memory = self.coupled, self.deviations and self.deviations.memory
        own = self.recorder, coupled, *self.simulation.drives, memory, self.timeline, self.progress
        owners = *own, self.variables, *self._owners
        return Moments(self.instances, self.bus, [owner for owner in owners if owner is not None])

    def start(
        self, parts: Components, first: Iterable[Call], last: Iterable[Call], happening: Happening | None = None
    ) -> None:
        """Initialize all FMUs at the start time.

        :param parts: the components with their start values.
        :param first: calls that take FMUs to where they begin.
        :param last: calls after initialization.
        :param happening: what may happen at the start, too.
        """
        simulation, bus, calls = self.simulation, self.bus, self.calls
        begin, end = simulation.times[0], simulation.times[-1]
        if self._has_past:
            self._forget()
        self._has_past = True
        bus.set_step(begin, begin)
        self.timeline.begin_piece(begin)
        bus.perform(first)
        bus.values[:] = 0.0
        for name, instance in self.instances.items():
            tolerance = simulation.tolerance or parts[name].fmu.experiment.tolerance
            instance.initialize(parts[name].starts, tolerance, begin, end)
        if happening is None:
            bus.perform(calls.initialization)
        else:
            happening.initialize(lambda: bus.perform(calls.initialization))
        for instance in self.instances.values():
            instance.exit_initialization()
        bus.perform(calls.instant)
        bus.perform(last)
        self.recorder.add(begin, bus.values, result_time=begin)
        self.timeline.find_next(begin)
        if happening is not None:
            happening.start()

    def _forget(self) -> None:
        """Forget all steps, and all points."""
        self.recorder.truncate(0)
        self.progress.restore((1, [], ""))
        if self.deviations:
            self.deviations.memory.reset()
        if self.coupled:
            self.coupled.reset()

    @cached_property
    def late_inputs(self) -> frozenset[VariableReference]:
        """Connected inputs whose value at the end of a step is unknown before it."""
        simulation = self.simulation
        return frozenset(schedule.late_inputs(self.bus.order, simulation.feeds, simulation.coupling))

    @property
    def signals(self) -> Signals:
        """Signals of an implicit coupling, which impacts change."""
        assert self.coupled
        return self.coupled.signals

    @property
    def error_order(self) -> int:
        """Order in H of the error of a step."""
        return self.coupled.error_order if self.coupled else 1

    @property
    def halves_first_step(self) -> bool:
        """Whether the next step is the first of a smooth piece, to be halved for the estimate if it is the only one."""
        return self._halves and self.recorder.begins_piece

    def save(self) -> Moment:
        """Save the present state."""
        return self.moments.save(self.recorder.end)

    def begin_piece(self, size: float | None = None) -> None:
        """Begin a smooth piece with the inputs that are set now; where errors are estimated, it is recorded as a break.

        :param size: of a communication step [s]; None: of the next one.
        """
        recorder, time = self.recorder, self.bus.end.value
        if self.coupled:
            self.coupled.forget_past()
        if self._estimates:
            if size is None:
                times, points = self.simulation.times, self.progress.points
                size = times[points] - times[points - 1]
            recorder.begin_piece(self.timeline.tiny_step(time, size))
        recorder.settle()
        self.timeline.find_next(time)

    def cross(self, start: float, stop: float) -> Vector:
        """Make one step across a break, and locate the next one; returns the values of the signals after it."""
        self.bus.set_step(start, stop)
        self.timeline.begin_piece(stop)
        self.bus.perform(self.calls.crossing)
        self.timeline.find_next(stop)
        return self.bus.values

    def cross_next_break(self, target: float, *, in_result: bool) -> bool:
        """Step across the next break; returns whether it is at the instant to which steps lead.

        :param target: that instant [s].
        :param in_result: whether the break is in the result if it is elsewhere.
        """
        instant, is_target = self.timeline.next, self.timeline.is_next(target)
        stop = max(instant, target) if is_target else instant
        result_time = target if is_target else stop if in_result else None
        row = self.cross(self.recorder.end, stop)
        self.recorder.add(stop, row, result_time=result_time, after_break=True)
        return is_target

    def advance(self, ends: Sequence[float], *, in_result: bool) -> int:
        """Step from instant to instant [s], up to the next break; returns how many were reached."""
        recorder, deviations = self.recorder, self.deviations
        if not deviations:
            recorder.advance(ends, in_result=in_result)
            return len(ends)
        ends = ends[: self._batch]
        integrals = deviations.integrate_steps(np.array([recorder.end, *ends]))
        self._batch = max(1, 2 * len(integrals))  # what is evaluated beyond a break is evaluated again
        if len(integrals):
            self._advance_beside(integrals, ends[: len(integrals)], in_result=in_result)
            return len(integrals)
        instant = deviations.integrate(recorder.end, ends[0])
        if instant < math.inf and self.timeline.divides:
            self.timeline.next = instant
            return 0
        recorder.advance(ends[:1], in_result=in_result)
        return 1

    def attempt(self, ends: Sequence[float]) -> RefusedError | None:
        """Step from instant to instant [s], to be taken back if one is refused; returns why."""
        first = self.recorder.done
        try:
            if self.deviations:
                times = np.array([self.recorder.end, *ends])
                self._advance_beside(self.deviations.integrals(times), ends, in_result=False)
            else:
                self.recorder.advance(ends, in_result=False)
        except RefusedError as refusal:
            return refusal
        except BaseException:
            self.recorder.truncate(first)
            raise
        return None

    def _advance_beside(self, integrals: Vector, ends: Sequence[float], *, in_result: bool) -> None:
        """Step, and record integrals of deviations beside each step."""
        assert self.deviations
        recorder, first = self.recorder, self.recorder.done
        try:
            recorder.advance(ends, in_result=in_result)
        finally:
            recorder.rows[first : recorder.done, self.deviations.span] = integrals[: recorder.done - first]


def fmpy_instance(kernel: Kernel, name: object) -> Any:
    """FMPy's object of a component.

    :raises SimulationError: for an unknown component, and one that runs in a process of its own.
    """
    title, instances = kernel.simulation.title, kernel.instances
    if not isinstance(name, str) or name not in instances:
        raise SimulationError(f"{title}: has no component {shown(name)}{suggestion(str(name), instances)}")
    if not isinstance(instance := instances[name], Loaded):
        words = f"{name} runs in a process of its own, where FMPy's object is; leave out isolated"
        raise SimulationError(f"{title}: {words}")
    return instance.fmpy_instance
