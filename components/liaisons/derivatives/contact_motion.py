"""A motion with contacts as a function of values, with derivatives of the steps that were taken.

The last step before an event of a contact ends where an event indicator g is 0: its size h is an implicit function of
the state, dh = -(∂g/∂y δy + ∂g/∂k δk + ∂g/∂t δt)/(dg/dh).  The steps behind it move along with its instant, up to the
next recorded time.  So what textbooks write as a saltation matrix is a product of derivatives: of the last step, of the
impact, and of the steps behind it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.array_names import suffixed
from liaisons.base.logs import logger
from liaisons.derivatives.contacts import ContactMemory, Contacts, Landing
from liaisons.derivatives.motion import (
    STAGE_NUMBERS,
    Integration,
    SteppedMotion,
    Weights,
    event_margin,
    recorded_times,
)
from liaisons.derivatives.steps import METHOD, Floats, Integers, Segment, Steps
from liaisons.errors import SimulationError

_MARGIN = 1e-13
"""Value of an event indicator at an event, as in ``events.c``."""
_AT_EVENT, _CONSTANT, _NEGLIGIBLE = 1e-12, 1e-6, 1e-9
"""Relative distance of a recorded time from an event at which there are two derivatives; largest derivative of a number
that stays 0, relative to its terms, and to its scale over the value."""
_MOST_EVENTS = 1000
"""Events without progress in time."""


@final
@dataclass(frozen=True, eq=False)
class _Phase:
    """Steps between two events.

    :param y: first state, behind the landing.
    :param stages: states of stages; None: to be calculated once more.
    :param slope: derivatives of the first instant by the values; None: those of the event before it.
    :param moved: derivatives of starts and of sizes of the steps by the first instant, (2, steps).
    :param moved_last: by the last instant; ``last_slope``: its derivatives by the values.
    :param indicator: of the event at its end, and derivatives of it by instant, values and state; None: a known event.
    :param grazing: instant at which an indicator comes near to 0; not-a-number: none.
    """

    steps: Steps
    y: Floats
    stages: Floats | None
    landing: Landing
    slope: Floats | None
    moved: Floats
    moved_last: Floats
    last_slope: Floats
    indicator: Floats | None
    grazing: float

    def is_doubtful(self) -> bool:
        """Whether derivatives by some values may not exist."""
        return bool(self.landing.conditions) or np.isfinite(self.grazing)


_Undefined: TypeAlias = tuple[float, NDArray[np.bool_], str, bool]
"""Instant at which derivatives by some values do not exist, and why; whether also behind it."""


@final
@dataclass(frozen=True, eq=False)
class Branch:
    """A motion with the derivatives of the branch that it takes at events.

    :param signals: (signals, times).
    :param derivatives: by the values, (signals, times, values).
    :param undefined: instants at which derivatives by some values do not exist, and why; they differ by branch.
    :param impacts: of each gap: their instants [s], and derivatives of these, (impacts, values).
    """

    signals: Floats
    derivatives: Floats
    undefined: tuple[_Undefined, ...] = ()
    impacts: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)


@final
@dataclass(frozen=True, eq=False, repr=False)
class ContactMotion(SteppedMotion):
    """A motion with unilateral liaisons and dry friction, whose events depend on its states."""

    contacts: Contacts

    def branch(self, values: ArrayLike) -> Branch:
        """Signals, instants of impacts, and their derivatives on the branch that is taken, which all exist."""
        run = self._run(values, keep_stages=True)
        records, undefined, slopes = self._tangents(run)
        instants, last = np.array([phase.steps.t[0] for phase in run.legs]), -self.contacts.gaps
        counts = np.array([phase.steps.table[0, 2 * last : last] for phase in run.legs]).astype(int)
        events = np.diff(counts, axis=0, prepend=0).T
        impacts = {
            suffixed(name, "_impacts"): (np.repeat(instants, row), np.repeat(slopes, row, axis=0))
            for name, row in zip(self.contacts.names, events, strict=False)
        }
        signals = self._evaluated(run, self.functions.outputs)
        return Branch(signals, self._signal_derivatives(run, records), tuple(undefined), impacts)

    def forward(self, values: ArrayLike) -> tuple[Floats, Floats]:
        branch = self.branch(values)
        branch.derivatives[:, self._without_derivatives(branch.undefined)] = np.nan
        return branch.signals, branch.derivatives

    def adjoint(self, values: ArrayLike, weights: Weights) -> tuple[Floats, Floats]:
        f, run = self.functions, self._run(values, keep_stages=True)
        signals, factors, total, by_state = self._weighted(run, weights)
        if any(phase.is_doubtful() or self._beside(float(phase.steps.t[0])).any() for phase in run.legs):
            counts = (factors != 0).any(axis=0)
            total[self._without_derivatives(self._tangents(run)[1])[counts].any(axis=0)] = np.nan
        of_y, of_instant, none = np.zeros(f.states), 0.0, np.zeros_like(by_state)
        for phase in reversed(run.legs):
            steps, count, of_first = phase.steps, len(phase.steps.t), 0.0
            stages = self._stages(run, phase)
            if phase.indicator is not None:
                last, last_stages = steps.part(count - 1, count), stages[-1:]
                of_g, by_y = phase.indicator, phase.indicator[1 + len(run.k) :].copy()
                k_g, (t_g,), (h_g,) = f.steps.adjoint(last, run.k, last_stages, none, by_y)
                of_k, (of_t,), (of_h,) = f.steps.adjoint(last, run.k, last_stages, none, of_y)
                ratio = (of_h + of_instant) / (h_g + of_g[0])
                total += of_k - ratio * (k_g + of_g[1 : 1 + len(run.k)])
                of_y = of_y - ratio * by_y
                of_first = (of_t + of_instant - ratio * (t_g + of_g[0])) * phase.moved[0, -1]
                count -= 1
            of_k, of_t, of_h = f.steps.adjoint(steps.part(0, count), run.k, stages, by_state, of_y)
            total += of_k + self._along(of_t, of_h, phase.moved_last) * phase.last_slope
            of_first += self._along(of_t, of_h, phase.moved)
            if phase is run.legs[0] and self.times[0] == self.start_time:
                of_y = of_y + by_state[0]
            landing = phase.landing
            total += of_y @ landing.of_k
            of_instant = of_first + float(of_y @ landing.of_t[:, 0])
            of_y = of_y @ landing.of_y
            if phase.slope is not None:
                total, of_instant = total + of_instant * phase.slope, 0.0
        return signals, total + of_y @ f.start_tangents(run.k, self.table[0]).full()

    def _beside(self, instant: float) -> NDArray[np.bool_]:
        """Which recorded times an event is at."""
        return np.abs(self.times - instant) <= _AT_EVENT * max(1.0, abs(instant))

    def _without_derivatives(self, undefined: Sequence[_Undefined]) -> NDArray[np.bool_]:
        """At which times there are no derivatives by which values, (times, values); this is warned of."""
        result = np.zeros((len(self.times), len(self.values)), dtype=bool)
        for instant, columns, reason, lasts in undefined:
            where = self._beside(instant) | (lasts & (self.times > instant))
            new = where[:, None] & columns & ~result
            if new.any():
                names, when = np.array(self.names)[new.any(axis=0)], "from here on" if lasts else "there"
                logger.warning(
                    "%s: t = %.9g s: %s: derivatives by %s are not-a-number %s",
                    *(self.name, instant, reason, ", ".join(names), when),
                )
            result |= new
        return result

    def at(self, times: ArrayLike) -> Self:
        """The same motion, recorded at other times."""
        return replace(self, times=recorded_times(times, self.start_time))

    def frozen(self, values: ArrayLike) -> Self:  # noqa: ARG002
        """The same motion: steps end at its events, and are chosen in each run."""
        return self

    @staticmethod
    def _along(of_t: Floats, of_h: Floats, moved: Floats) -> float:
        """Derivative by an instant, of those by starts and sizes of the steps that it moves."""
        count = len(of_t)
        return float(of_t @ moved[0, :count] + of_h @ moved[1, :count])

    def _tangents(self, run: Integration) -> tuple[Floats, list[_Undefined], Floats]:
        """Derivatives of states at recorded times; where, by which values, there are none; and of first instants.

        :returns: derivatives (times, states, values) and (phases, values), those of the branch that is taken.
        """
        f, k, count = self.functions, run.k, len(run.k)
        of_y, slope = f.start_tangents(k, self.table[0]).full(), np.zeros(count)
        records, undefined, slopes = np.empty((len(self.times), f.states, count)), list[_Undefined](), list[Floats]()
        values = np.where(k == 0, 1.0, np.abs(k))
        for phase in run.legs:
            landing, steps, stages = phase.landing, phase.steps, self._stages(run, phase)
            slope = slope if phase.slope is None else phase.slope
            slopes.append(slope)
            instant = float(steps.t[0])
            if slope.any():
                undefined.append((instant, slope != 0, "two branches of the motion meet", False))
            for row in landing.conditions:
                terms = row[0] * slope, row[1 : 1 + count], row[1 + count :, None] * of_y
                change = terms[0] + terms[1] + terms[2].sum(axis=0)
                size = np.abs(terms[0]) + np.abs(terms[1]) + np.abs(terms[2]).sum(axis=0)
                changes = (np.abs(change) > _CONSTANT * size) & (np.abs(change) * values > _NEGLIGIBLE)
                if changes.any():
                    undefined.append(
                        (instant, changes, "contacts act in another order or mode for neighbouring values", True)
                    )
            of_y = landing.of_k + landing.of_t * slope + landing.of_y @ of_y
            if phase is run.legs[0] and self.times[0] == self.start_time:
                records[0] = of_y
            of_t, of_h = (
                a[:, None] * slope + b[:, None] * phase.last_slope
                for a, b in zip(phase.moved, phase.moved_last, strict=True)
            )
            steps = replace(steps, of_t=of_t, of_h=of_h)
            free = phase.indicator is not None
            regular = steps.part(0, len(steps.t) - free)
            if len(regular.t):
                records[regular.recorded], of_y = f.steps.tangents(regular, k, stages, np.eye(count), of_y)
            if free:
                last, none = steps.part(len(steps.t) - 1, len(steps.t)), np.zeros((1, 1))
                last = replace(last, of_t=np.hstack([last.of_t, none]), of_h=np.hstack([last.of_h, none + 1]))
                directions, first = np.eye(count, count + 1), np.pad(of_y, ((0, 0), (0, 1)))
                _, ends = f.steps.tangents(last, k, stages[-1:], directions, first)
                of_y, by_size, begins = ends[:, :count], ends[:, count], last.of_t[0, :count]
                of_g = phase.indicator
                by_y = of_g[1 + count :]
                size = -(by_y @ of_y + of_g[1 : 1 + count] + of_g[0] * begins) / (by_y @ by_size + of_g[0])
                of_y, slope = of_y + by_size[:, None] * size, begins + size
            if np.isfinite(phase.grazing):
                undefined.append((phase.grazing, np.any(of_y != 0, axis=0), "a contact is grazed", True))
        return records, undefined, np.array(slopes)

    # ---- the run

    def _run(self, values: ArrayLike, *, keep_stages: bool = False) -> Integration:
        """Integrate the motion, event by event."""
        f, k, contacts = self.functions, self._checked(values), self.contacts
        y, sizes = (x.full().ravel() for x in f.start(k, self.table[0]))
        none = np.zeros(contacts.gaps)
        memory = ContactMemory((0,) * contacts.count, none, none + self.start_time, started=False)
        margins = np.full(contacts.count, _MARGIN)
        records, shared = np.empty((len(self.times), f.states)), self.table[self._row(self.times)]
        phases, size, stuck = list[_Phase](), np.array([self.times[-1] - self.start_time]), 0
        room, instants = STAGE_NUMBERS, self.times.copy()
        for whole in self._segments(k) or [self._start(k)]:
            segment, slope, which = whole, whole.slopes[0], None
            landing = self._after_jump(k, segment, y, memory)
            while True:
                time = max(float(segment.instants[0]), float(segment.limits[0]))
                point = time, k, self._remembering(memory)[segment.rows[0]]
                landing, memory, flight = contacts.settle(landing, point, memory, which)
                segment = replace(segment, table=self._remembering(memory), event=None)
                size, y = np.minimum(size, flight), landing.y.copy()
                ends, counts, report = f.steps.follow(
                    segment, k, y, size, tolerance=self.step_tolerance, sizes=np.abs(sizes), margins=margins
                )
                self._refuse_stuck(segment, k, y, ends, counts)
                which, interval, _, grazing = report
                which, interval = None if which < 0 else int(which), int(interval)
                steps, moved, moved_last = _steps(segment, ends, counts[: interval + 1], which is not None)
                room -= len(steps.t) * (METHOD.stages + 1) * len(y)
                keep = keep_stages and room > 0
                states, stages = f.steps.advance(steps, k, landing.y, keep=keep)
                self._refuse_states(k, steps.t + steps.h, steps.table[steps.rows], states)
                recorded, ends_of_intervals, y = steps.recorded, steps.records >= 0, states[-1]
                records[recorded], shared[recorded] = (
                    states[ends_of_intervals],
                    steps.table[steps.rows[ends_of_intervals]],
                )
                instants[recorded] = np.maximum(instants[recorded], steps.limits[0])
                if not phases:
                    first = segment.table[segment.rows[0]]
                    self._refuse_states(k, np.array([time]), first[None], landing.y[None])
                    records[self.times == time], shared[self.times == time] = landing.y, first
                slopes = None
                end = float(ends[-1]), k, steps.table[steps.rows[-1]], y
                if which is not None:
                    slopes = contacts.indicator_slopes(*end)[0][which].copy()
                phases.append(
                    _Phase(
                        steps,
                        landing.y,
                        stages if keep else None,
                        landing,
                        slope,
                        moved,
                        moved_last,
                        whole.slopes[-1],
                        slopes,
                        grazing,
                    )
                )
                if which is None:
                    break
                stuck = stuck + 1 if ends[-1] - time <= event_margin(time) else 0
                if stuck > _MOST_EVENTS:
                    raise SimulationError(f"{self.name}: {stuck} events of {contacts.names[which]} at t = {time:g} s")
                segment = _remaining(segment, float(ends[-1]), interval)
                landing, slope = contacts.restore(Landing.unchanged(y, len(k)), end[:3], memory), None
        return Integration(k, phases, [instants[None], k[:, None], shared.T, records.T])

    def _start(self, k: Floats) -> Segment:
        """No motion, where the start alone is recorded."""
        ends, none = np.full(2, self.start_time), np.full(2, -1)
        row, limits = self._row(ends[:1]), np.array([-np.inf, np.inf])
        return Segment(ends, np.zeros((2, len(k))), none, row, limits, self.table, None)

    def _remembering(self, memory: ContactMemory) -> Floats:
        """Shared values, with what is remembered of the contacts."""
        table, values = self.table.copy(), [*memory.values()]
        table[:, -len(values) :] = values
        return table

    def _after_jump(self, k: Floats, segment: Segment, y: Floats, memory: ContactMemory) -> Landing:
        """State after a known event, before the contacts act."""
        landing = Landing.unchanged(y, len(k))
        if segment.event is not None:
            before = segment.event[0] - event_margin(segment.event[0])
            row = self._remembering(memory)[self._row(np.array(before))]
            landing = self.contacts.restore(landing, (before, k, row), memory)
        landed, slopes = self._landed(k, segment.event, landing.y)
        if slopes is None:
            return landing
        of_k, of_y = slopes
        return landing.mapped(landed, np.hstack([landing.of_t, of_k, of_y]))


def with_contacts(motion: SteppedMotion, contacts: Contacts) -> ContactMotion:
    """A motion whose contacts act; after each break of an input their modes are chosen anew."""
    settings: dict[str, Any] = {item.name: getattr(motion, item.name) for item in fields(SteppedMotion)}
    settings["table"] = np.hstack([motion.table, np.zeros((len(motion.table), contacts.remembered))])
    settings["jumps"] = motion.breaks[1:-1]
    return ContactMotion(**settings, contacts=contacts)


def _steps(segment: Segment, ends: Floats, counts: Integers, stops: bool) -> tuple[Steps, Floats, Floats]:
    """Steps of the first intervals of a segment, and how its first and last instant move them, (2, steps) each.

    :param stops: whether the last interval ends at an event of contacts; its steps move along with its first instant.
    """
    interval = np.repeat(np.arange(len(counts)), np.diff(counts, prepend=0))
    first, last = np.append(True, np.diff(interval) > 0), np.append(np.diff(interval) > 0, True)
    begins = np.where(first, segment.instants[interval], np.append(0.0, ends[:-1]))
    sizes, spans = ends - begins, np.diff(segment.instants)[interval]
    part = np.divide(begins - segment.instants[interval], spans, out=np.zeros(len(ends)), where=spans > 0)
    share = np.divide(sizes, spans, out=np.ones(len(ends)), where=spans > 0)
    stopped = stops & (interval == len(counts) - 1)
    part, share = np.where(stopped, 0.0, part), np.where(stopped, 0.0, share)
    moved = (interval == 0) * np.array([1 - part, -share])
    moved_last = (~stopped & (interval == len(segment.rows) - 1)) * np.array([part, share])
    records = np.where(last & ~stopped, segment.records[1:][interval], -1)
    none = np.zeros((1, segment.slopes.shape[1]))
    rows = segment.rows[interval]
    return Steps(begins, sizes, rows, segment.limits, segment.table, none, none, records, None), moved, moved_last


def _remaining(segment: Segment, time: float, interval: int) -> Segment:
    """A segment from an event in one of its intervals on."""
    instants = np.append(time, np.maximum(segment.instants[interval + 1 :], time))
    records = np.append(-1, segment.records[interval + 1 :])
    return replace(segment, instants=instants, records=records, rows=segment.rows[interval:])
