"""The run of a simulation: FMUs are made, initialized, stepped, recorded, and released whatever happens.

All connected and recorded numbers lie in one array, the *bus*.  FMUs read into it and are set from it, each by one
prepared call for all its variables, and a row of the recording is one copy of it.  The loop over the communication
points, :mod:`liaisons.cosim.running.loop`, makes no list and looks nothing up, so that a step costs little more than
the bare calls.
"""

from __future__ import annotations

import gc
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any, final

import numpy as np

from liaisons.base.folders import passing_folder
from liaisons.base.interrupts import deferred_interrupts
from liaisons.base.progress import progress_bar
from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling import explicit
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.implicit import Coupled
from liaisons.cosim.coupling.signals import port_outputs
from liaisons.cosim.instances import Instance, extracted, make
from liaisons.cosim.instances.protocol import Loaded
from liaisons.cosim.instances.texts import text
from liaisons.cosim.messages import collect_warnings, logger, warn_of_non_finite_values
from liaisons.cosim.running.adaptive import Stepper, adapt_steps, divide_steps, unit_numbers
from liaisons.cosim.running.breaks import Breaks, gap
from liaisons.cosim.running.contacts import missing_impulses, sums_of_missing, warn_of_missing
from liaisons.cosim.running.deviations import Deviations
from liaisons.cosim.running.estimate import Estimate
from liaisons.cosim.running.input_reconstruction import (
    contact_mechanisms,
    contacts_of_fed,
    initial_derivatives,
    input_reconstructions,
)
from liaisons.cosim.running.loop import Loop
from liaisons.cosim.running.trial import try_to_start
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.components import Components
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS, rounding
from liaisons.errors import EndedError, SimulationError, suggestion
from liaisons.results import IncompleteError, Interrupted, Result

_PORTION = 0.02  # [s] between two calls of on_progress, about
_MOST_IN_BATCH = 256
"""Most steps for which functions of time are evaluated at once."""


@final
class Run:
    """Running FMUs of a simulation; a context manager that releases them.

    It can be done again, with other start values: every FMU goes back to the state that it had when it was
    instantiated, so that a run gives the same numbers whatever was before it.

    :param folders: where each FMU lies extracted; if None, they are extracted for this run only.
    :param again: it will be done again; where an FMU cannot go back, ``repeats`` says so.
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
                folders = extracted((part.fmu for part in parts.values()), stack.enter_context(passing_folder()))
            for name, part in parts.items():
                folder = folders[part.fmu.path]
                if not part.isolated:
                    try_to_start(part, folder, times)
                instance = make(
                    name,
                    part.fmu,
                    folder,
                    requests_intermediate_update=simulation.iterates
                    and part.approximation.interface == "intermediate update",
                    isolated=part.isolated,
                    stiff=part.solver is not None,
                )
                self._instances[name] = stack.enter_context(instance)
            also = port_outputs(parts, simulation.feeds) if simulation.iterates else []
            order = schedule.execution_order([SIGNALS, *parts], simulation.feeds)
            self._sums = sums_of_missing(simulation)
            contacts = [v for several in contacts_of_fed(simulation).values() for one in several for v in one]
            recorded = [*simulation.recorded.values(), *self._sums, *contacts]
            self._bus = Bus(order, simulation.feeds, also, recorded, simulation.conversions)
            self._columns = [self._bus.index[reference] for reference in simulation.recorded.values()]
            self._initial, self._settle, self._step = self._prepare_calls()
            self._deviations = Deviations(simulation.drives, self._bus, simulation.step_tolerance)
            self._batch = 1  # steps for which functions of time are evaluated at once
            self._initial_derivatives, self._estimate = self._prepare_estimate()
            self._breaks = Breaks(simulation, self._instances, self._bus)
            reads_samples = any(parts[name].approximation.samples for name, _ in simulation.feeds if name in parts)
            self._divides = self._breaks.divides and self._estimate.has_targets and not reads_samples
            self._loop = Loop(self._step, self._bus, len(times))
            self._restores: Sequence[Call] = []
            if self.repeats:
                saves, self._restores = zip(*(instance.states() for instance in self._instances.values()), strict=True)
                self._bus.perform(saves)
            self._stack = stack.pop_all()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the FMUs."""
        self._stack.close()

    def fmu(self, name: str) -> Any:
        """The object of FMPy that is an FMU: ``FMU2Slave``, ``FMU2Model``, ``FMU3Slave`` or ``FMU3Model``.

        All that FMPy can do with it may be done, but for what the run does: to step, reset, terminate and free it.

        :param name: name of the component.
        :raises SimulationError: for an unknown component, and one that runs in a process of its own.
        """
        instance = self._instances.get(name)
        if instance is None:
            words = f"has no component {name!r}{suggestion(name, self._instances)}"
        elif not isinstance(instance, Loaded):
            words = f"{name} runs in a process of its own, where FMPy's object is; leave out isolated"
        else:
            return instance.fmpy_instance
        raise SimulationError(f"{self._simulation.title}: {words}")

    def start(self, parts: Components | None = None) -> None:
        """Initialize all FMUs at the start time.

        :param parts: the same with other start values.
        :raises SimulationError: if an FMU refuses something.
        """
        simulation, bus = self._simulation, self._bus
        begin, end = simulation.times[0], simulation.times[-1]
        self._loop.reset()
        self._errors: list[float] = []  # of steps between communication points
        for instance in self._instances.values():
            instance.reset()
        bus.set_step(begin, begin)
        self._breaks.begin_piece(begin)
        self._deviations.reset()
        bus.perform(self._restores)
        bus.values[:] = 0.0
        if self._coupled is not None:
            self._coupled.reset()
        parts = simulation.parts if parts is None else parts
        for name, instance in self._instances.items():
            instance.initialize(parts[name].starts, simulation.tolerance, begin, end)
        bus.perform(self._initial)
        for instance in self._instances.values():
            instance.exit_initialization()
        bus.perform(self._settle)
        bus.perform(self._initial_derivatives)
        self._loop.add(begin, bus.values, result_time=begin)
        self._breaks.find_next(begin)

    def finish(self, on_progress: Callable[[float], None] | None = None) -> None:
        """Simulate to the end, from the start.

        :param on_progress: called now and then with the time that is reached [s].
        :raises SimulationError: if an FMU refuses something.
        """
        simulation = self._simulation
        if simulation.error_tolerance is None and not simulation.adapts:
            self._step_to(simulation.times, on_progress)
            return
        stepper = Stepper(
            simulation,
            self._instances,
            self._bus,
            self._step,
            self._coupled,
            self._breaks,
            self._deviations,
            self._cross_break,
        )
        self._estimate.reset()
        points = (divide_steps if simulation.adapts else adapt_steps)(stepper, self._estimate)
        for point in points:  # steps as long as their error allows
            self._loop.add(point.time, point.values, result_time=point.result_time, after_break=point.after_break)
            if point.error is not None:
                self._errors.append(point.error)
            if on_progress:
                on_progress(point.time)

    def _step_to(self, points: Sequence[float], on_progress: Callable[[float], None] | None) -> None:
        """Step to each of the communication points, and to the breaks between them."""
        loop, breaks, done = self._loop, self._breaks, 1
        most = _MOST_IN_BATCH if self._deviations else len(points)
        many = 1 if on_progress or self._deviations else most  # points between two calls of on_progress
        while done < len(points):
            begin, time = perf_counter(), float(loop.times[loop.done - 1])
            size = points[done] - points[done - 1]
            near = rounding(breaks.next) if breaks.next < np.inf else 0.0
            free = bisect_left(points, breaks.next - near, done)
            if done < free:  # points before the next break
                last = min(done + many, free)
                if self._is_first_of_piece() and free == done + 1:
                    self._advance([(time + points[done]) / 2], in_result=False)
                else:
                    done += self._advance(points[done:last])
            elif breaks.next - time > 2 * (tiny := gap(breaks.next, size)):
                stop = breaks.next - tiny
                self._advance([(time + stop) / 2, stop] if self._is_first_of_piece() else [stop], in_result=False)
            else:
                instant, result_time = breaks.next, None
                if points[done] - instant <= near:
                    instant, result_time = max(instant, points[done]), points[done]
                    done += 1
                loop.add(instant, self._cross_break(time, instant), result_time=result_time, after_break=True)
            many = min(most, max(1, 2 * many if perf_counter() - begin < _PORTION else many // 2))
            if on_progress:
                on_progress(float(loop.times[loop.done - 1]))

    def _advance(self, instants: Sequence[float], *, in_result: bool = True) -> int:
        """Step to these instants up to the next break; returns how many were reached."""
        loop, deviations = self._loop, self._deviations
        if not deviations:
            loop.advance(instants, in_result=in_result)
            return len(instants)
        first, time = loop.done, float(loop.times[loop.done - 1])
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
        """Whether the next step is the first one of a piece: a piece of one step has no error estimate."""
        loop = self._loop
        return self._divides and loop.done - 1 == (loop.after_break[-1] if loop.after_break else 0)

    def _cross_break(self, start: float, stop: float) -> Vector:
        """Step across a break and find the next one; returns the values of the bus."""
        bus, coupled = self._bus, self._coupled
        bus.set_step(start, stop)
        self._breaks.begin_piece(stop)
        if coupled is None:
            bus.perform(self._step)
        else:
            coupled.cross_break()
            bus.perform(self._step[1:])
        self._breaks.find_next(stop)
        return bus.values

    def result(self) -> Result:
        """The result of all that was recorded so far."""
        simulation, loop = self._simulation, self._loop
        in_result, times = loop.result_rows()
        rows = loop.rows[in_result]
        values = np.ascontiguousarray(rows.T[self._columns])
        names = tuple(simulation.recorded)
        kinds = {n: simulation.parts[p].fmu.variables[v].type for n, (p, v) in simulation.recorded.items()}
        strings = [row for row, name in enumerate(names) if kinds[name] == "String"]
        numbers, indices = np.unique(values[strings], return_inverse=True)
        values[strings] = indices.reshape(values[strings].shape)
        words = tuple(text(number).decode(errors="replace") for number in numbers)
        self._error = self._errors_between(in_result)
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
            jumping=simulation.jumping,
            ports=simulation.ports,
            coupling_error=self._error,
            scene=simulation.scene,
            warnings=simulation.warnings,
        )

    def concluded(self) -> Result:
        """Warn of values that are not finite, lost impulses and large coupling errors; returns the result."""
        result = self.result()
        warn_of_non_finite_values(result)
        warn_of_missing(result.title, result.time, self._missing)
        if self._estimate.worst is not None and not self._missing:
            self._estimate.worst.warn(float(np.nansum(self._error)))
        return result

    def _errors_between(self, in_result: Indices) -> Vector:
        """Coupling error added between neighbouring points of the result, shape (points,)."""
        if self._errors:
            return np.array([0.0, *self._errors])
        loop, sums = self._loop, np.zeros(len(in_result))
        self._estimate.reset()
        errors = self._estimate(loop.rows[: loop.done], loop.times[: loop.done], loop.after_break)
        if len(in_result) > 1:
            sums[1:] = np.add.reduceat(errors[: in_result[-1] + 1], in_result[:-1] + 1)
        return sums

    def reached(self) -> float | None:
        """The last communication point [s]; None before the first."""
        return float(self._loop.times[self._loop.done - 1]) if self._loop.done else None

    def _prepare_calls(self) -> tuple[list[Call], list[Call], list[Call]]:
        """Prepare the coupling; returns the calls of initialization, after it, and of a communication step."""
        if not self._simulation.iterates:
            return explicit.prepared_calls(self._simulation, self._instances, self._bus)
        self._coupled = coupled = Coupled(self._simulation, self._instances, self._bus)
        recorded_only = [call for name in self._instances for call in self._read_recorded_only(name)]
        settle, first = Call(coupled.settle, initial=False), Call(coupled.settle, initial=True)
        return [first], [settle, *recorded_only], [coupled.advance, *recorded_only]

    def _prepare_estimate(self) -> tuple[list[Call], Estimate]:
        """Prepare the estimate of coupling errors; returns the calls for it at the start, too."""
        simulation, bus, coupled = self._simulation, self._bus, self._coupled
        gains = {} if coupled is None else coupled.gains
        calls, initial_gains = initial_derivatives(simulation, self._instances, bus, gains)
        slopes = {} if coupled is None else coupled.slopes
        inputs = input_reconstructions(simulation, bus, slopes, {**gains, **initial_gains}, self._deviations.columns)
        return calls, Estimate(inputs, bus.index, unit_numbers(simulation, bus), contact_mechanisms(simulation, bus))

    def _read_recorded_only(self, name: str) -> list[Call]:
        places = self._bus.recorded_only(name)
        variables = self._simulation.parts[name].fmu.variables
        read = [variables[variable] for _, variable in places]
        return [self._instances[name].getter(read, self._bus.view(places))] if places else []


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


def started(simulation: Simulation) -> Run:
    """A run at its start time, to be closed.

    :raises SimulationError: if an FMU cannot be initialized.
    """
    with ExitStack() as stack:
        run = stack.enter_context(Run(simulation))
        run.start()
        stack.pop_all()
    return run


@collect_warnings
def performed(simulation: Simulation, *, progress: bool = False, verify: bool = False) -> Result:
    """Run a simulation from its start to its end, or until an FMU ends it.

    :param verify: run it once more, at half the steps, and keep the differences in ``errors`` of the result.
    :raises SimulationError: if an FMU cannot be initialized; after that :class:`IncompleteError`, whose ``result`` has
        what was computed until then.
    :raises Interrupted: on Ctrl-C, at the end of the communication step; a ``KeyboardInterrupt`` with ``result``.
    """
    title, span = simulation.title if progress else "", (simulation.times[0], simulation.times[-1])
    with Run(simulation) as run:
        try:
            run.start()
            with progress_bar(title, "t = {:.6g} of {:.6g} s", *span) as show, deferred_interrupts() as interrupts:

                def on_progress(time: float) -> None:
                    show(time)
                    if interrupts:
                        raise KeyboardInterrupt

                run.finish(on_progress)
        except EndedError as ended:
            logger.warning("%s of %.10g s", ended, simulation.times[-1])
        except (SimulationError, KeyboardInterrupt) as error:
            time = run.reached()
            if time is None:
                raise
            if isinstance(error, SimulationError):
                raise IncompleteError(str(error), run.concluded()) from error
            reached = f"{simulation.title}: interrupted at t = {time:.10g} of {simulation.times[-1]:.10g} s"
            raise Interrupted(f"{reached}; .result of this exception has the result so far", run.concluded()) from None
        result = run.concluded()
        return _with_differences(simulation, result) if verify else result


def _with_differences(simulation: Simulation, result: Result) -> Result:
    """Simulate once more at half the steps; returns the result with the differences as its errors."""
    middles = (result.time[:-1] + result.time[1:]) / 2
    times = np.insert(result.time, np.arange(1, len(result.time)), middles)
    with Run(replace(simulation, times=times.tolist(), error_tolerance=None, adapts=False)) as run:
        run.start()
        run.finish()
        fine = run.result()
    return replace(result, errors=np.abs(result.values - fine.values[:, ::2]))
