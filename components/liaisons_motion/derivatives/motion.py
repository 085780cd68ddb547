"""A motion as a function of values, with derivatives of the steps that were taken.

A Runge-Kutta method applied to the variational equations gives the derivative of its own steps (Hairer, Nørsett,
Wanner, I.14); backwards, its adjoint does.  Steps end at all recorded times, breaks of inputs and events.  Between two
of these their sizes are fixed parts of the interval, so that they move along with an event whose instant depends on
values.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar, Self, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arguments import float_array
from liaisons.errors import SimulationError
from liaisons.expressions import Program
from liaisons.language import Variable
from liaisons_motion.derivatives.functions import MotionFunctions
from liaisons_motion.derivatives.steps import METHOD, Event, Floats, Integers, Segment, StepEnds, Steps, segment_steps

Weights: TypeAlias = "ArrayLike | Callable[[Floats], ArrayLike]"

_AHEAD = 1e-2  # part of a segment in which a reason is looked for where no step is small enough
_EVENT_MARGIN = 8
"""Distance from an event, in units in the last place of its time, at which the equations of one side hold."""
_STEP_TOLERANCE = 0.002
"""Allowed difference of a step and two halves, over the tolerance: derivatives have larger errors than states."""
_LEAST_TOLERANCE = 4e-15
"""Least allowed difference, a rounding."""
CHUNK_NUMBERS = 2**21
"""Most states of stages of one chunk of steps in memory."""
STAGE_NUMBERS = 2**25
"""Most states of stages of all steps in memory."""
ROUNDING_OF_INPUTS = 1e-9
"""Largest relative jump of an input that is rounding."""

_Landing: TypeAlias = tuple[Floats, Floats]
"""Derivatives of the state after an event, by the values and by the state before it."""


@final
@dataclass(frozen=True, eq=False)
class _Leg:
    """Integrated steps.

    :param y: first state.
    :param stages: states of stages; None: to be calculated once more.
    :param landing: None if no event was just before.
    """

    steps: Steps
    y: Floats
    stages: Floats | None
    landing: _Landing | None


@final
@dataclass(frozen=True, eq=False)
class Integration:
    """A motion that was integrated.

    :param legs: integrated steps, between events.
    :param points: t, values, shared values and states at the recorded times, as programs take them.
    """

    k: Floats
    legs: list[Any]
    points: list[Floats]


Undefined: TypeAlias = tuple[float, NDArray[np.bool_], str, bool]
"""Instant at which derivatives by some values do not exist, and why; whether also behind it."""


@final
@dataclass(frozen=True, eq=False)
class Branch:
    """A motion with the derivatives of the branch that it takes at events.

    :param signals: (signals, times).
    :param derivatives: by the values, (signals, times, values).
    :param undefined: instants at which derivatives by some values do not exist, and why; they differ by branch.  Where
        these only meet, they are recorded times.
    :param impacts: of each gap: their instants [s], and derivatives of these, (impacts, values).
    """

    signals: Floats
    derivatives: Floats
    undefined: tuple[Undefined, ...] = ()
    impacts: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class SteppedMotion(ABC):
    """A motion as a function of some of its values, with derivatives of the steps that are taken.

    :param name: of what moves.
    :param variables: values that it is a function of, by name.
    :param values: as set, or as declared.
    :param times: recorded [s].
    :param table: shared values, a row from each of the breaks on; inputs or their rates jump at ``jumps``.
    :param signals: names of the recorded outputs.
    :param units: of values and signals.
    :param tolerance: of a step, relative to the size of each state.
    """

    method: ClassVar = "steps"
    has_contacts: ClassVar = False

    name: str
    functions: MotionFunctions
    variables: Mapping[str, Variable]
    values: Floats
    times: Floats
    start_time: float
    table: Floats
    breaks: Floats
    jumps: Floats
    signals: tuple[str, ...]
    units: Mapping[str, str]
    tolerance: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values."""
        return tuple(self.variables)

    @property
    def step_tolerance(self) -> float:
        """Largest difference of a step and two of half its size, relative to the states."""
        return max(_STEP_TOLERANCE * self.tolerance, _LEAST_TOLERANCE)

    def __call__(self, values: ArrayLike) -> Floats:
        """Signals, (signals, times)."""
        return self._evaluate(self._run(values), self.functions.outputs)

    def rates(self, values: ArrayLike) -> Floats:
        """Time derivatives of the signals, (signals, times)."""
        return self._evaluate(self._run(values), self.functions.output_rates)

    @abstractmethod
    def forward(self, values: ArrayLike) -> tuple[Floats, Floats]:
        """Signals, and their derivatives by the values, (signals, times, values)."""

    def branch(self, values: ArrayLike) -> Branch:
        """Signals, and their derivatives on the branch that the motion takes at events."""
        return Branch(*self.forward(values))

    @abstractmethod
    def adjoint(self, values: ArrayLike, weights: Weights) -> tuple[Floats, Floats]:
        """Signals, and the derivatives of the sum of weights * signals by the values, (values,).

        :param weights: (signals, times), or a function of the signals that returns them.
        """

    @abstractmethod
    def _run(self, values: ArrayLike, *, keep_stages: bool = False) -> Any:
        """Integrate the motion from the start to the last recorded time."""

    def _checked_values(self, values: ArrayLike) -> Floats:
        """Values as an array, (values,), each inside its domain."""
        k = np.array(float_array("values", values, SimulationError), dtype=float)
        if k.shape != self.values.shape:
            raise SimulationError(f"{self.name}: values have shape {k.shape}; give {len(self.names)}, one a name")
        for (name, variable), value in zip(self.variables.items(), k.tolist(), strict=True):
            check_domain(self.name, name, variable, value)
        return k

    def _stages(self, run: Integration, leg: Any) -> Floats:
        """States of the stages of a leg, integrated once more unless kept."""
        if leg.stages is not None:
            return leg.stages
        return self.functions.steps.advance(leg.steps, run.k, leg.y, keep=True)[1]

    def _evaluate(self, run: Integration, program: Program) -> Floats:
        """Results of a program at the recorded times, (rows, times)."""
        return program.evaluate(run.points)[0]

    def _output_slopes(self, run: Integration) -> Iterator[tuple[int, int, Floats]]:
        """Yield the partial derivatives of signals at the recorded times: signal, value or state, (times,).

        States are numbered behind the values.
        """
        pairs, slopes = self.functions.output_slopes
        for (signal, number), row in zip(pairs, self._evaluate(run, slopes), strict=True):
            yield signal, number, row

    def _weighted_sum_derivatives(self, run: Integration, weights: Weights) -> tuple[Floats, Floats, Floats, Floats]:
        """Signals, weights, and derivatives of the weighted sum by the values, and by the states at recorded times."""
        f, count = self.functions, len(run.k)
        signals = self._evaluate(run, f.outputs)
        factors = float_array("weights", weights(signals) if callable(weights) else weights, SimulationError)
        if factors.shape != signals.shape:
            raise SimulationError(f"weights have shape {factors.shape}; give {signals.shape}: (signals, times)")
        sums = np.zeros((count + f.states, len(self.times)))
        for signal, number, slopes in self._output_slopes(run):
            sums[number] += factors[signal] * slopes
        return signals, factors, sums[:count].sum(axis=1), np.ascontiguousarray(sums[count:].T)

    def _signal_derivatives(self, run: Integration, records: Floats) -> Floats:
        """Derivatives of the signals by the values, (signals, times, values).

        :param records: derivatives of the states at the recorded times by the values.
        """
        derivatives = np.zeros((len(self.signals), len(self.times), len(run.k)))
        for signal, number, slopes in self._output_slopes(run):
            if number < len(run.k):
                derivatives[signal, :, number] += slopes
            else:
                derivatives[signal] += slopes[:, None] * records[:, number - len(run.k)]
        return derivatives

    def _refuse_states(self, k: Floats, t: Floats, s: Floats, states: Floats) -> None:
        """Raise a SimulationError for the first state that is not finite, or violates a condition of the mechanism."""
        texts, finite = self.functions.condition_texts, np.isfinite(states)
        if not texts and finite.all():
            return
        lost = ~finite.all(axis=1)
        (conditions,) = self.functions.conditions.evaluate([t[None], k[:, None], s.T, states.T])
        broken = conditions <= 0
        failed = np.flatnonzero(lost | broken.any(axis=0))
        if failed.size:
            reasons = [text for text, row in zip(texts, broken, strict=True) if row[failed[0]]]
            i = int(failed[0])
            beyond = (
                self.functions.out_of_reach(t[i - 1], t[i], k, s[i], states[i - 1])
                if i and np.isnan(states[i]).all()
                else ""
            )
            reason = beyond or f"{reasons[0] if reasons else 'the motion is not finite'} (t = {t[i]:g} s)"
            raise SimulationError(f"{self.name}: {reason}")

    def _refuse_stuck(self, segment: Segment, k: Floats, y: Floats, ends: Floats, totals: Integers) -> None:
        """Raise a SimulationError if no step was small enough: if there are no totals."""
        if totals.size:
            return
        t = ends[-1:] if ends.size else segment.instants[:1]
        s = segment.table[self._table_rows(t)[0]]
        self._refuse_states(k, t, s[None], y[None])
        if beyond := self.functions.out_of_reach(t[0], t[0] + _AHEAD * (segment.instants[-1] - t[0]), k, s, y):
            raise SimulationError(f"{self.name}: {beyond}")
        near = self.functions.conditions.evaluate([t, k, s, y])[0]
        reason = self.functions.condition_texts[int(near.argmin())] if near.size else "there may be a singularity"
        values = self.functions.prescribed_values(t[0], k, s, y)
        where = f"t = {t[0]:.9g} s" + (f", where {values}" if values else "")
        raise SimulationError(f"{self.name}: no step is small enough at {where}: {reason}")

    def _events(self, k: Floats) -> Iterator[tuple[float, Floats]]:
        """Yield the instants of events [s], and their derivatives by the values (values,)."""
        events, t = self.functions.events, self.start_time
        while events.numel_out(0):
            instants, slopes = (x.full() for x in events(t, k, self.table[0]))
            later = instants[instants > t + event_margin(t)]
            if not later.size or later.min() > self.times[-1]:
                return
            t = float(later.min())
            for slope in np.unique(slopes[instants.ravel() == t], axis=0):
                yield t, slope

    def _segments(self, k: Floats) -> list[Segment]:
        """Segments of the motion between its events; an event comes first at its instant."""
        start, stop = self.start_time, self.times[-1]
        jumps, breaks = (t[(start < t) & (t < stop)] for t in (self.jumps, self.breaks))
        later = self.times[self.times > start]
        regular = np.union1d(later, breaks) if breaks.size else later
        instants, slopes = [start, *jumps], [np.zeros(len(k))] * (1 + len(jumps))
        for time, slope in self._events(k):
            near = regular[np.argmin(np.abs(regular - time))]
            instants.append(near if abs(near - time) <= event_margin(time) else time)
            slopes.append(slope)
        times = np.concatenate([instants, regular])
        numbers, records = np.arange(len(times)), np.full(len(times), -1)
        is_event = (numbers > 0) & (numbers < len(instants))
        places = np.searchsorted(regular, later) if breaks.size else slice(None)
        records[len(instants) :][places] = np.flatnonzero(self.times > start)
        order = np.lexsort((~is_event, times))
        slopes = np.concatenate([slopes, np.zeros((len(regular), len(k)))])[order]
        times, is_event, records = times[order], is_event[order], records[order]
        segments = list[Segment]()
        for first, last in pairwise([0, *np.flatnonzero(is_event).tolist(), len(times) - 1]):
            if last > first:
                inside = slice(first, last + 1)
                limits = [
                    times[end] + sign * (event_margin(times[end]) if is_event[end] else -np.inf)
                    for end, sign in ((first, 1), (last, -1))
                ]
                rows, event = (
                    self._table_rows(times[first:last]),
                    (float(times[first]), slopes[first]) if first else None,
                )
                intervals = times[inside], slopes[inside], records[inside]
                segments.append(Segment(*intervals, rows, np.array(limits), self.table, event))
        return segments

    def _table_rows(self, t: Floats) -> Integers:
        """Indices of the rows of the table that hold from these instants on."""
        return np.maximum(np.searchsorted(self.breaks, t, side="right") - 1, 0)

    def _state_after_event(self, k: Floats, event: Event | None, y: Floats) -> tuple[Floats, _Landing | None]:
        """State after an event, and its derivatives; the same state and None without an event."""
        f = self.functions
        if event is None:
            return y, None
        time, slope = event
        sides = time - event_margin(time), time + event_margin(time)
        before, after = (self.table[row] for row in self._table_rows(np.array(sides)))
        previous, now = (f.prescribed(*point).full() for point in ((sides[0], k, before), (sides[1], k, after)))
        for name, change, value in zip(f.prescribed_names, now - previous, previous, strict=True):
            if abs(change[0]) > ROUNDING_OF_INPUTS * (1 + abs(value[0])) and name in f.state_moving_inputs:
                raise SimulationError(
                    f"{self.name}: {name} jumps at t = {time:g} s and carries states along, which is not differentiated"
                )
        if f.state_after_event is None:
            return y, None
        landed, of_k, of_y, of_time = (x.full() for x in f.state_after_event(sides[1], k, after, y, sides[0], before))
        return landed.ravel(), (of_k + of_time * slope, of_y)


@final
@dataclass(frozen=True, eq=False, repr=False)
class DifferentiableMotion(SteppedMotion):
    """A motion whose events have instants that depend on values alone.

    Steps are chosen by error control for the values that it is called with; :meth:`frozen` keeps them.

    :param frozen_steps: order of instants, and for it the ends of the steps in each segment; chosen where it differs.
    """

    frozen_steps: tuple[object, list[StepEnds]] = (None, [])
    _latest: dict[bytes, list[Steps]] = field(default_factory=dict, init=False)

    def forward(self, values: ArrayLike) -> tuple[Floats, Floats]:
        f, run = self.functions, self._run(values, keep_stages=True)
        of_k, of_y = np.eye(len(run.k)), f.start_derivatives(run.k, self.table[0]).full()
        records = np.broadcast_to(of_y, (len(self.times), *of_y.shape)).copy()
        for leg in run.legs:
            if leg.landing is not None:
                by_k, by_y = leg.landing
                of_y = by_k + by_y @ of_y
            records[leg.steps.recorded_indices], of_y = f.steps.directional_derivatives(
                leg.steps, run.k, self._stages(run, leg), of_k, of_y
            )
        return self._evaluate(run, f.outputs), self._signal_derivatives(run, records)

    def adjoint(self, values: ArrayLike, weights: Weights) -> tuple[Floats, Floats]:
        f, run = self.functions, self._run(values, keep_stages=True)
        signals, _, total, by_state = self._weighted_sum_derivatives(run, weights)
        of_y = np.zeros(f.states)
        for leg in reversed(run.legs):
            steps = leg.steps
            of_k, of_t, of_h = f.steps.adjoint_derivatives(steps, run.k, self._stages(run, leg), by_state, of_y)
            total += of_k + (of_t[:, None] * steps.of_t + of_h[:, None] * steps.of_h).sum(axis=0)
            if leg.landing is not None:
                by_k, by_y = leg.landing
                total += of_y @ by_k
                of_y = of_y @ by_y
        if self.times[0] == self.start_time:
            of_y = of_y + by_state[0]
        return signals, total + of_y @ f.start_derivatives(run.k, self.table[0]).full()

    def at(self, times: ArrayLike) -> Self:
        """The same motion, recorded at other times."""
        return replace(self, times=recorded_times(times, self.start_time), frozen_steps=(None, []))

    def frozen(self, values: ArrayLike) -> Self:
        """The same motion with the steps chosen for these values, as long as events occur in the same order."""
        k = self._checked_values(values)
        segments = self._segments(k)
        return replace(self, frozen_steps=(_instant_order(segments), self._step_ends(k, segments)))

    # ---- the run

    def _run(self, values: ArrayLike, *, keep_stages: bool = False) -> Integration:
        """Integrate the motion from the start to the last recorded time."""
        f, k = self.functions, self._checked_values(values)
        chunks = self._chunks(k)
        y = f.start(k, self.table[0])[0].full().ravel()
        self._refuse_states(k, np.array([self.start_time]), self.table[:1], y[None])
        records, legs, instants = np.tile(y, (len(self.times), 1)), list[_Leg](), self.times.copy()
        keep = keep_stages and sum(len(steps.t) for steps in chunks) * (METHOD.stages + 1) * len(y) <= STAGE_NUMBERS
        for steps in chunks:
            y, landing = self._state_after_event(k, steps.event, y)
            states, stages = f.steps.advance(steps, k, y, keep=keep)
            self._refuse_states(k, steps.t + steps.h, steps.table[steps.rows], states)
            legs.append(_Leg(steps, y, stages if keep else None, landing))
            recorded = steps.recorded_indices
            records[recorded], y = states[steps.records >= 0], states[-1]
            instants[recorded] = np.maximum(instants[recorded], steps.limits[0])
        return Integration(k, legs, [instants[None], k[:, None], self.table[self._table_rows(self.times)].T, records.T])

    # ---- where steps end

    def _chunks(self, k: Floats) -> list[Steps]:
        """All steps for some values, in chunks that fit into memory."""
        order, frozen = self.frozen_steps
        key = b"" if frozen and not self.functions.events.numel_out(0) else k.tobytes()
        if key not in self._latest:
            segments, chunks = self._segments(k), list[Steps]()
            ends = frozen if order == _instant_order(segments) else self._step_ends(k, segments)
            most = max(1, CHUNK_NUMBERS // (METHOD.stages + 1) // self.functions.states)
            for segment, own in zip(segments, ends, strict=True):
                steps = segment_steps(segment, own)
                chunks += [steps.part(begin, begin + most) for begin in range(0, len(steps.t), most)]
            self._latest.clear()
            self._latest[key] = chunks
        return self._latest[key]

    def _step_ends(self, k: Floats, segments: Sequence[Segment]) -> list[StepEnds]:
        """Ends of steps within the tolerance, segment by segment."""
        f, tolerance = self.functions, self.step_tolerance
        y, sizes = (x.full().ravel() for x in f.start(k, self.table[0]))
        size, result = np.array([self.times[-1] - self.start_time]), list[StepEnds]()
        for segment in segments:
            y, _ = self._state_after_event(k, segment.event, y)
            ends, totals = f.steps.choose_step_ends(segment, k, y, size, tolerance=tolerance, sizes=np.abs(sizes))
            self._refuse_stuck(segment, k, y, ends, totals)
            counts = np.diff(totals, prepend=0)
            interval = np.repeat(np.arange(len(counts)), counts)
            spans, elapsed = np.diff(segment.instants)[interval], ends - segment.instants[interval]
            result.append((np.where(spans > 0, elapsed / np.where(spans > 0, spans, 1), 1), counts))
        return result


def check_domain(owner: str, name: str, variable: Variable, value: float) -> None:
    """Raise a SimulationError for a value that is not finite, or outside the domain of its variable."""
    if not (np.isfinite(value) and variable.allows(value)):
        raise SimulationError(f"{owner}: {name} = {value:g}: must be {variable.domain() or 'finite'}")


def recorded_times(times: ArrayLike, start_time: float) -> Floats:
    """Times as an array [s].

    :raises SimulationError: unless they are finite, ascending, and not before the start time.
    """
    array = float_array("times", times)
    if array.ndim != 1 or not array.size or not np.isfinite(array).all() or (np.diff(array) <= 0).any():
        raise SimulationError("times: give finite numbers in ascending order")
    if array[0] < start_time:
        raise SimulationError(f"times: {array[0]:g} s is before start_time = {start_time:g} s")
    return array


def _instant_order(segments: Sequence[Segment]) -> list[tuple[bool, bytes]]:
    """Order in which events, recorded times and breaks follow each other, to be compared."""
    return [(segment.event is None, segment.records.tobytes()) for segment in segments]


def event_margin(time: float) -> float:
    """Distance from an event at which the equations of one side hold [s]."""
    return _EVENT_MARGIN * float(np.spacing(abs(time)))
