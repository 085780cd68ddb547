"""Communication steps of adapted size, repeated where the estimate of their error is too large.

The estimate (:mod:`liaisons.cosim.running.estimate`) compares a step with the points before it, and costs no step.

* ``error_tolerance``: each step adds less than this error.
* no ``step_size``: equal steps between two communication points, as many as keep the sum of their errors small.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from liaisons.base.clocks import time_rounding
from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.running.breaks import Breaks, Deviations
from liaisons.cosim.running.estimate import Estimate
from liaisons.cosim.running.moment import Moments
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import RefusedError

if TYPE_CHECKING:
    from liaisons.cosim.coupling.implicit import Coupled

_SAFETY, _SMALLEST_FACTOR, _LARGEST_FACTOR = 0.9, 0.2, 4.0
_FIRST = 4
"""Number of steps between two communication points that is tried first."""
_MOST = 1000
"""Largest number of steps between two communication points."""
_MEMORY = 5
"""Number of points that are kept for the estimate."""
_SHORTEST = 1e-12
"""Shortest step, relative to the whole time."""
_BRINK = 1e-6
"""Distance from the end of a refused step, relative to the whole time, nearer to which no shorter one is tried."""


class Point(NamedTuple):
    """A communication point [s].

    :param values: of the bus, shape (width,).
    :param result_time: its time in the result [s]; None: it is not in the result.
    :param after_break: it is a break, with the values right of it.
    :param error: added since the last point in the result, if it is known.
    """

    time: float
    values: Vector
    result_time: float | None
    after_break: bool = False
    error: float | None = None


@final
@dataclass(frozen=True)
class CommunicationSteps:
    """Communication steps of a run, one at a time, and across breaks.

    :param calls: those of a communication step; ``watch``: those that may refuse it after it.
    :param coupled: the coupling, if it remembers earlier steps.
    """

    simulation: Simulation
    bus: Bus
    calls: Sequence[Call]
    watch: Sequence[Call]
    coupled: Coupled | None
    breaks: Breaks
    deviations: Deviations
    estimate: Estimate

    def step(self, start: float, stop: float) -> Point:
        """Step from one instant to another [s]; returns the point that is reached."""
        self.bus.set_step(start, stop)
        self.deviations.integrate(start, stop, locate=False)
        self.bus.perform((*self.calls, *self.watch))
        return Point(stop, self.bus.values.copy(), None)

    def step_across_break(self, start: float, stop: float) -> Vector:
        """Make one step across a break, and locate the next one; return the values of the signals after it."""
        bus, coupled = self.bus, self.coupled
        bus.set_step(start, stop)
        self.breaks.begin_piece(stop)
        if coupled is None:
            bus.perform(self.calls)
        else:
            coupled.cross_break()
            bus.perform(self.calls[1:])
        self.breaks.find_next(stop)
        return bus.values

    def end_before_break(self, now: float, end: float, size: float) -> float | None:
        """End of a step of some size [s]: its own end, or an instant shortly before a break.

        :returns: None if the break is so near that the step crosses it.
        """
        while True:
            stop, tiny = end, self.breaks.tiny_step(now, size)
            if self.breaks.next <= end + time_rounding(end):
                stop = self.breaks.next - tiny
                if stop - now <= tiny:
                    return None
            if (instant := self.deviations.integrate(now, stop)) == math.inf:
                return stop
            self.breaks.next = instant

    def cross_next_break(self, now: float, end: float) -> Point:
        """Advance across the next break; returns the point, which is in the result only if the break is at the end."""
        stop = self.breaks.next
        result_time = end if stop >= end - time_rounding(end) else None
        stop = stop if result_time is None else max(stop, end)
        return Point(stop, self.step_across_break(now, stop).copy(), result_time, after_break=True)


def adapt_steps(steps: CommunicationSteps, moments: Moments) -> Iterator[Point]:
    """Step by sizes that keep the error of each step below the tolerance.

    :returns: communication points after the start.
    :raises RefusedError: if even the smallest step fails, or its error is too large.
    """
    simulation, coupled = steps.simulation, steps.coupled
    tolerance = simulation.error_tolerance
    assert tolerance is not None
    power = 2 if coupled is None else coupled.error_order + 1  # of the size of a step, in its error
    now, first, end = simulation.times
    size, shortest = min(first - now, end - now), _SHORTEST * (end - now)
    points = [Point(now, steps.bus.values.copy(), now)]
    since, beyond, reason = now, math.inf, RefusedError("")  # where steps begin to be refused, and a refused end
    while now < end:
        target = end if end - now <= size * (1 + 1e-9) else now + size
        stop = steps.end_before_break(now, target, size)
        if stop is None:
            point = steps.cross_next_break(now, end)
            now = end if point.result_time == end else point.time
            points = [point]
            yield point._replace(result_time=now)
            continue
        count = 2 if len(points) == 1 and steps.estimate.can_estimate else 1  # of one step alone there is no estimate
        before = moments.save(now)
        ends, error, refusal = _attempt_steps(steps, points, stop, count)
        error /= tolerance
        factor = min(max(_SAFETY * max(error, 1e-10) ** (-1 / power), _SMALLEST_FACTOR), _LARGEST_FACTOR)
        size = max((stop - now) / count * factor, size if error <= 1 and stop < target else 0.0)
        if error <= 1:
            yield from (point._replace(result_time=point.time) for point in ends[:-1])
            yield ends[-1]._replace(result_time=stop if stop == target else None)
            now, points = stop, [*points, *ends][-_MEMORY:]
            continue
        if refusal is not None:
            since, reason = (since, reason) if now < beyond < math.inf else (now, refusal)
            beyond = min(stop, beyond) if now < beyond else stop
            if since < now and beyond - now < _BRINK * (end - steps.simulation.times[0]):
                raise RefusedError(f"no step from t = {now:.10g} s is small enough: {reason}")
        if size <= shortest:
            why = refusal or f"the error of a step of {stop - now:.3g} s is {error:.3g} times error_tolerance"
            raise RefusedError(f"no step from t = {now:.10g} s is small enough: {why}")
        moments.restore(before)


def divide_steps(steps: CommunicationSteps, moments: Moments) -> Iterator[Point]:
    """Step between the communication points by equal steps, whose errors add up to less than the tolerance.

    :returns: communication points after the start.
    :raises RefusedError: if even the smallest steps fail.
    """
    times = steps.simulation.times
    points, now, count = [Point(times[0], steps.bus.values.copy(), None)], times[0], _FIRST
    for start, end in pairwise(times):
        error = 0.0
        while now < end:
            stop = steps.end_before_break(now, end, end - start)
            if stop is None:
                point = steps.cross_next_break(now, end)
                in_result = point.result_time is not None
                now, count = end if in_result else point.time, max(count, _FIRST)
                points = [point]
                yield point._replace(error=error if in_result else None)
                continue
            if len(points) == 1:
                count = max(count, 2)  # of one step alone there is no estimate
            ends, added, factor = _divide_step(steps, moments, points, stop, count)
            error, now = error + added, stop
            points = [*points, *ends][-_MEMORY:]
            count = max(1, math.ceil(len(ends) * max(factor, 0.5)))
            yield ends[-1]._replace(result_time=stop, error=error) if stop == end else ends[-1]


def _divide_step(
    steps: CommunicationSteps, moments: Moments, points: Sequence[Point], stop: float, count: int
) -> tuple[list[Point], float, float]:
    """Step to an instant [s] by equal steps, whose number follows from their errors.

    :param points: those since the last break, or the last few of them.
    :param count: number of steps to try first.
    :returns: the ends of the steps, the sum of their errors, and the factor by which their number should grow.
    """
    before = moments.save(points[-1].time)
    while True:
        ends, error, refusal = _attempt_steps(steps, points, stop, count)
        if refusal is not None and count > _MOST:
            raise refusal
        factor = (max(error, 1e-30) / steps.simulation.step_tolerance) ** (1 / 4) / _SAFETY
        if ends and (factor <= 1 / _SAFETY or count > _MOST):
            return ends, error, factor
        count = min(max(math.ceil(count * min(factor, 4.0)), count + 1), 2 * _MOST)
        moments.restore(before)


def _attempt_steps(
    steps: CommunicationSteps, points: Sequence[Point], stop: float, count: int
) -> tuple[list[Point], float, RefusedError | None]:
    """Step to an instant [s] by a number of equal steps.

    :returns: the ends of the steps, and the sum of their errors; where a step is refused none, infinity, and why.
    """
    now = points[-1].time
    instants = [*(now + (stop - now) * k / count for k in range(1, count)), stop]
    try:
        ends = [steps.step(first, last) for first, last in pairwise((now, *instants))]
        rows, times = (np.array([point[k] for point in (*points, *ends)]) for k in (1, 0))
        return ends, float(np.sum(steps.estimate.estimate_last(rows, times, count))), None
    except RefusedError as refusal:
        return [], math.inf, refusal
