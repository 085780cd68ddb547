"""A motion as a function of values, with derivatives of the steps that were taken.

A Runge-Kutta method applied to the variational equations gives the derivative of its own steps (Hairer, Nørsett,
Wanner, I.14); backwards, its adjoint does.  Steps end at all recorded times, breaks of inputs and events.  Between two
of these their sizes are fixed parts of the interval, so that they move along with an event whose instant depends on
values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self, TypeAlias, final

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import numbers
from liaisons.derivatives.functions import MotionFunctions
from liaisons.derivatives.steps import (
    METHOD,
    NOT_FIXED,
    Cuts,
    Floats,
    Integers,
    Parts,
    Segment,
    Steps,
    part_of,
    steps_between,
)
from liaisons.errors import SimulationError
from liaisons.expressions import Program
from liaisons.language import Variable

Weights: TypeAlias = "ArrayLike | Callable[[Floats], ArrayLike]"

_MARGIN = 8
"""Distance from an event, in units in the last place of its time, at which the equations of one side hold."""
_PART = 0.002
"""Allowed difference of a step and two halves, over the tolerance: derivatives have larger errors than states."""
_ROUNDING = 4e-15
_CHUNK, _ROOM = 2**21, 2**25
"""Most stage values in memory: of the steps of one piece, and of all steps."""
EQUAL = 1e-9
"""Largest relative jump of an input that is rounding."""


@final
@dataclass(frozen=True, eq=False)
class _Piece:
    """Steps between two events, indices of recorded times at their ends, and instant and slope of the event before."""

    steps: Steps
    recorded: Integers
    event: tuple[float, Floats] | None


@final
@dataclass(frozen=True, eq=False)
class _Landing:
    """Derivatives of the state after an event by the values and by the state before it."""

    of_k: Floats
    of_y: Floats


@final
@dataclass(frozen=True, eq=False)
class _Leg:
    """Integrated steps between two events.

    :param y: first state.
    :param kept: states of stages; None: to be calculated once more.
    :param recorded: which of the recorded times are among their ends.
    :param landing: None if no event was just before.
    """

    steps: Steps
    y: Floats
    kept: Floats | None
    recorded: Integers
    landing: _Landing | None


@final
@dataclass(frozen=True, eq=False)
class _Run:
    """A motion.

    :param records: states at the recorded times, (times, states).
    :param points: t, values, shared values and states there, as functions take them.
    """

    k: Floats
    legs: list[_Leg]
    records: Floats
    points: list[Floats]


@final
class DifferentiableMotion:
    """A motion as a function of some of its values, with derivatives: those of the steps that were taken.

    Steps are chosen by error control for the values that it is called with; :meth:`frozen` keeps them.

    :param name: of what moves.
    :param variables: values that it is a function of, by name.
    :param values: as set, or as declared.
    :param times: recorded [s].
    :param table: shared values, a row from each of the breaks on; inputs or their rates jump at some.
    :param signals: names of the recorded outputs.
    :param units: of values and signals.
    """

    method = "steps"

    def __init__(
        self,
        name: str,
        functions: MotionFunctions,
        variables: Mapping[str, Variable],
        values: Floats,
        times: Floats,
        *,
        start_time: float,
        table: Floats,
        breaks: Floats,
        jumps: Floats,
        signals: tuple[str, ...],
        units: Mapping[str, str],
        tolerance: float,
    ) -> None:
        self.name, self.names, self.signals, self.units = name, tuple(variables), signals, units
        self.values, self.times, self._start = values, times, start_time
        self._functions, self._variables, self._table, self._breaks = functions, variables, table, breaks
        self._jumps = jumps
        self._tolerance = max(_PART * tolerance, _ROUNDING)
        self._fixed = NOT_FIXED
        self._last: tuple[bytes | None, list[_Piece]] = None, []

    def __call__(self, values: ArrayLike) -> Floats:
        """Signals, (signals, times)."""
        return self._seen(self._run(values), self._functions.outputs)

    def rates(self, values: ArrayLike) -> Floats:
        """Time derivatives of the signals, (signals, times)."""
        return self._seen(self._run(values), self._functions.output_rates)

    def forward(self, values: ArrayLike) -> tuple[Floats, Floats]:
        """Signals, and their derivatives by the values, (signals, times, values)."""
        f, run = self._functions, self._run(values, keep=True)
        of_k, of_y = np.eye(len(run.k)), _array(f.start_tangents(run.k, self._table[0]))
        records = np.broadcast_to(of_y, (len(self.times), *of_y.shape)).copy()
        for leg in run.legs:
            if leg.landing is not None:
                of_y = leg.landing.of_k + leg.landing.of_y @ of_y
            records[leg.recorded], of_y = f.steps.tangents(leg.steps, run.k, self._kept(run, leg), of_k, of_y)
        derivatives = np.zeros((len(self.signals), len(self.times), len(run.k)))
        for signal, number, slopes in self._slopes(run):
            if number < len(run.k):
                derivatives[signal, :, number] += slopes
            else:
                derivatives[signal] += slopes[:, None] * records[:, number - len(run.k)]
        return self._seen(run, f.outputs), derivatives

    def adjoint(self, values: ArrayLike, weights: Weights) -> tuple[Floats, Floats]:
        """Signals, and the derivatives of the sum of weights * signals by the values, (values,).

        :param weights: (signals, times), or a function of the signals that returns them.
        """
        f, run = self._functions, self._run(values, keep=True)
        signals = self._seen(run, f.outputs)
        factors = numbers("weights", weights(signals) if callable(weights) else weights, SimulationError)
        if factors.shape != signals.shape:
            raise SimulationError(f"weights have shape {factors.shape}; give {signals.shape}: (signals, times)")
        sums = np.zeros((len(run.k) + f.states, len(self.times)))
        for signal, number, slopes in self._slopes(run):
            sums[number] += factors[signal] * slopes
        direct, by_state = np.split(sums, [len(run.k)])
        total, of_y = direct.sum(axis=1), np.zeros(f.states)
        for leg in reversed(run.legs):
            steps, weights_there = leg.steps, np.ascontiguousarray(by_state[:, leg.recorded].T)
            of_k, of_t, of_h = f.steps.adjoint(steps, run.k, self._kept(run, leg), weights_there, of_y)
            total += of_k + (of_t[:, None] * steps.of_t + of_h[:, None] * steps.of_h).sum(axis=0)
            if leg.landing is not None:
                total += of_y @ leg.landing.of_k
                of_y = of_y @ leg.landing.of_y
        if self.times[0] == self._start:
            of_y = of_y + by_state[:, 0]
        return signals, total + _array(f.start_adjoint(run.k, self._table[0], of_y)).ravel()

    def at(self, times: ArrayLike) -> Self:
        """The same motion, recorded at other times."""
        return self._with(times=recorded_times(times, self._start), _fixed=NOT_FIXED, _last=(None, []))

    def frozen(self, values: ArrayLike) -> Self:
        """The same motion with the steps that are taken at some values, wherever events come in the same order."""
        k = self._checked(values)
        cuts = self._cuts(k)
        return self._with(_fixed=(cuts.order(), self._chosen(k, cuts)), _last=(None, []))

    def _with(self, **changes: Any) -> Self:
        other = copy(self)
        vars(other).update(changes)
        return other

    # ---- the run

    def _checked(self, values: ArrayLike) -> Floats:
        k = np.array(numbers("values", values, SimulationError), dtype=float)
        if k.shape != self.values.shape:
            raise SimulationError(f"{self.name}: values have shape {k.shape}; give {len(self.names)}, one a name")
        for (name, variable), value in zip(self._variables.items(), k.tolist(), strict=True):
            if not (np.isfinite(value) and variable.allows(value)):
                raise SimulationError(f"{self.name}: {name} = {value:g}: must be {variable.domain() or 'finite'}")
        return k

    def _run(self, values: ArrayLike, *, keep: bool = False) -> _Run:
        f, k = self._functions, self._checked(values)
        pieces = self._pieces(k)
        y = _array(f.start(k, self._table[0])[0]).ravel()
        self._holds(k, np.array([self._start]), self._table[:1], y[None])
        records, legs, instants = np.tile(y, (len(self.times), 1)), list[_Leg](), self.times.copy()
        keeps = keep and sum(len(piece.steps.t) for piece in pieces) * (METHOD.stages + 1) * len(y) <= _ROOM
        for piece in pieces:
            steps, which, landing = piece.steps, piece.recorded, None
            if piece.event is not None:
                y, landing = self._landed(k, *piece.event, y)
            states, kept = f.steps.advance(steps, k, y, keep=keeps)
            self._holds(k, steps.t + steps.h, steps.table[steps.rows], states)
            legs.append(_Leg(steps, y, kept if keeps else None, which, landing))
            records[which], y = states[steps.record >= 0], states[-1]
            instants[which] = np.maximum(instants[which], steps.limits[0])
        points = [instants[None], k[:, None], self._table[self._row(self.times)].T, records.T]
        return _Run(k, legs, records, points)

    def _kept(self, run: _Run, leg: _Leg) -> Floats:
        if leg.kept is not None:
            return leg.kept
        return self._functions.steps.advance(leg.steps, run.k, leg.y, keep=True)[1]

    def _seen(self, run: _Run, seen: Program) -> Floats:
        return seen.evaluate(run.points)[0]

    def _slopes(self, run: _Run) -> Iterator[tuple[int, int, Floats]]:
        """Signal, number of a value or, behind these, of a state, and derivatives at the recorded times."""
        where, slopes = self._functions.output_slopes
        for (signal, number), row in zip(where, self._seen(run, slopes), strict=True):
            yield signal, number, row

    def _holds(self, k: Floats, t: Floats, s: Floats, states: Floats) -> None:
        """Check that states may be used."""
        lost = ~np.isfinite(states).all(axis=1)
        texts = self._functions.condition_texts
        (conditions,) = self._functions.conditions.evaluate([t[None], k[:, None], s.T, states.T])
        broken = conditions <= 0
        failed = np.flatnonzero(lost | broken.any(axis=0))
        if failed.size:
            reasons = [text for text, row in zip(texts, broken, strict=True) if row[failed[0]]]
            reason = reasons[0] if reasons else "the motion is not finite"
            raise SimulationError(f"{self.name}: {reason} (t = {t[failed[0]]:g} s)")

    # ---- where steps end

    def _cuts(self, k: Floats) -> Cuts:
        """Start, recorded times, breaks and events, in order; an event comes before what is at the same time."""
        start, stop = self._start, self.times[-1]
        jumps, breaks = (t[(start < t) & (t < stop)] for t in (self._jumps, self._breaks))
        later = self.times[self.times > start]
        regular = np.union1d(later, breaks)
        instants, slopes = [start, *jumps], [np.zeros(len(k))] * (1 + len(jumps))
        for time, slope in self._events(k):
            near = regular[np.argmin(np.abs(regular - time))]
            instants.append(near if abs(near - time) <= _rounding(time) else time)
            slopes.append(slope)
        times = np.concatenate([instants, regular])
        events = (np.arange(len(times)) > 0) & (np.arange(len(times)) < len(instants))
        records = np.full(len(times), -1)
        records[len(instants) + np.searchsorted(regular, later)] = np.arange(len(self.times))[self.times > start]
        order = np.lexsort((~events, times))
        return Cuts(times[order], _padded(slopes, len(times))[order], events[order], records[order])

    def _events(self, k: Floats) -> Iterator[tuple[float, Floats]]:
        """Instants and their derivatives."""
        events, t = self._functions.events, self._start
        while events.numel_out(0):
            instants, slopes = (_array(x) for x in events(t, k, self._table[0]))
            later = instants[instants > t + _rounding(t)]
            if not later.size or later.min() > self.times[-1]:
                return
            t = float(later.min())
            for slope in np.unique(slopes[instants.ravel() == t], axis=0):
                yield t, slope

    def _segments(self, cuts: Cuts) -> Iterator[tuple[Segment, slice]]:
        """What is between events, and which of the instants."""
        for first, last in pairwise([0, *np.flatnonzero(cuts.events).tolist(), len(cuts.times) - 1]):
            if last > first:
                t = cuts.times[first : last + 1]
                low, high = (
                    cuts.times[end] + sign * (_rounding(cuts.times[end]) if cuts.events[end] else -np.inf)
                    for end, sign in ((first, 1), (last, -1))
                )
                yield Segment(t, self._row(t[:-1]), np.array([low, high]), self._table), slice(first, last + 1)

    def _row(self, t: Floats) -> Integers:
        """Rows of shared values that hold from some instants on."""
        return np.maximum(np.searchsorted(self._breaks, t, side="right") - 1, 0)

    def _pieces(self, k: Floats) -> list[_Piece]:
        """Steps for some values: those that are fixed, or chosen for them."""
        key, (order, parts) = k.tobytes(), self._fixed
        if self._last[0] == key or (self._last[0] is not None and parts and not self._functions.events.numel_out(0)):
            return self._last[1]
        cuts, pieces = self._cuts(k), list[_Piece]()
        if order != cuts.order():
            parts = self._chosen(k, cuts)
        most = max(1, _CHUNK // (METHOD.stages + 1) // self._functions.states)
        for (segment, inside), part in zip(self._segments(cuts), parts, strict=True):
            event = (float(cuts.times[inside.start]), cuts.slopes[inside.start]) if inside.start else None
            whole, recorded = steps_between(cuts, inside, part, segment)
            for begin in range(0, len(whole.t), most):
                pieces.append(_Piece(*part_of(whole, recorded, begin, begin + most), None if begin else event))
        self._last = key, pieces
        return pieces

    def _chosen(self, k: Floats, cuts: Cuts) -> list[Parts]:
        """Ends of steps, segment by segment."""
        f = self._functions
        y, sizes = (_array(x).ravel() for x in f.start(k, self._table[0]))
        size, parts = np.array([cuts.times[-1] - self._start]), list[Parts]()
        for segment, inside in self._segments(cuts):
            if inside.start:
                y, _ = self._landed(k, float(cuts.times[inside.start]), cuts.slopes[inside.start], y)
            ends, totals = f.steps.choose(segment, k, y, size, tolerance=self._tolerance, sizes=np.abs(sizes))
            if not totals.size:
                t = ends[-1:] if ends.size else segment.cuts[:1]
                self._holds(k, t, self._table[self._row(t)], y[None])
                near = f.conditions.evaluate([t, k, self._table[self._row(t)].T[:, 0], y])[0]
                reason = f.condition_texts[int(near.argmin())] if near.size else "there may be a singularity"
                raise SimulationError(f"{self.name}: no step is small enough at t = {t[0]:g} s: {reason}")
            counts = np.diff(totals, prepend=0)
            which = np.repeat(np.arange(len(counts)), counts)
            spans = np.diff(segment.cuts)[which]
            parts.append((np.where(spans > 0, (ends - segment.cuts[which]) / np.where(spans > 0, spans, 1), 1), counts))
        return parts

    def _landed(self, k: Floats, time: float, slope: Floats, y: Floats) -> tuple[Floats, _Landing | None]:
        """State after the event at which a segment begins, and its derivatives."""
        f = self._functions
        sides = time - _rounding(time), time + _rounding(time)
        before, after = (self._table[row] for row in self._row(np.array(sides)))
        then, now = (_array(f.prescribed(*at)) for at in ((sides[0], k, before), (sides[1], k, after)))
        for name, change, value in zip(f.prescribed_names, now - then, then, strict=True):
            if abs(change[0]) > EQUAL * (1 + abs(value[0])) and name in f.carrying:
                raise SimulationError(
                    f"{self.name}: {name} jumps at t = {time:g} s and carries states along, which is not differentiated"
                )
        if f.landed is None:
            return y, None
        landed, of_k, of_y, of_time = map(_array, f.landed(sides[1], k, after, y, sides[0], before))
        return landed.ravel(), _Landing(of_k + of_time * slope, of_y)


def recorded_times(times: ArrayLike, start_time: float) -> Floats:
    """Times that can be recorded [s]."""
    array = numbers("times", times)
    if array.ndim != 1 or not array.size or not np.isfinite(array).all() or (np.diff(array) <= 0).any():
        raise SimulationError("times: give finite numbers in ascending order")
    if array[0] < start_time:
        raise SimulationError(f"times: {array[0]:g} s is before start_time = {start_time:g} s")
    return array


def _array(matrix: ca.DM) -> Floats:
    return np.array(matrix.full())


def _rounding(time: float) -> float:
    return _MARGIN * float(np.spacing(abs(time)))


def _padded(rows: Sequence[Floats], count: int) -> Floats:
    """Rows, with zeros after them."""
    return np.concatenate([rows, np.zeros((count - len(rows), len(rows[0])))])
