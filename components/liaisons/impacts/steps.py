"""Steps up to impacts that several FMUs take part in, and changes of contacts, and across them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, final
from weakref import proxy

from liaisons.cosim import Kernel, Moment
from liaisons.errors import RefusedError
from liaisons.impacts.impacts import Impacts
from liaisons.impacts.impulses import ImpulsivePort

_LEAST_IMPACT_DISTANCE = 1e-9
"""Time from an impact to a communication point below which they count as one, relative to a step."""
_LEAST_EXTRAPOLATED_STEP = 1e-4
"""Size of a step in which inputs are extrapolated, as differences are rounding, relative to one between points."""
_MOST_IMPACTS = 1000
"""Largest number of impacts of several FMUs in a communication step."""


@final
class ImpactSteps:
    """Steps of a kernel, of which each ends at the first impact within.

    :param ports: those through which impulses go.
    """

    def __init__(self, kernel: Kernel, ports: Sequence[ImpulsivePort]) -> None:
        self._kernel: Kernel = proxy(kernel)  # which refers to this: a run is freed when nothing refers to it
        self._impacts = Impacts(ports, self._kernel)
        self._frictions = self._impacts.frictions
        self._forget_step()

    def initialize(self, solve: Callable[[], None]) -> None:
        """Solve the equations of initialization, with contacts that choose by each other."""
        self._impacts.initialize(solve)

    def start(self) -> None:
        """Begin at the start time."""
        self._impacts.start()
        self._forget_step()

    def _forget_step(self) -> None:
        """Begin a step to another instant: how far it is [s], what happened, where sliding was looked at [s]."""
        self._instant, self._size, self._count, self._settled = math.nan, 0.0, 0, -math.inf

    def save(self) -> list[Any]:
        """Sums of jumps and impulses so far, and what is known of the step, for :meth:`restore`."""
        return [self._impacts.memory.save(), self._instant, self._size, self._count, self._settled]

    def restore(self, saved: Sequence[Any]) -> None:
        """Return to a saved state."""
        memory, self._instant, self._size, self._count, self._settled = saved
        self._impacts.memory.restore(memory)

    def advance(self, ends: Sequence[float], *, in_result: bool) -> int:
        """Step to the first instant [s], or across the first event before it.

        :returns: 1 if it was reached, else 0.
        """
        recorder, instant = self._kernel.recorder, ends[0]
        start = recorder.end
        if instant != self._instant:
            self._forget_step()
            self._instant, self._size = instant, instant - start
        if self._count == _MOST_IMPACTS:
            words = f"more than {_MOST_IMPACTS} impacts, or changes of contacts, before t = {instant:.10g} s"
            raise RefusedError(f"{self._kernel.simulation.title}: {words}: make one FMU of the system by flatten()")
        self._count += 1
        if self._begins_to_slide(start, self._size) and self._frictions.choose(recorder.rows[recorder.done - 1]):
            self._kernel.begin_piece(self._size)
        before, refusals = self._kernel.save(), list[RefusedError]()
        if self._attempt(before, instant, refusals, in_result=in_result):
            self._forget_step()
            return int(recorder.time == instant)
        stop = self._impacts.step_to_first(start, instant, lambda end: self._attempt(before, end, refusals))
        if stop <= start:
            if refusals:
                raise refusals[0]
            self._kernel.moments.restore(before)
        is_reached = self._cross(stop, instant, instant - start, in_result=in_result)
        if is_reached:
            self._forget_step()
        return int(is_reached)

    def _begins_to_slide(self, now: float, size: float) -> bool:
        """Whether a smooth piece begins at the present instant [s], in which dry friction slides without a velocity.

        Only once: what slides on then does so as all FMUs have chosen.
        """
        recorder = self._kernel.recorder
        if now <= self._settled or not recorder.begins_piece:
            return False
        self._settled = now
        return self._frictions.begin_to_slide(recorder.rows[recorder.done - 1], size)

    def _attempt(self, before: Moment, stop: float, refusals: list[RefusedError], *, in_result: bool = False) -> bool:
        """Step to an instant [s]; returns whether no contact has changed and no FMU has refused.

        :param before: the state at the start of the step, which is restored first.
        :param refusals: replaced by the refusal of this step, if there is one.
        """
        kernel, recorder, start = self._kernel, self._kernel.recorder, before.time
        kernel.moments.restore(before)
        first, halves, points = recorder.done, kernel.halves_first_step, kernel.simulation.times
        done = kernel.progress.points
        refusals.clear()
        try:
            if stop - start < _LEAST_EXTRAPOLATED_STEP * (points[done] - points[done - 1]):
                row, reached = kernel.cross(start, stop), 1
                recorder.add(stop, row, result_time=stop if in_result else None, after_break=True)
            else:
                if halves:
                    kernel.advance([(start + stop) / 2], in_result=False)
                reached = kernel.advance([stop], in_result=in_result)
        except RefusedError as error:
            refusals.append(error)
            return False
        row, last = recorder.rows[[first - 1, recorder.done - 1]]
        changed = self._impacts.has_impact(row, last, stop - start) or self._impacts.has_changed_contact(row, last)
        return not reached or not changed

    def _cross(self, now: float, end: float, size: float, *, in_result: bool) -> bool:
        """Cross impacts, or changes of a contact's mode, of this instant; returns whether the end is reached.

        :param size: of a communication step [s].
        """
        kernel, recorder, impacts, start = self._kernel, self._kernel.recorder, self._impacts, self._kernel.save()
        before = recorder.rows[recorder.done - 1].copy()
        stop = min(now + kernel.timeline.tiny_step(now, size), end)
        after = kernel.cross(now, stop).copy() if stop > now else before
        has_impact = impacts.has_impact(before, after, size)
        if has_impact or self._frictions.have_stopped(before, after):
            kernel.moments.restore(start)
            if is_end := end - now <= _LEAST_IMPACT_DISTANCE * size:
                now = recorder.times[recorder.done - 1] = end
                if in_result:
                    recorder.result_times[recorder.done - 1] = end
            kernel.bus.set_step(now, now)
            kernel.bus.perform(kernel.calls.instant)  # inputs are outputs, whatever the tolerance
            if has_impact:
                impacts.solve(now)
            if has_impact or self._frictions.choose(before, after):
                kernel.begin_piece(size)
                return is_end
            kernel.moments.restore(start)
            after = kernel.cross(start.time, stop)
        recorder.add(stop, after, result_time=stop if stop == end and in_result else None, after_break=True)
        if not self._frictions.have_changed(before, after) and self._frictions.choose(after):  # for a force of others
            kernel.begin_piece(size)
        return stop == end
