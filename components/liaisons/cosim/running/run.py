"""The run of a simulation: FMUs are made, initialized, stepped, recorded, and released whatever happens.

All connected and recorded numbers lie in one array, the *bus*.  FMUs read into it and are set from it, each by one
prepared call for all its variables, and a row of the recording is one copy of it.  The loop over the communication
points, :mod:`liaisons.cosim.running.loop`, makes no list and looks nothing up, so that a step costs little more than
the bare calls.
"""

from __future__ import annotations

import gc
import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter, sleep
from typing import TYPE_CHECKING, Any, NoReturn, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_positive, float_array, merged_start_values, name_dictionary, name_list, shown
from liaisons.base.clocks import time_rounding
from liaisons.base.folders import temporary_folder
from liaisons.base.interrupts import deferred_interrupts
from liaisons.base.logs import collected_warnings
from liaisons.base.progress import progress_bar
from liaisons.cosim.arrays import Indices, Vector, as_indices
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.explicit import CommunicationCalls, communication_calls
from liaisons.cosim.coupling.signals import connected_port_outputs, units_of
from liaisons.cosim.instances import Instance, extract_fmus, make_instance
from liaisons.cosim.instances.protocol import Loaded
from liaisons.cosim.instances.texts import text
from liaisons.cosim.messages import add_warnings, logger, warn_of_non_finite_values
from liaisons.cosim.running.adaptive import CommunicationSteps, adapt_steps, divide_steps
from liaisons.cosim.running.breaks import Breaks, Deviations
from liaisons.cosim.running.contacts import (
    connections_losing_impulses,
    contact_variables,
    divisions_between,
    friction_variables,
    missing_impulses,
    warn_of_missing,
)
from liaisons.cosim.running.estimate import Estimate
from liaisons.cosim.running.impulses import ImpulsivePort, forces_through, impulse_sums, impulsive_ports
from liaisons.cosim.running.input_reconstruction import (
    contact_mechanisms,
    input_reconstructions,
    prepare_initial_gains,
)
from liaisons.cosim.running.loop import Loop
from liaisons.cosim.running.moment import Moment, Moments, Progress, state_calls
from liaisons.cosim.running.stepping import FreeInput
from liaisons.cosim.running.trial import try_to_start
from liaisons.cosim.running.variables import RunVariables
from liaisons.cosim.running.watchdog import Watchdog
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.components import Components
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS
from liaisons.errors import EndedError, RefusedError, SimulationError, suggestion
from liaisons.results import IncompleteError, Interrupted, Result

if TYPE_CHECKING:
    from liaisons.cosim.coupling.implicit import Coupled
    from liaisons.cosim.running.impacts import Impacts
    from liaisons.cosim.running.linearization import Linearization

_PROGRESS_INTERVAL = 0.02
"""Time between two calls of on_progress, about [s]."""
_MOST_IN_BATCH = 256
"""Most steps for which functions of time are evaluated at once."""
_FEW_POINTS = 1024
"""Points for which there is room at first in a run without an end."""
_LEAST_IMPACT_DISTANCE = 1e-9
"""Time from an impact to a communication point below which they are one, relative to a step."""
_LEAST_EXTRAPOLATED_STEP = 1e-4
"""Size of a step in which inputs are extrapolated, as differences are rounding, relative to one between points."""
_MOST_IMPACTS = 1000
"""Most impacts of several FMUs in a communication step."""
_MOST_DIVISIONS = 20
"""Most instants that divide steps for contacts, for each communication point."""
_LONGEST_BREAK_STEP = 1e-6
"""Longest step to a break, relative to the longest step of a run; such steps are not halved."""
_UNNOTICED_DELAY = 1e-3
"""Lateness of which there is no warning [s]: what clocks and schedulers resolve."""


@final
class Run:
    """Running FMUs of a simulation; a context manager that releases them.

    It can start again, with other start values: every FMU goes back to the state that it had when it was instantiated,
    so that a run gives the same numbers whatever was before it.

    :param folders: folder of each extracted FMU; None: they are extracted for this run only.
    :param again: whether it is to start several times.
    :ivar repeats: whether it can start several times: all FMUs can go back.
    """

    def __init__(
        self, simulation: Simulation, folders: Mapping[Path, Path] | None = None, *, again: bool = False
    ) -> None:
        self._simulation = simulation
        self._instances: dict[str, Instance] = {}
        self._coupled: Coupled | None = None
        parts, times = simulation.parts, simulation.times
        self.repeats = again and all(part.fmu.can_get_and_set_state for part in parts.values())
        with ExitStack() as stack, _pause_garbage_collection():
            if folders is None:
                folders = extract_fmus((part.fmu for part in parts.values()), stack.enter_context(temporary_folder()))
            for name, part in parts.items():
                folder = folders.get(part.fmu.path, Path())
                if not part.isolated and part.fmu.function is None:
                    try_to_start(part, folder, times)
                instance = make_instance(
                    name,
                    part.fmu,
                    folder,
                    requests_intermediate_update=simulation.iterates
                    and part.approximation.interface == "intermediate update",
                    isolated=part.isolated,
                )
                self._instances[name] = stack.enter_context(instance)
            also = connected_port_outputs(parts, simulation.feeds) if simulation.iterates else []
            order = schedule.execution_order([SIGNALS, *parts], simulation.feeds)
            through = impulsive_ports(simulation)
            self._sums = connections_losing_impulses(simulation, forces_through(through))
            fed = {name for name, _ in simulation.feeds}
            contacts = [
                variable
                for name, part in parts.items()
                if through or name in fed
                for variables in (*contact_variables(part), *friction_variables(part))
                for variable in variables
            ]
            self._watchdog = Watchdog(simulation)
            sums = [variable for pair in impulse_sums(simulation, through).items() for variable in pair]
            recorded = [*simulation.recorded.values(), *self._sums, *contacts, *self._watchdog.variables, *sums]
            self._bus = Bus(order, simulation.feeds, also, recorded, simulation.conversions)
            self._columns = self._bus.columns(simulation.recorded.values())
            self._initial, self._at_instant, step = self._prepare_calls()
            self._watchdog.prepare(self._bus)
            self._chooses_steps = simulation.error_tolerance is not None or simulation.adapts
            self._deviations = Deviations(simulation.drives, self._bus, simulation.step_tolerance)
            self._batch = 1  # steps for which functions of time are evaluated at once
            self._initial_gains = prepare_initial_gains(simulation, self._instances, self._bus)
            self._estimate = Estimate(
                input_reconstructions(simulation, self._bus, self._deviations.columns),
                self._bus.index,
                units_of(parts, simulation.feeds, self._bus.index),
                contact_mechanisms(simulation, self._bus),
            )
            self._breaks = Breaks(simulation, self._instances, self._bus)
            self._steps = CommunicationSteps(
                simulation,
                self._bus,
                step,
                self._watchdog.calls,
                self._coupled,
                self._breaks,
                self._deviations,
                self._estimate,
            )
            reads_samples = any(parts[name].approximation.holds_by_choice for name in fed)
            self._divides = self._breaks.divides and self._estimate.can_estimate and not reads_samples
            self._are_samples = self._breaks.are_samples and not (
                self._estimate.can_estimate
                or self._coupled
                or any(part.approximation.takes_end_values for part in parts.values())
            )
            self._impacts = self._impacts_through(through)
            self._loop = Loop(
                [*step, *self._watchdog.calls], self._bus, len(times) if math.isfinite(times[-1]) else _FEW_POINTS
            )
            self._progress, self._variables = Progress(), RunVariables(simulation, self._instances, self._bus)
            memories = self._coupled, self._impacts and self._impacts.memory
            owners = [self._loop, *simulation.drives, self._deviations.memory, *filter(None, memories)]
            also = [self._breaks, self._estimate, self._progress, self._variables]
            self._moments = Moments(self, self._instances, self._bus, [*owners, *also])
            self._closed, self._lost = False, True  # closed; without a state of the FMUs
            self.lateness: list[float] = []
            saves, self._restores = zip(*state_calls(self._instances), strict=True) if self.repeats else ((), ())
            self._bus.perform(saves)
            self._warnings = stack.enter_context(collected_warnings())
            self._stack = stack.pop_all()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the FMUs."""
        self._closed = True
        self._stack.close()

    def fmu(self, name: str) -> Any:
        """The object of FMPy that is an FMU: ``FMU2Slave``, ``FMU2Model``, ``FMU3Slave`` or ``FMU3Model``.

        All that FMPy can do with it may be done, but for what the run does: to step, reset, terminate and free it.

        :param name: name of the component.
        :raises SimulationError: for an unknown component, and one that runs in a process of its own.
        """
        if not isinstance(name, str) or name not in self._instances:
            self._refuse(f"has no component {shown(name)}{suggestion(str(name), self._instances)}")
        if not isinstance(instance := self._instances[name], Loaded):
            self._refuse(f"{name} runs in a process of its own, where FMPy's object is; leave out isolated")
        return instance.fmpy_instance

    def start(self, parts: Components | None = None) -> None:
        """Initialize all FMUs at the start time.

        :param parts: the same with other start values.
        :raises SimulationError: if an FMU refuses something.
        """
        simulation, bus = self._simulation, self._bus
        begin, end = simulation.times[0], simulation.times[-1]
        self._lost = True
        self._loop.truncate(0)
        self._progress.reset()
        bus.set_step(begin, begin)
        self._breaks.begin_piece(begin)
        self._deviations.memory.reset()
        bus.perform(self._restores)
        bus.values[:] = 0.0
        if self._coupled is not None:
            self._coupled.reset()
        parts = simulation.parts if parts is None else parts
        for name, instance in self._instances.items():
            tolerance = simulation.tolerance or parts[name].fmu.experiment.tolerance
            instance.initialize(parts[name].starts, tolerance, begin, end)
        if self._impacts is None:
            bus.perform(self._initial)
        else:
            self._impacts.initialize(lambda: bus.perform(self._initial))
        for instance in self._instances.values():
            instance.exit_initialization()
        bus.perform(self._at_instant)
        bus.perform(self._initial_gains)
        self._loop.add(begin, bus.values, result_time=begin)
        if self._impacts is not None:
            self._impacts.start()
        self._breaks.find_next(begin)
        self._clock: tuple[float, float, float] | None = None  # seconds a second, instant of the clock, and simulated
        self.lateness.clear()
        self._variables.forget()
        self._lost = False

    def finish(self, on_progress: Callable[[float], None] | None = None) -> None:
        """Simulate to the end.

        :param on_progress: called now and then with the time that is reached [s].
        :raises SimulationError: if an FMU refuses something.
        """
        simulation = self._simulation
        if not self._chooses_steps:
            self._step_to_point(len(simulation.times), on_progress)
            return
        self._estimate.reset()
        for point in (divide_steps if simulation.adapts else adapt_steps)(self._steps, self._moments):
            self._loop.add(point.time, point.values, result_time=point.result_time, after_break=point.after_break)
            if point.error is not None:
                self._progress.errors.append(point.error)
            if on_progress:
                on_progress(point.time)

    def _step_to_point(self, stop: int, on_progress: Callable[[float], None] | None = None) -> None:
        """Step until a number of communication points is reached, and to the breaks between them."""
        loop, breaks, points, done = self._loop, self._breaks, self._simulation.times, self._progress.points
        most = 1 if self._clock else _MOST_IN_BATCH if self._deviations else stop
        many = 1 if on_progress or self._deviations else most  # points between two calls of on_progress
        while done < stop:
            begin, time = perf_counter(), loop.end
            size = points[done] - points[done - 1]
            near = time_rounding(breaks.next) if breaks.next < np.inf else 0.0
            last = min(done + many, stop)
            free = bisect_left(points, breaks.next - near, done, min(last + 1, len(points)))
            if done < free:  # points before the next break
                if self._is_first_of_piece() and free == done + 1:
                    self._advance([(time + points[done]) / 2], in_result=False)
                else:
                    done += self._advance(points[done : min(last, free)])
            elif self._are_samples:
                on_time = points[done] - breaks.next <= near
                loop.advance([points[done] if on_time else breaks.next], in_result=on_time)
                done += on_time
                breaks.find_next(loop.end)
            elif breaks.next - time > 2 * (tiny := breaks.tiny_step(breaks.next, size)):
                before = breaks.next - tiny
                halves = [(time + before) / 2, before]
                self._advance(halves if self._is_first_of_piece() else halves[1:], in_result=False)
            else:
                instant, result_time = breaks.next, None
                if points[done] - instant <= near:
                    instant, result_time = max(instant, points[done]), points[done]
                    done += 1
                loop.add(
                    instant, self._steps.step_across_break(time, instant), result_time=result_time, after_break=True
                )
            self._progress.points = done
            many = min(most, max(1, 2 * many if perf_counter() - begin < _PROGRESS_INTERVAL else many // 2))
            if on_progress:
                on_progress(loop.end)

    # ---- step by step

    @property
    def time(self) -> float:
        """The communication point that was reached last [s]."""
        self._require_state()
        return self._loop.time

    def step(self, inputs: Mapping[str, ArrayLike] | None = None, /, **keywords: ArrayLike) -> None:
        """Step to the next communication point.

        :param inputs: values of inputs that nothing feeds, which they keep until they are set again; of a system by
            ``"component.input"``.  ``keywords`` are further ones.
        :raises SimulationError: for an unknown input, one that has a source, a value that it cannot have, and a run
            that is closed or at its end; :class:`IncompleteError`, with the result so far, if an FMU refuses the step.
        """
        try:
            values = {**({} if inputs is None else inputs), **keywords}
        except TypeError:
            values = name_dictionary("inputs", inputs)  # says what is wrong
        self._set_and_step([self._free_input(name) for name in values], values.values())

    def stepper(self, inputs: Sequence[str], outputs: Sequence[str]) -> Callable[[ArrayLike], Vector]:
        """Prepare a step as a function of an array.

        :param inputs: names of scalars, as of :meth:`step`.
        :param outputs: names of scalars that are recorded or connected.
        :returns: function of the inputs, shape (inputs,), that steps and returns the outputs, shape (outputs,).
        :raises SimulationError: for a name that is none of these; the function raises what :meth:`step` does.
        """
        inputs, outputs = name_list("inputs", inputs), name_list("outputs", outputs)
        free = [self._free_input(name) for name in inputs]
        columns = [self._bus.index.get(self._variables.reference(name)) for name in outputs]
        if None in columns:
            self._refuse(f"{outputs[columns.index(None)]} is not recorded; name it in record=[...]")
        indices, shape = as_indices(columns), (len(free),)

        def step(values: ArrayLike) -> Vector:
            try:
                numbers = np.asarray(values)
            except ValueError:  # of several lengths
                numbers = float_array("inputs", values)
            if numbers.shape != shape:
                self._refuse(f"inputs = {shown(values)}: give one number for each of {inputs}")
            self._set_and_step(free, numbers.tolist())
            return self._bus.values[indices]

        return step

    def _set_and_step(self, free: Sequence[FreeInput], values: Collection[ArrayLike]) -> None:
        """Set inputs whose values have changed, and step to the next communication point."""
        self._require_open()
        times, points = self._simulation.times, self._progress.points
        if self._chooses_steps:
            self._refuse("errors choose its steps; give step_size, and leave error_tolerance out")
        if self._progress.end or points == len(times):
            self._refuse(
                self._progress.end or f"it has reached its end, t = {self.time:.10g} s; give a later stop_time"
            )
        numbers = [one.checked_numbers(value) for one, value in zip(free, values, strict=True)]
        changed = [one.put for one, number in zip(free, numbers, strict=True) if one.assign(number)]
        try:
            if changed:
                self._bus.perform(changed)
                self._begin_piece(times[points] - times[points - 1])
            if self._deviations or self._impacts or self._breaks.next < math.inf or points + 1 == len(times):
                self._step_to_point(points + 1)
            else:
                self._loop.advance((times[points],))
                self._progress.points += 1
        except EndedError as ended:
            self._progress.end = str(ended)
            logger.warning("%s", ended)
        except SimulationError as error:
            if error is self._watchdog.refusal:
                self._progress.end = "a constraint was not kept; restore a state, or start another run"
            raise IncompleteError(str(error), self.result) from error
        except KeyboardInterrupt:
            self._progress.end = "it was interrupted within a step; restore a state, or start another run"
            raise
        self.wait()

    def _begin_piece(self, size: float) -> None:
        """Begin a smooth piece with the inputs that are set now.

        :param size: of a communication step [s].
        """
        bus, loop, time = self._bus, self._loop, self._bus.end.value
        if self._coupled is not None:
            bus.set_step(time, time)
            self._coupled.forget_past()
        bus.perform(self._at_instant)
        if self._estimate.can_estimate:
            loop.begin_piece(self._breaks.tiny_step(time, size))
        loop.rows[loop.done - 1] = bus.values
        self._breaks.find_next(time)

    def _free_input(self, name: str) -> FreeInput:
        self._require_open()
        return self._variables.free_input(name)

    def __getitem__(self, name: str) -> Any:
        """A value at the present time, whether it is recorded or not; of an array, all of them.

        :raises SimulationError: for an unknown name, and after the run was closed.
        """
        self._require_open()
        return self._variables.read(name)

    def _require_unclosed(self) -> None:
        if self._closed:
            self._refuse("the run is closed; start another one")

    def _require_state(self) -> None:
        if self._lost:
            self._refuse("it has no state, since a start was refused: reset it again")

    def _require_open(self) -> None:
        self._require_unclosed()
        self._require_state()

    def __reduce__(self) -> NoReturn:
        self._refuse("a run has FMUs in memory, and cannot be copied or pickled; pickle its result")

    def _refuse(self, words: str) -> NoReturn:
        raise SimulationError(f"{self._simulation.title}: {words}")

    def save(self) -> Moment:
        """Save the present state, to which the run can return any number of times.

        :raises SimulationError: if an FMU cannot return to a state.
        """
        self._require_open()
        self._require_states()
        return self._moments.save(self.time)

    def restore(self, state: Moment) -> None:
        """Return to a saved state, with the points that were recorded until then.

        :raises SimulationError: for the state of another run.
        """
        self._require_unclosed()
        if not isinstance(state, Moment) or state.run is not self:
            words = "is of another run" if isinstance(state, Moment) else "is no state of a run"
            self._refuse(f"{shown(state)} {words}; restore what its own save() has returned")
        self._lost = True
        self._moments.restore(state)
        self._lost = False

    def reset(self, start_values: Mapping[str, ArrayLike] | None = None, /, **keywords: ArrayLike) -> None:
        """Begin again at the start time, without instantiating the FMUs again.

        What is refused leaves the run in the state that it had, if the FMUs can return to it; else without one.

        :param start_values: where they differ from those that the run was made with; of a system by
            ``"component.variable"``.  ``keywords`` are further ones.
        :raises SimulationError: for an unknown name, a value that cannot be set, or an FMU that cannot go back.
        """
        document = self._simulation.document
        starts = merged_start_values(document.name, start_values, keywords)
        self._require_states()
        parts = document.with_start_values(starts).parts
        before = None if self._lost else self.save()
        try:
            self.start(parts)
        except BaseException:
            if before is not None:
                with suppress(SimulationError):
                    self.restore(before)
            raise

    def linearize(self) -> Linearization:
        """The linear system that deviations from the present point follow; its outputs are those that are recorded.

        Its inputs are those that nothing feeds, those of functions of time, and outputs of sampled components, which
        hold.

        :raises SimulationError: for an FMU that provides no directional derivatives.
        """
        from liaisons.cosim.running.linearization import linearization

        self._require_open()
        values = dict(zip(self._simulation.recorded, self._bus.values[self._columns].tolist(), strict=True))
        return linearization(self._simulation, self._instances, self.time, values)

    def _require_states(self) -> None:
        self._require_unclosed()
        for name, part in self._simulation.parts.items():
            if not part.fmu.can_get_and_set_state:
                words = f"{name} ({part.fmu.path.name}) cannot go back: its canGetAndSetFMUstate is false"
                self._refuse(f"{words}; start another run")

    def pace(self, factor: float = 1.0) -> None:
        """Wait, from now on, after each step until the clock has advanced as much.

        :param factor: simulated seconds a second.
        :raises SimulationError: unless it is positive.
        """
        check_positive("pace", factor)
        self._clock = factor, perf_counter(), self.time

    def wait(self) -> None:
        """Wait for the clock, if there is a pace; add to ``lateness`` by how much it was ahead [s]."""
        if self._clock is not None:
            factor, begin, first = self._clock
            late = perf_counter() - begin - (self.time - first) / factor
            self.lateness.append(max(late, 0.0))
            sleep(max(-late, 0.0))

    def _advance(self, instants: Sequence[float], *, in_result: bool = True) -> int:
        """Step to instants [s] up to the next break, and across impacts; returns how many were reached."""
        if self._impacts is None:
            return self._advance_without_impacts(instants, in_result=in_result)
        return self._advance_with_impacts(self._impacts, instants[0], in_result=in_result)

    def _advance_with_impacts(self, impacts: Impacts, instant: float, *, in_result: bool) -> int:
        """Step to an instant [s], and across the impacts before it; returns 1, or 0 if a break is in between."""
        loop, size = self._loop, instant - self._loop.end
        settled = -math.inf  # where dry friction that begins to slide has been looked at
        for _ in range(_MOST_IMPACTS):
            start = loop.end
            if start > settled + _LEAST_IMPACT_DISTANCE * size and self._begins_to_slide(impacts, size):
                settled = start
                if self._cross_impacts(impacts, start, instant, size, in_result=in_result):
                    return 1
                continue
            attempt, go_back, refusals = self._repeatable_step(impacts)
            if attempt(instant, shown=in_result):
                return int(loop.time == instant)
            stop = impacts.step_to_first(start, instant, attempt)
            if stop <= start:
                if refusals:
                    raise refusals[0]
                go_back()
            if self._cross_impacts(impacts, stop, instant, instant - start, in_result=in_result):
                return 1
        words = f"more than {_MOST_IMPACTS} impacts, or changes of contacts, before t = {instant:.10g} s"
        raise RefusedError(f"{self._simulation.title}: {words}: make one FMU of the system by flatten()")

    def _cross_impacts(self, impacts: Impacts, now: float, end: float, size: float, *, in_result: bool) -> bool:
        """Cross impacts, or changes of a contact's mode, of this instant; return whether the end is reached.

        :param size: of a communication step [s].
        """
        loop, bus, go_back = self._loop, self._bus, self._save_step()
        before = loop.rows[loop.done - 1].copy()
        stop = min(now + self._breaks.tiny_step(now, size), end)

        def cross(*actions: Callable[[], None]) -> Vector:
            go_back()
            for action in actions:
                action()
            return self._steps.step_across_break(now, stop)

        def go_on() -> Vector:
            return self._steps.step_across_break(stop, stop + (stop - now))

        after = self._steps.step_across_break(now, stop) if stop > now else before
        if not impacts.has_impact(before, after, size):
            if stop > now:
                after = impacts.let_stick(before, after, size, (cross, go_on))
            if self._begins_to_slide(impacts, size):  # as the FMUs have chosen alone
                loop.rows[loop.done - 1] = after
            loop.add(stop, after, result_time=stop if stop == end and in_result else None, after_break=True)
            return stop == end
        go_back()
        if ends := end - now <= _LEAST_IMPACT_DISTANCE * size:
            now = loop.times[loop.done - 1] = end
            if in_result:
                loop.result_times[loop.done - 1] = end
        bus.set_step(now, now)
        bus.perform(self._at_instant)  # so that inputs are outputs, whatever the tolerance of the step
        impacts.solve(now)
        self._begin_piece(size)
        return ends

    def _begins_to_slide(self, impacts: Impacts, size: float) -> bool:
        """Whether the present point begins a smooth piece, and dry friction slides there without a velocity."""
        loop = self._loop
        is_first = loop.done == 1 or bool(loop.after_break[loop.done - 1])
        return is_first and impacts.begins_to_slide(loop.rows[loop.done - 1], size)

    def _repeatable_step(self, impacts: Impacts) -> tuple[Callable[..., bool], Callable[[], None], list[RefusedError]]:
        """Prepare a step from the present state that can be repeated with other ends.

        :returns: a function that steps to an instant [s], and returns whether no contact has changed and no FMU has
            refused; a function that goes back; and the refusal of the last step, if there was one.
        """
        loop, refusals = self._loop, list[RefusedError]()
        first, start, halves = loop.done, loop.end, self._is_first_of_piece()
        times, points, go_back = self._simulation.times, self._progress.points, self._save_step()
        shortest = _LEAST_EXTRAPOLATED_STEP * (times[points] - times[points - 1])

        def attempt(stop: float, *, shown: bool = False) -> bool:
            go_back()
            refusals.clear()
            try:
                if stop - start < shortest:
                    row = self._steps.step_across_break(start, stop)
                    loop.add(stop, row, result_time=stop if shown else None, after_break=True)
                    reached = 1
                else:
                    if halves:
                        self._advance_without_impacts([(start + stop) / 2], in_result=False)
                    reached = self._advance_without_impacts([stop], in_result=shown)
            except RefusedError as error:
                refusals.append(error)
                return False
            before, after = loop.rows[[first - 1, loop.done - 1]]
            changed = impacts.has_impact(before, after, stop - start) or impacts.has_changed_contact(before, after)
            return not reached or not changed

        return attempt, go_back, refusals

    def _save_step(self) -> Callable[[], None]:
        """Save the state at the start of a step; returns a function that restores it, any number of times."""
        before = self._moments.save(self._loop.end)
        return lambda: self._moments.restore(before)

    def _advance_without_impacts(self, instants: Sequence[float], *, in_result: bool = True) -> int:
        """Step to instants [s] up to the next break; returns how many were reached."""
        loop, deviations = self._loop, self._deviations
        if not deviations:
            loop.advance(instants, in_result=in_result)
            return len(instants)
        first, time = loop.done, loop.end
        instants = instants[: self._batch]
        integrals = deviations.integrate_steps(np.array([time, *instants]))
        self._batch = max(1, 2 * len(integrals))  # what is evaluated beyond a break is evaluated again
        if not len(integrals):
            instant = deviations.integrate(time, instants[0])
            if instant < np.inf and self._breaks.divides:
                self._breaks.next = instant
                return 0
            loop.advance(instants[:1], in_result=in_result)
            return 1
        try:
            loop.advance(instants[: len(integrals)], in_result=in_result)
        finally:
            loop.rows[first : loop.done, deviations.span] = integrals[: loop.done - first]
        return len(integrals)

    def _is_first_of_piece(self) -> bool:
        """Whether the next step is the first one of a smooth piece, and can be divided for the error estimate."""
        loop = self._loop
        return self._divides and (loop.done == 1 or bool(loop.after_break[loop.done - 1]))

    @property
    def instants(self) -> Vector:
        """Ends of all steps that were made [s], those to breaks and the start time included, shape (points,)."""
        return self._loop.times[: self._loop.done].copy()

    @property
    def result(self) -> Result:
        """The result so far, with all warnings."""
        self._require_state()
        with collected_warnings(instead_of=self._warnings) as last:  # a later result has its own
            result = self.conclude()
        return add_warnings(result, (*self._warnings.texts, *last.texts))

    def divisions_for_contacts(self) -> Vector:
        """Instants [s] that divide steps in which a contact may be missed, or found in vain; sorted, none twice.

        It needs :meth:`recorded_result`; there are none where steps are not to be divided.
        """
        if not self._breaks.divides or self._chooses_steps:
            return np.empty(0)
        return divisions_between(self._estimate.divisions, np.array(self._simulation.times))

    def recorded_result(self, hidden: Vector | None = None) -> Result:
        """The result of all that was recorded so far.

        :param hidden: instants [s] of points that are not in it.
        """
        simulation, loop = self._simulation, self._loop
        if hidden is not None and hidden.size:
            loop.hide(hidden)
        in_result, times = loop.result_rows()
        rows = loop.rows[in_result]
        values = np.ascontiguousarray(rows.T[self._columns])
        names = tuple(simulation.recorded)
        kinds = {n: simulation.parts[p].fmu.variables[v].type for n, (p, v) in simulation.recorded.items()}
        strings = [row for row, name in enumerate(names) if kinds[name] == "String"]
        numbers, indices = np.unique(values[strings], return_inverse=True)
        values[strings] = indices.reshape(values[strings].shape)
        words = tuple(text(number).decode(errors="replace") for number in numbers)
        self._error = self._errors_by_point(in_result)
        columns = {place: rows[:, k] for place, k in self._bus.index.items()}
        self._missing = missing_impulses(self._sums, times, columns)
        for missing in self._missing:
            self._error[missing.points] = np.nan
        return Result(
            simulation.title,
            times,
            names,
            values,
            simulation.units,
            texts={names[row]: words for row in strings},
            jumping=simulation.discrete_signals,
            ports=simulation.renamed_ports,
            coupling_error=self._error,
            scene=simulation.document.scene,
            warnings=simulation.warnings,
        )

    def conclude(self, result: Result | None = None) -> Result:
        """Return the result; warn of not-a-numbers, lost impulses, late steps and large coupling errors.

        :param result: the recorded one, if it is known.
        """
        result = self.recorded_result() if result is None else result
        warn_of_non_finite_values(result)
        warn_of_missing(result.title, result.time, self._missing)
        self._watchdog.warn(self._loop.rows[: self._loop.done], self._loop.times[: self._loop.done])
        if late := [one for one in self.lateness if one > _UNNOTICED_DELAY]:
            words = "%s: %d of %d paced steps end late, by up to %.3g s: choose a smaller pace, or larger steps"
            logger.warning(words, result.title, len(late), len(self.lateness), max(late))
        if self._estimate.worst is not None and not self._missing:
            self._estimate.worst.warn(
                float(np.nansum(self._progress.errors)) if self._progress.errors else self._estimate.total
            )
        for contact, about in self._estimate.doubtful:
            contact.warn(*about)
        return result

    def _errors_by_point(self, in_result: Indices) -> Vector:
        """Coupling error that each point of the result adds to that of the point before, shape (points,)."""
        if self._progress.errors:
            return np.array([0.0, *self._progress.errors])
        loop, sums = self._loop, np.zeros(len(in_result))
        self._estimate.reset()
        points = slice(loop.done)
        errors = self._estimate.estimate(loop.rows[points], loop.times[points], loop.after_break[points])
        if len(in_result) > 1:
            sums[1:] = np.add.reduceat(errors[: in_result[-1] + 1], in_result[:-1] + 1)
        return sums

    def reached(self) -> float | None:
        """The last communication point [s]; None before the first."""
        return self._loop.end if self._loop.done else None

    def _impacts_through(self, ports: list[ImpulsivePort]) -> Impacts | None:
        """Impacts that several FMUs take part in; None if no impulses go through, as in most runs."""
        if not (self._coupled and ports):
            return None
        from liaisons.cosim.running.impacts import Impacts

        return Impacts(self._simulation, ports, self._instances, self._coupled.signals, self._bus)

    def _prepare_calls(self) -> CommunicationCalls:
        """Prepare the calls of the coupling."""
        simulation, instances, bus = self._simulation, self._instances, self._bus
        if not simulation.iterates:
            return communication_calls(simulation, instances, bus)
        from liaisons.cosim.coupling.implicit import Coupled

        self._coupled = coupled = Coupled(simulation, instances, bus)
        recorded_only = [
            instances[name].getter(
                [simulation.parts[name].fmu.variables[v] for _, v in references], bus.view(references)
            )
            for name, references in bus.recorded_only.items()
            if references
        ]
        initial, later = (Call(coupled.solve_at_instant, initial=initial) for initial in (True, False))
        return CommunicationCalls([initial], [later, *recorded_only], [coupled.advance, *recorded_only])


@contextmanager
def _pause_garbage_collection() -> Iterator[None]:
    """Switch garbage collection off: it takes half of the time in which thousands of FMUs are instantiated."""
    looks = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if looks:
            gc.enable()


def start_run(simulation: Simulation) -> Run:
    """Initialize the FMUs of a simulation; returns the run, which the caller closes.

    :raises SimulationError: if an FMU cannot be initialized.
    """
    run = Run(simulation, again=True)
    try:
        run.start()
    except BaseException:
        run.close()
        raise
    return run


def run_to_end(
    simulation: Simulation, *, progress: bool = False, verify: bool = False, real_time: float | None = None
) -> Result:
    """Run a simulation from its start to its end, or until an FMU ends it.

    :param verify: run it once more, at half the steps, and keep the differences in ``errors`` of the result.
    :param real_time: simulated seconds a second of the clock, which is waited for; None: it is not.
    :raises SimulationError: if an FMU cannot be initialized; after that :class:`IncompleteError`, whose ``result`` has
        what was computed until then.
    :raises Interrupted: on Ctrl-C, at the end of the communication step; a ``KeyboardInterrupt`` with ``result``.
    """
    title, start, stop = simulation.title, simulation.times[0], simulation.times[-1]
    failure: SimulationError | KeyboardInterrupt | None = None
    with collected_warnings() as warned, Run(simulation) as run:
        try:
            run.start()
            if real_time is not None:
                run.pace(real_time)
            bar = progress_bar(title if progress else "", "t = {:.6g} of {:.6g} s", start, stop)
            with bar as show, deferred_interrupts() as interrupts:

                def on_progress(time: float) -> None:
                    show(time)
                    run.wait()
                    if interrupts:
                        raise KeyboardInterrupt

                run.finish(on_progress)
            result, instants = (run.conclude(), run.instants) if real_time else _with_contacts_found(simulation, run)
        except EndedError as ended:
            logger.warning("%s of %.10g s", ended, stop)
            result, instants = run.conclude(), run.instants
        except (SimulationError, KeyboardInterrupt) as error:
            if run.reached() is None:
                raise
            failure, result, instants = error, run.conclude(), run.instants
        if verify and failure is None:
            result = _with_differences(simulation, result, instants)
    result = add_warnings(result, warned.texts)
    if isinstance(failure, SimulationError):
        raise IncompleteError(str(failure), result) from failure
    if failure is not None:
        reached = f"{title}: interrupted at t = {run.reached():.10g} of {stop:.10g} s"
        raise Interrupted(f"{reached}; .result of this exception has the result so far", result)
    return result


def _with_contacts_found(simulation: Simulation, run: Run, divisions: Vector | None = None) -> tuple[Result, Vector]:
    """The result of a run, and the ends of its steps [s].

    If a contact may be missed, or found in vain, they are those of another run, in shorter steps there.

    :param divisions: instants [s] by which steps have been divided already, and which are not in the result.
    """
    divisions = np.empty(0) if divisions is None else divisions
    result = run.recorded_result(hidden=divisions)
    times = np.array(simulation.times)
    more = run.divisions_for_contacts()
    if not more.size or len(divisions) + len(more) > _MOST_DIVISIONS * len(times):
        return run.conclude(result), run.instants
    finer = np.union1d(times, more)
    with suppress(SimulationError), Run(replace(simulation, times=finer.tolist())) as again:
        again.start()
        again.finish()
        return _with_contacts_found(replace(simulation, times=finer.tolist()), again, np.union1d(divisions, more))
    return run.conclude(result), run.instants


def _with_differences(simulation: Simulation, result: Result, instants: Vector) -> Result:
    """Simulate again at half the steps; returns the result with the differences as its errors.

    :param instants: ends of the steps [s], breaks included: steps that samples have divided are halved, too.
    """
    sizes = np.diff(instants)
    middles = instants[:-1] + sizes / 2
    times = np.union1d(result.time, middles[sizes > _LONGEST_BREAK_STEP * np.max(sizes, initial=0.0)])
    with Run(replace(simulation, times=times.tolist(), error_tolerance=None, adapts=False)) as run:
        run.start()
        run.finish()
        fine = run.recorded_result()
    return replace(result, errors=np.abs(result.values - fine.values[:, np.searchsorted(times, result.time)]))
