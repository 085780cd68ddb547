"""The loop over time of a run, and how far its steps go.

They go to the points of the user, as far as the error of each allows, or by equal parts between points.
The estimate (:mod:`liaisons.coupling_estimate`) compares a step with the points before it, and costs no step.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from time import perf_counter
from typing import NamedTuple, NoReturn, Protocol, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.logs import logger
from liaisons.cosim.compiled.calls import Call, Vector
from liaisons.cosim.running.kernel import CouplingEstimate, Happening, Kernel
from liaisons.cosim.running.observers import Observers
from liaisons.cosim.running.variables import FreeInput
from liaisons.errors import EndedError, RefusedError, SimulationError
from liaisons.results import Result

_PROGRESS_INTERVAL = 0.02
"""Time between two reports of progress, about [s]."""
_MOST_IN_BATCH = 256
"""Number of steps for which functions of time are evaluated at once, at most."""
_SAFETY = 0.9
"""Factor of the step size that the estimate suggests (Hairer, Norsett, Wanner, Solving ODEs I, II.4)."""
_SMALLEST_FACTOR = 0.2
"""Smallest ratio of a step size to the one before."""
_LARGEST_FACTOR = 4.0
"""Largest ratio of a step size to the one before."""
_FIRST = 4
"""Number of steps between two communication points that is tried first."""
_MOST = 1000
"""Largest number of steps between two communication points."""
_MEMORY = 5
"""Number of points that are kept for the estimate."""
_SHORTEST = 1e-12
"""Shortest step, relative to the whole time."""
_MOST_DIVISIONS = 20
"""Number of instants that divide steps for contacts at most, for each communication point."""
_BRINK = 1e-6
"""Distance to the end of a refused step, relative to the whole time, below which no shorter step is tried."""


class NextSteps(NamedTuple):
    """Steps that are made next.

    :param ends: their ends [s]; none if the next step crosses a break.
    :param target: instant to which they lead [s].
    :param in_result: whether what they reach is in the result.
    """

    ends: Sequence[float]
    target: float
    in_result: bool = True


class Pace(Protocol):
    """How far steps go."""

    def next_steps(self) -> NextSteps | None:
        """The next steps up to a break; None at the end."""
        ...

    def crossed(self, at_target: bool) -> None:
        """Hear that a break was crossed."""
        ...

    def make(self, steps: NextSteps) -> None:
        """Make steps, and keep them or return to the state before.

        :raises RefusedError: if an FMU refuses a step, and none that the pace may choose instead is short enough.
        """
        ...


def drive(kernel: Kernel, pace: Pace) -> Iterator[float]:
    """Step as a pace says, over breaks; yields instants that are reached [s]."""
    while (steps := pace.next_steps()) is not None:
        if steps.ends:
            pace.make(steps)
        else:
            pace.crossed(kernel.cross_next_break(steps.target, in_result=steps.in_result))
        yield kernel.recorder.end


@final
class Points:
    """Steps to communication points, many at once.

    :param happening: what happens within steps; None: nothing does.
    :param stop: number of points to be reached.
    :param most: largest number of points between two reports of progress.
    :param reports: whether there are any.
    """

    def __init__(self, kernel: Kernel, happening: Happening | None, stop: int, *, most: int, reports: bool) -> None:
        self._kernel, self._stop = kernel, stop
        self._advance = kernel.advance if happening is None else happening.advance
        self._most = min(most, _MOST_IN_BATCH) if kernel.deviations else most
        self._many = 1 if reports or kernel.deviations else self._most
        self._steps: NextSteps | None = None  # those that were not reached
        self._is_sample, self._begin = False, 0.0

    def next_steps(self) -> NextSteps | None:
        """The next points up to a break, or one step shortly before it; again, if something came between."""
        kernel, points, done = self._kernel, self._kernel.simulation.times, self._kernel.progress.points
        if done >= self._stop:
            return None
        self._begin = perf_counter()
        timeline, now, target = kernel.timeline, kernel.recorder.end, points[done]
        if self._steps is not None and timeline.ends_before(now, self._steps.ends[:1], 0.0) == self._steps.ends[:1]:
            return self._steps
        last = min(done + self._many, self._stop)
        ends = points[done : min(last + 1, len(points))]
        before = timeline.ends_before(now, ends, target - points[done - 1])
        are_points, self._is_sample = bool(before) and before[0] == target, False
        if kernel.are_samples and not are_points:
            are_points, self._is_sample = timeline.is_next(target), True
            before = [target if are_points else timeline.next]
        elif len(before) == 1 and kernel.halves_first_step:
            before, are_points = [(now + before[0]) / 2], False
        self._steps = NextSteps(before[: last - done], target, are_points)
        return self._steps

    def crossed(self, at_target: bool) -> None:
        """Count the point at a break."""
        self._count(int(at_target))

    def make(self, steps: NextSteps) -> None:
        """Make steps, up to what comes between, and count the points that were reached."""
        count = self._advance(steps.ends, in_result=steps.in_result)
        if count == 0:
            self._adapt_batch()
            return
        self._count(count if steps.in_result else 0)
        if self._is_sample:
            self._kernel.timeline.find_next(self._kernel.recorder.end)

    def _count(self, points: int) -> None:
        self._kernel.progress.points += points
        self._steps = None
        self._adapt_batch()

    def _adapt_batch(self) -> None:
        is_fast = perf_counter() - self._begin < _PROGRESS_INTERVAL
        self._many = min(self._most, max(1, 2 * self._many if is_fast else self._many // 2))


class _ByErrors(ABC):
    """Steps that are kept if the estimate of their errors allows; without one all are."""

    def __init__(self, kernel: Kernel, estimate: CouplingEstimate | None) -> None:
        self._kernel, self._estimate = kernel, estimate
        if estimate is not None:
            estimate.reset()
        self._begin_piece()

    def _begin_piece(self) -> None:
        """Keep the present point alone."""
        recorder = self._kernel.recorder
        self._times, self._rows = np.array([recorder.end]), recorder.rows[recorder.done - 1 : recorder.done].copy()

    def _end_before_break(self, end: float, size: float) -> Sequence[float]:
        """End of a step [s]: its own end, or an instant shortly before a break; none if it crosses the break."""
        timeline, deviations, now = self._kernel.timeline, self._kernel.deviations, self._kernel.recorder.end
        ends = timeline.ends_before(now, [end], size)
        while deviations and ends and (instant := deviations.integrate(now, ends[0])) < math.inf:
            timeline.next = instant
            ends = timeline.ends_before(now, [end], size)
        return ends

    def _parts(self, stop: float, count: int) -> list[float]:
        """Ends of equal steps to an instant [s]."""
        now = self._kernel.recorder.end
        return [*(now + (stop - now) * k / count for k in range(1, count)), stop]

    def _errors(self, count: int) -> tuple[float, Vector, Vector]:
        """Sum of the errors of the last steps, and the last points with those before them."""
        recorder = self._kernel.recorder
        last = slice(recorder.done - count, recorder.done)
        times = np.concatenate([self._times, recorder.times[last]])
        rows = np.concatenate([self._rows, recorder.rows[last]])
        errors = 0.0 if self._estimate is None else self._estimate.estimate_last(rows, times, count)
        return float(np.sum(errors)), times, rows

    def _keep(self, times: Vector, rows: Vector) -> None:
        self._times, self._rows = times[-_MEMORY:], rows[-_MEMORY:]

    def make(self, steps: NextSteps) -> None:
        """Make steps, and keep them or return to the state before."""
        before = self._kernel.save()
        if not self._accepts(steps, self._kernel.attempt(steps.ends)):
            self._kernel.moments.restore(before)

    @abstractmethod
    def _accepts(self, steps: NextSteps, refusal: RefusedError | None) -> bool:
        """Whether steps are kept; else shorter ones are made from the same state.

        :param refusal: why they were refused, if they were.
        :raises RefusedError: if none is short enough.
        """


@final
class EachStep(_ByErrors):
    """Steps of a size that keeps the error of each below the tolerance."""

    def __init__(self, kernel: Kernel, estimate: CouplingEstimate | None) -> None:
        super().__init__(kernel, estimate)
        start, first, self._end = kernel.simulation.times
        self._size, self._whole = min(first - start, self._end - start), self._end - start
        # where steps begin to be refused, and a refused end
        self._since, self._beyond, self._reason = start, math.inf, RefusedError("")

    def next_steps(self) -> NextSteps | None:
        """A step, or two at the start of a piece, since one alone has no estimate."""
        now, end, size = self._kernel.recorder.end, self._end, self._size
        if now >= end:
            return None
        self._target = end if end - now <= size * (1 + 1e-9) else now + size
        ends = self._end_before_break(self._target, size)
        count = 2 if len(self._times) == 1 and self._estimate is not None else 1
        return NextSteps(self._parts(ends[0], count) if ends else ends, end)

    def crossed(self, at_target: bool) -> None:  # noqa: ARG002 - each break is in the result
        """Begin a piece."""
        self._begin_piece()

    def _accepts(self, steps: NextSteps, refusal: RefusedError | None) -> bool:
        """Whether their error is below the tolerance; chooses the size of the next step."""
        now, stop, count = float(self._times[-1]), steps.ends[-1], len(steps.ends)
        tolerance, power = self._kernel.simulation.error_tolerance or 1.0, self._kernel.error_order + 1
        error, times, rows = (math.inf, self._times, self._rows) if refusal else self._errors(count)
        error /= tolerance
        factor = min(max(_SAFETY * max(error, 1e-10) ** (-1 / power), _SMALLEST_FACTOR), _LARGEST_FACTOR)
        is_cut = stop < self._target
        self._size = max((stop - now) / count * factor, self._size if error <= 1 and is_cut else 0.0)
        if error <= 1:
            recorder = self._kernel.recorder
            shown = count if stop == self._target else count - 1
            first = recorder.done - count
            recorder.result_times[first : first + shown] = recorder.times[first : first + shown]
            self._keep(times, rows)
            return True
        if refusal is not None:
            self._look_for_brink(now, stop, refusal)
        if self._size <= _SHORTEST * self._whole:
            why = refusal or f"the error of a step of {stop - now:.3g} s is {error:.3g} times error_tolerance"
            raise RefusedError(f"no step from t = {now:.10g} s is small enough: {why}")
        return False

    def _look_for_brink(self, now: float, stop: float, refusal: RefusedError) -> None:
        """Raise the first refusal where steps only come nearer to an instant."""
        if not now < self._beyond < math.inf:
            self._since, self._reason = now, refusal
        self._beyond = min(stop, self._beyond) if now < self._beyond else stop
        if self._since < now and self._beyond - now < _BRINK * self._whole:
            raise RefusedError(f"no step from t = {now:.10g} s is small enough: {self._reason}")


@final
class EqualParts(_ByErrors):
    """Equal steps between communication points, as many as keep the sum of their errors below the tolerance."""

    def __init__(self, kernel: Kernel, estimate: CouplingEstimate | None) -> None:
        super().__init__(kernel, estimate)
        self._count, self._error = _FIRST, 0.0  # number of steps, and their error since the last point

    def next_steps(self) -> NextSteps | None:
        """Steps to the next point, at least two where a piece begins, since one alone has no estimate."""
        points, done = self._kernel.simulation.times, self._kernel.progress.points
        if done == len(points):
            return None
        ends = self._end_before_break(points[done], points[done] - points[done - 1])
        if len(self._times) == 1:
            self._count = max(self._count, 2)
        return NextSteps(self._parts(ends[0], self._count) if ends else ends, points[done], in_result=False)

    def crossed(self, at_target: bool) -> None:
        """Begin a piece."""
        self._count = max(self._count, _FIRST)
        self._begin_piece()
        if at_target:
            self._reach_point()

    def _reach_point(self) -> None:
        progress = self._kernel.progress
        progress.points += 1
        progress.errors.append(self._error)
        self._error = 0.0

    def _accepts(self, steps: NextSteps, refusal: RefusedError | None) -> bool:
        """Whether the sum of their errors is small enough; chooses the number of the next ones."""
        simulation, recorder, many = self._kernel.simulation, self._kernel.recorder, self._count
        if refusal is not None and many > _MOST:
            raise refusal
        error, times, rows = (math.inf, self._times, self._rows) if refusal else self._errors(many)
        factor = (max(error, 1e-30) / simulation.step_tolerance) ** (1 / 4) / _SAFETY
        if refusal is not None or not (factor <= 1 / _SAFETY or many > _MOST):
            self._count = min(max(math.ceil(many * min(factor, 4.0)), many + 1), 2 * _MOST)
            return False
        is_point = steps.ends[-1] == steps.target
        recorder.join(many, in_result=is_point)
        self._keep(times, rows)
        self._count, self._error = max(1, math.ceil(many * max(factor, 0.5))), self._error + error
        if is_point:
            self._reach_point()
        return True


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
        most = stop if self._observers.clock is None else 1
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
            end, timeline = kernel.simulation.times[points], kernel.timeline
            has_break = timeline.next < math.inf
            is_sample = has_break and kernel.are_samples and timeline.is_at(end)
            if self._is_watched or (has_break and not is_sample) or points + 1 == kernel.count:
                deque(self.drive(points + 1), maxlen=0)
            else:  # nothing can happen before the next point; at it a sample may be taken
                kernel.recorder.step(end)
                progress.points += 1
                if is_sample:
                    timeline.find_next(end)
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
        if hidden.size:
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
