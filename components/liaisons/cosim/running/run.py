"""The run of a simulation: FMUs are made, initialized, stepped, recorded, and released whatever happens."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext, suppress
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_positive, merged_start_values, name_list
from liaisons.base.folders import temporary_folder
from liaisons.base.logs import collected_warnings, deferred_interrupts, logger, progress_bar
from liaisons.base.published import registered
from liaisons.cosim.compiled.calls import Vector
from liaisons.cosim.instances import Instance, extract_fmus, make_instance, try_to_start
from liaisons.cosim.running.kernel import Impulses, Kernel, fmpy_instance
from liaisons.cosim.running.moment import Moment, check_goes_back, state_calls
from liaisons.cosim.running.observers import Observers, RealTime, add_warnings
from liaisons.cosim.running.pace import Stepping
from liaisons.cosim.running.variables import FreeInput, named_values, one_number_each
from liaisons.cosim.structure.components import Components
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import EndedError, SimulationError
from liaisons.results import IncompleteError, Interrupted, Result

if TYPE_CHECKING:
    from liaisons.cosim.running.linearization import Linearization

_MOST_ROUNDS = 20
"""Number of further runs that look for contacts at most; each at least halves the steps in question."""
_MOST_STEPS = 64
"""Number of steps that they make of one at most, on average: where bodies touch all the time, all are halved."""
_LONGEST_BREAK_STEP = 1e-6
"""Longest step to a break, relative to the longest step of a run; such steps are not halved."""


@final
class Run:
    """Running FMUs of a simulation; a context manager that releases them.

    It can start again, with other start values: every FMU returns to the state that it had when it was instantiated, so
    a run gives the same numbers whatever was done before.

    :param folders: folder of each extracted FMU; None: they are extracted for this run only.
    :param again: whether it is to start several times.
    :ivar repeats: whether it can start several times: all FMUs can go back.
    """

    def __init__(
        self, simulation: Simulation, folders: Mapping[Path, Path] | None = None, *, again: bool = False
    ) -> None:
        self.repeats = again and all(part.fmu.can_get_and_set_state for part in simulation.parts.values())
        with ExitStack() as stack, _pause_garbage_collection():
            instances = _load(simulation, folders, stack)
            impulses = _impulses(simulation)
            self._observers = observers = Observers(simulation, impulses)
            self._kernel = kernel = Kernel(simulation, instances, observers.variables)
            observers.prepare(kernel)
            happening = None if impulses is None else impulses.happening(kernel)
            kernel.prepare(observers.watchdog.calls, observers.estimate, happening)
            self._stepping = Stepping(kernel, observers, happening)
            self._closed, self._lost = False, True  # closed; without a state of the FMUs
            saves, self._restores = zip(*state_calls(instances), strict=True) if self.repeats else ((), ())
            kernel.bus.perform(saves)
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

        It can do anything that FMPy offers, except what the run does itself: step, reset, terminate, free.

        :param name: name of the component.
        :raises SimulationError: for an unknown component, and one that runs in a process of its own.
        """
        return fmpy_instance(self._kernel, name)

    def start(self, parts: Components | None = None) -> None:
        """Initialize all FMUs at the start time.

        :param parts: the same with other start values.
        :raises SimulationError: if an FMU refuses something.
        """
        kernel, estimate, self._lost = self._kernel, self._observers.estimate, True
        last = () if estimate is None else estimate.initial_calls  # which read what it needs
        kernel.start(parts or kernel.simulation.parts, self._restores, last, self._stepping.happening)
        self._observers.clock = None
        if self.repeats:
            self._kernel.variables.restore({})  # no input is as it was set before
        self._lost = False

    def finish(self, on_progress: Callable[[float], None] | None = None) -> None:
        """Simulate to the end.

        :param on_progress: is called from time to time with the time that was reached [s].
        :raises SimulationError: if an FMU refuses something.
        """
        self._stepping.finish(on_progress)

    @property
    def time(self) -> float:
        """The communication point that was reached last [s]."""
        self._require_state()
        return self._kernel.recorder.time

    def step(self, inputs: Mapping[str, ArrayLike] | None = None, /, **keywords: ArrayLike) -> None:
        """Step to the next communication point.

        :param inputs: values of inputs that nothing feeds, which they keep until they are set again; of a system by
            ``"component.input"``.
        :param keywords: further ones.
        :raises SimulationError: for an unknown input, one that has a source, a value that it cannot have, and a run
            that is closed or at its end; :class:`IncompleteError`, with the result so far, if an FMU refuses the step.
        """
        values = named_values(inputs, keywords)
        self._require_open()
        self._set_and_step([self._kernel.variables.free_input(name) for name in values], values.values())

    def stepper(self, inputs: Sequence[str], outputs: Sequence[str]) -> Callable[[ArrayLike], Vector]:
        """Prepare a step as a function of an array.

        :param inputs: names of scalars, as in :meth:`step`.
        :param outputs: names of scalars that are recorded or connected.
        :returns: function of the inputs, shape (inputs,), that steps and returns the outputs, shape (outputs,).
        :raises SimulationError: for a name that is none of these; the function raises what :meth:`step` does.
        """
        inputs, outputs = name_list("inputs", inputs), name_list("outputs", outputs)
        self._require_open()
        variables = self._kernel.variables
        free, columns = [variables.free_input(name) for name in inputs], variables.columns(outputs)
        title, bus = self._kernel.simulation.title, self._kernel.bus

        def step(values: ArrayLike) -> Vector:
            self._set_and_step(free, one_number_each(title, inputs, values))
            return bus.values[columns]

        return step

    def _set_and_step(self, free: Sequence[FreeInput], values: Collection[ArrayLike]) -> None:
        """Set inputs whose values have changed, and step to the next communication point."""
        self._require_open()
        changed = self._stepping.changed_inputs(free, values)
        try:
            self._stepping.step(changed)
        except SimulationError as error:
            raise IncompleteError(str(error), self.result) from error
        self.wait()

    def __getitem__(self, name: str) -> Any:
        """A value at the present time, whether it is recorded or not; of an array, all of them.

        :raises SimulationError: for an unknown name, and after the run was closed.
        """
        self._require_open()
        return self._kernel.variables.read(name)

    def pace(self, factor: float = 1.0) -> None:
        """From now on, wait after each step until the clock has advanced as much as the run.

        :param factor: simulated seconds per second.
        :raises SimulationError: unless it is positive.
        """
        check_positive("pace", factor)
        self._observers.clock = RealTime(factor, self.time, self.lateness)

    @property
    def lateness(self) -> list[float]:
        """How late each paced step ended [s]; 0 if it was in time."""
        return [] if self._observers.clock is None else self._observers.clock.lateness

    def wait(self) -> None:
        """Wait for the clock, if there is a pace; append to ``lateness`` how late the step ended [s]."""
        if self._observers.clock is not None:
            self._observers.clock.wait(self.time)

    def save(self) -> Moment:
        """Save the present state, to which the run can return any number of times.

        :raises SimulationError: if an FMU cannot return to a state.
        """
        self._require_open()
        check_goes_back(self._kernel.simulation)
        return self._kernel.moments.save(self.time)

    def restore(self, state: Moment) -> None:
        """Return to a saved state, with the points that were recorded until then.

        :raises SimulationError: for the state of another run.
        """
        self._require_open(state=False)
        self._kernel.moments.check(self._kernel.simulation.title, state)
        self._lost = True
        self._kernel.moments.restore(state)
        self._lost = False

    def reset(self, start_values: Mapping[str, ArrayLike] | None = None, /, **keywords: ArrayLike) -> None:
        """Begin again at the start time, without instantiating the FMUs again.

        After an error the run is in the state that it had before, if the FMUs can return to it; otherwise it has no
        state.

        :param start_values: where they differ from those that the run was made with; of a system by
            ``"component.variable"``.
        :param keywords: further ones.
        :raises SimulationError: for an unknown name, a value that cannot be set, or an FMU that cannot go back.
        """
        document = self._kernel.simulation.document
        starts = merged_start_values(document.name, start_values, keywords)
        self._require_open(state=False)
        check_goes_back(self._kernel.simulation)
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
        """The linear system of deviations from the present point; its outputs are those that are recorded.

        Its inputs are inputs without a source, inputs that functions of time feed, and the outputs of sampled
        components, which are constant between samples.

        :raises SimulationError: for an FMU that provides no directional derivatives.
        """
        self._require_open()
        kernel, (linearization_of_run,) = self._kernel, registered("liaisons.linearization")
        return linearization_of_run(kernel.simulation, kernel.instances, self.time, kernel.variables.recorded())

    @property
    def instants(self) -> Vector:
        """Ends of all steps that were made [s], those to breaks and the start time included, shape (points,)."""
        return self._kernel.recorder.times[: self._kernel.recorder.done].copy()

    @property
    def result(self) -> Result:
        """The result so far, with all warnings."""
        self._require_state()
        with collected_warnings(instead_of=self._warnings) as last:  # a later result has its own
            result = self.conclude()
        return add_warnings(result, (*self._warnings.texts, *last.texts))

    def recorded_result(self) -> Result:
        """The result of all that was recorded so far."""
        return self._observers.recorded_result(self._kernel)[0]

    def conclude_or_divide(self, hidden: Vector) -> Result | Vector:
        """The result without points at some instants [s], or instants that divide steps where contacts are doubtful."""
        return self._stepping.conclude_or_divide(hidden)

    def conclude(self) -> Result:
        """Return the result; warn of not-a-numbers, lost impulses, late steps and large coupling errors."""
        return self._observers.conclude(self._kernel)

    def reached(self) -> float | None:
        """The last communication point [s]; None before the first."""
        return self._kernel.recorder.end if self._kernel.recorder.done else None

    def _require_state(self) -> None:
        if self._lost:
            self._refuse("it has no state, since a start was refused: reset it again")

    def _require_open(self, *, state: bool = True) -> None:
        if self._closed:
            self._refuse("the run is closed; start another one")
        if state:
            self._require_state()

    def __reduce__(self) -> NoReturn:
        self._refuse("a run has FMUs in memory, and cannot be copied or pickled; pickle its result")

    def _refuse(self, words: str) -> NoReturn:
        raise SimulationError(f"{self._kernel.simulation.title}: {words}")


def _impulses(simulation: Simulation) -> Impulses | None:
    """Impulses that go through connections; None without any."""
    if not (simulation.iterates and simulation.impulses):
        return None
    (impulses_through,) = registered("liaisons.impacts")
    return impulses_through(simulation)


def _load(simulation: Simulation, folders: Mapping[Path, Path] | None, stack: ExitStack) -> dict[str, Instance]:
    """Instantiate all FMUs, which the stack releases."""
    parts, instances = simulation.parts, dict[str, Instance]()
    if folders is None:
        fmus = map(attrgetter("fmu"), parts.values())
        folders = extract_fmus(fmus, stack.enter_context(temporary_folder()))
    for name, part in parts.items():
        folder = folders.get(part.fmu.path, Path())
        if not part.isolated and part.fmu.function is None:
            try_to_start(part, folder, simulation.times)
        updates = simulation.iterates and part.approximation.interface == "intermediate update"
        instance = make_instance(name, part.fmu, folder, requests_intermediate_update=updates, isolated=part.isolated)
        stack.callback(instance.close)
        instances[name] = instance
    return instances


@contextmanager
def _pause_garbage_collection() -> Iterator[None]:
    """Switch off garbage collection, which takes half of the time when thousands of FMUs are instantiated."""
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
    :param real_time: simulated seconds per second of the clock, for which the run waits; None: it does not wait.
    :raises SimulationError: if an FMU cannot be initialized; after that :class:`IncompleteError`, whose ``result`` has
        what was computed until then.
    :raises Interrupted: on Ctrl-C, at the end of the communication step; a ``KeyboardInterrupt`` with ``result``.
    """
    title, start, stop = simulation.title, simulation.times[0], simulation.times[-1]
    failure: SimulationError | KeyboardInterrupt | None = None
    with collected_warnings() as warned, closing(Run(simulation)) as run:
        try:
            run.start()
            if real_time is not None:
                run.pace(real_time)
            bar = progress_bar(title, "t = {:.6g} of {:.6g} s", start, stop) if progress else nullcontext()
            _finish(run, bar, paced=real_time is not None)
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


def _finish(run: Run, bar: AbstractContextManager[Callable[[float], None] | None], *, paced: bool) -> None:
    """Simulate to the end; show the progress, wait for the clock if the run is paced, and end at an interrupt.

    :param bar: function that shows the progress; None: nothing is shown.
    """
    with bar as show, deferred_interrupts() as interrupts:

        def on_progress(time: float) -> None:
            if show is not None:
                show(time)
            if paced:
                run.wait()
            if interrupts:
                raise KeyboardInterrupt

        run.finish(on_progress)


def _with_contacts_found(
    simulation: Simulation,
    run: Run,
    divisions: Vector | None = None,
    rounds: int = _MOST_ROUNDS,
    most: float = math.inf,
) -> tuple[Result, Vector]:
    """The result of a run, and the ends of its steps [s].

    If a contact may be missed or falsely found, they are those of another run, in shorter steps there.

    :param divisions: instants [s] by which steps have been divided already, and which are not in the result.
    :param rounds: number of further runs at most, after which a warning names what may be missed.
    :param most: number of their steps at most.
    """
    divisions = np.empty(0) if divisions is None else divisions
    result = run.conclude_or_divide(divisions)
    if isinstance(result, Result):
        return result, run.instants
    most = min(most, _MOST_STEPS * len(run.instants))
    if rounds == 0 or len(run.instants) + len(result) > most:
        return run.conclude(), run.instants
    finer = replace(simulation, times=np.union1d(simulation.times, result).tolist())
    with suppress(SimulationError), Run(finer) as again:
        again.start()
        again.finish()
        return _with_contacts_found(finer, again, np.union1d(divisions, result), rounds - 1, most)
    return run.conclude(), run.instants


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
