"""Residuals of one or more experiments, and their derivatives by the unknowns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, final

import numpy as np

from liaisons.base.array_names import array_and_index
from liaisons.errors import SimulationError
from liaisons.library import Target
from liaisons_motion.derivatives import Branch, Motion, motion_of
from liaisons_motion.identification.determinacy import Floats, NullSpace
from liaisons_motion.identification.measurements import Measurements

TIME_OFFSET = "time_offset"
_NEGLIGIBLE = 1e-6
"""An unknown is rounded to 0 below this fraction of its start value."""
_PARABOLA_POINTS = 7
"""Number of measurements that the parabola for a start value of a segment is fitted to."""


@final
@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """Measurements of one experiment and the simulated motion that they are compared with.

    :param motion: evaluated at the times of the measurements, and one after the last instant; their signals come first.
    :param columns: for each value of the motion, its index among the unknowns.
    :param offset: index of the time offset among the unknowns; None: 0 s.
    :param deviations: standard deviation of each signal, shape (signals,).
    """

    measurements: Measurements
    motion: Motion
    columns: tuple[int, ...]
    offset: int | None
    deviations: Floats

    def branch(self, unknowns: Floats) -> Branch:
        """Signals and impacts at values of the unknowns, and their derivatives by all of these.

        Times are those of the measurements' clock.
        Where events for neighbouring values differ, derivatives are those of the branch that is taken.
        """
        values, motion, data, own = unknowns[list(self.columns)], self.motion, self.measurements, list(self.columns)
        delay = 0.0 if self.offset is None else float(unknowns[self.offset])
        if self.offset is not None:
            motion = motion.at(_simulated_times(data, motion.start_time) + delay)
        branch = motion.branch(values)
        derivatives = np.zeros((*branch.derivatives.shape[:2], len(unknowns)))
        derivatives[..., own] = branch.derivatives
        unit = np.eye(len(unknowns))
        impacts = {name: (times - delay, slopes @ unit[own]) for name, (times, slopes) in branch.impacts.items()}
        if self.offset is not None:
            derivatives[..., self.offset] = motion.rates(values)
            for _, slopes in impacts.values():
                slopes[:, self.offset] = -1.0
        count = len(data.times)
        return replace(branch, signals=branch.signals[:, :count], derivatives=derivatives[:, :count], impacts=impacts)

    def instants(self, branch: Branch) -> dict[str, tuple[Floats, Floats]]:
        """Instants of as many impacts as were measured, and their derivatives, by the output that counts them."""
        measured = {name: len(times) for name, (times, _) in self.measurements.instants.items()}
        return {
            name: _extrapolated_instants(*branch.impacts[name], count, self.motion) for name, count in measured.items()
        }


@final
@dataclass(frozen=True, eq=False)
class Link:
    """Continuity of multiple shooting: signals at the end of one segment equal the start values of the next one."""

    experiment: int
    signals: tuple[int, ...]
    columns: tuple[int, ...]
    deviations: Floats


@final
@dataclass(frozen=True, eq=False)
class Prior:
    """Mean and standard deviation of an unknown before the measurements."""

    column: int
    mean: float
    deviation: float


@final
@dataclass(frozen=True, eq=False)
class Objective:
    """Residuals of measurements, links and priors, each divided by its standard deviation.

    :param start: unknowns at which the search begins.
    :param limits: least and largest values, infinite where there are none, shape (2, unknowns).
    :param shift: added to all residuals.
    """

    problem: FittingProblem
    experiments: tuple[MeasuredMotion, ...]
    start: Floats
    limits: Floats
    links: tuple[Link, ...] = ()
    shift: float | Floats = 0.0
    _latest: dict[bytes, tuple[Floats, Floats]] = field(default_factory=dict, init=False, repr=False)

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Residuals, shape (residuals,), and their derivatives, shape (residuals, unknowns)."""
        key = unknowns.tobytes()
        if key not in self._latest:
            self._latest.clear()
            self._latest[key] = self._residuals_and_derivatives(unknowns)
        residuals, derivatives = self._latest[key]
        return residuals.copy(), derivatives.copy()

    def _residuals_and_derivatives(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Residuals and their derivatives, without use of the latest ones."""
        unit, parts = np.eye(len(unknowns)), []
        branches = [experiment.branch(unknowns) for experiment in self.experiments]
        for experiment, branch in zip(self.experiments, branches, strict=True):
            signals, rates = branch.signals, branch.derivatives
            values, level = experiment.measurements.values, experiment.deviations[:, None]
            seen, rows = np.isfinite(values), slice(len(level))
            parts.append((((signals[rows] - values) / level)[seen], (rates[rows] / level[..., None])[seen]))
            for name, (instants, slopes) in experiment.instants(branch).items():
                times, deviation = experiment.measurements.instants[name]
                seen = np.isfinite(times)
                parts.append((((instants - times) / deviation)[seen], slopes[seen] / deviation))
        for link in self.links:
            branch, rows, columns, level = branches[link.experiment], [*link.signals], [*link.columns], link.deviations
            gap, slope = branch.signals[rows, -1] - unknowns[columns], branch.derivatives[rows, -1] - unit[columns]
            parts.append((gap / level, slope / level[:, None]))
        for prior in self.problem.priors:
            gap = unknowns[[prior.column]] - prior.mean
            parts.append((gap / prior.deviation, unit[[prior.column]] / prior.deviation))
        residuals, derivatives = (np.concatenate(column) for column in zip(*parts, strict=True))
        return residuals + self.shift, derivatives

    def rounded_to_zero(self, unknowns: Floats) -> Floats:
        """Unknowns, with 0 in place of those that are negligible beside their start values."""
        typical = np.where(self.start == 0, 1.0, np.abs(self.start))
        return np.where(np.abs(unknowns) < _NEGLIGIBLE * typical, 0.0, unknowns)

    def null_space(self, unknowns: Floats) -> NullSpace:
        """Null space of the derivatives of the residuals at values of the unknowns."""
        return NullSpace.from_jacobian(self(unknowns)[1], self.rounded_to_zero(unknowns), self.measurement_norm)

    @property
    def measurement_norm(self) -> float:
        """Norm of all measured values, each divided by its standard deviation."""
        parts = [np.nan_to_num(e.measurements.values / e.deviations[:, None]).ravel() for e in self.experiments]
        parts += [np.nan_to_num(t / level) for e in self.experiments for t, level in e.measurements.instants.values()]
        return float(np.linalg.norm(np.concatenate(parts)))


@final
@dataclass(frozen=True, eq=False)
class FittingProblem:
    """A subject, its measurements and its unknowns.

    :param names: of the unknowns, element by element; ``"theta_0 (2)"`` belongs to the second experiment.
    :param units: of the unknowns.
    :param columns: of each experiment: name -> index among the unknowns.
    :param start: values of the unknowns at which the search begins.
    :param limits: least and largest values of the unknowns, shape (2, unknowns).
    :param noise: standard deviations of the signals of each experiment; None: unknown.
    :param loss: one of :data:`liaisons_motion.identification.minimising.LOSSES`.
    :param starts: name of a start value -> output that has this value at the start.
    :param operators: active coordinate -> operator.
    :param tolerance: of steps.
    :param deadline: of a search, on the clock of ``time.monotonic`` [s].
    """

    subject: Any
    measurements: tuple[Measurements, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[Mapping[str, int], ...]
    start: Floats
    limits: Floats
    noise: tuple[Floats, ...] | None
    priors: tuple[Prior, ...]
    loss: str
    starts: Mapping[str, str]
    start_values: Mapping[str, Any]
    operators: Mapping[str, Target]
    tolerance: float
    deadline: float = math.inf

    @property
    def value_count(self) -> int:
        """Number of measured values."""
        return sum(data.value_count for data in self.measurements)

    def build_objective(self, unknowns: Floats, deviations: Sequence[Floats]) -> Objective:
        """Build the objective of single shooting; step sizes of its motions are chosen once, for these unknowns.

        :param deviations: standard deviation of each measurement.
        """
        experiments = (
            self._measured_motion(data, columns, unknowns, level)
            for data, columns, level in zip(self.measurements, self.columns, deviations, strict=True)
        )
        return Objective(self, tuple(experiments), self.start, self.limits)

    def _measured_motion(
        self,
        data: Measurements,
        columns: Mapping[str, int],
        unknowns: Floats,
        deviations: Floats,
        *,
        start_time: float | None = None,
        record: Sequence[str] | None = None,
    ) -> MeasuredMotion:
        """Motion of an experiment, with step sizes chosen at values of the unknowns.

        :param record: signals, those of the measurements first; None: those of the measurements.
        """
        own = {name: column for name, column in columns.items() if name != TIME_OFFSET}
        offset, start = columns.get(TIME_OFFSET), data.start_time if start_time is None else start_time
        motion = motion_of(
            self.subject,
            list(own),
            _simulated_times(data, start) + (0.0 if offset is None else unknowns[offset]),
            start_time=start,
            record=list(record or data.signals),
            inputs=data.inputs,
            start_values={**self.start_values, **{name: float(unknowns[column]) for name, column in own.items()}},
            operators=self.operators,
            tolerance=self.tolerance,
        )
        return MeasuredMotion(data, motion.frozen(motion.values), tuple(own.values()), offset, deviations)

    def multiple_shooting_objective(self, unknowns: Floats, deviations: Sequence[Floats], count: int) -> Objective:
        """Objective of multiple shooting: segments with start values of their own, and links between them.

        Its unknowns are those of the problem, then the start values of all segments but the first.  A time offset is
        constant; instants of impacts are left out.
        """
        experiments: list[MeasuredMotion] = []
        links: list[Link] = []
        values = unknowns.copy()
        for data, columns, level in zip(self.measurements, self.columns, deviations, strict=True):
            if TIME_OFFSET in columns:
                data = replace(data, times=data.times + unknowns[columns[TIME_OFFSET]])  # noqa: PLW2901
            own = {name: column for name, column in columns.items() if name != TIME_OFFSET}
            record = list(dict.fromkeys([*data.signals, *self.starts.values()]))
            rows = tuple(record.index(output) for output in self.starts.values())
            whole = self._measured_motion(data, own, unknowns, level, record=record)
            signals = whole.branch(unknowns).signals[list(rows)]
            edges = np.unique(np.linspace(0, len(data.times) - 1, count + 1).astype(int)).tolist()
            states = self._smoothed_start_values(data, edges, signals)
            most = edges[1] // 2
            for i, edge in list(enumerate(edges))[1:-1] if whole.motion.has_contacts else ():
                edges[i], states[:, i] = self._nearest_possible_start(whole, unknowns, edge, most, signals)
            size = np.ptp(states, axis=1)
            for start, state in zip(self.starts, states, strict=True):
                if start in own and data.times[0] == data.start_time:
                    values[own[start]] = state[0]
            for i, (first, last) in enumerate(pairwise(edges)):
                if i:
                    own |= {name: len(values) + k for k, name in enumerate(self.starts)}
                    start_columns = tuple(own[name] for name in self.starts)
                    links.append(Link(len(experiments) - 1, rows, start_columns, np.where(size > 0, size, 1.0)))
                    values = np.append(values, states[:, i])
                segment_values = data.values[:, first : last + 1].copy()
                if last < edges[-1]:
                    segment_values[:, -1] = np.nan  # the next segment begins with it
                segment = replace(data, times=data.times[first : last + 1], values=segment_values, instants={})
                begin = float(segment.times[0]) if i else None
                experiments.append(self._measured_motion(segment, own, values, level, start_time=begin, record=record))
        free = np.full((2, len(values) - len(unknowns)), [[-np.inf], [np.inf]])
        limits = np.hstack([self.limits, free])
        values = np.clip(values, *limits)
        return Objective(self, tuple(experiments), values, limits, tuple(links))

    def _smoothed_start_values(self, data: Measurements, indices: Sequence[int], fallback: Floats) -> Floats:
        """Start values, smoothed from the data, of motions from measured times, shape (start values, indices)."""
        rows = zip(self.starts.values(), fallback, strict=True)
        return np.array([smoothed_values(data, output, indices, row[list(indices)]) for output, row in rows])

    def _nearest_possible_start(
        self, whole: MeasuredMotion, unknowns: Floats, index: int, max_shift: int, fallback: Floats
    ) -> tuple[int, Floats]:
        """Index of the nearest time at which no bodies overlap, and smoothed start values there.

        :param index: of the intended time; ``max_shift``: by how many times a start may be later or earlier.
        :param fallback: start values at each time, taken where there is no such time.
        """
        data, columns = whole.measurements, dict(zip(whole.motion.names, whole.columns, strict=True))
        columns |= {name: len(unknowns) + k for k, name in enumerate(self.starts)}
        for i in sorted(range(index - max_shift, index + max_shift), key=lambda i: abs(i - index)):
            state = self._smoothed_start_values(data, [i], fallback)[:, 0]
            instant, options = replace(data, times=data.times[[i]], instants={}), {"start_time": float(data.times[i])}
            motion = self._measured_motion(
                instant, columns, np.append(unknowns, state), whole.deviations, record=whole.motion.signals, **options
            ).motion
            try:
                motion(motion.values)
            except SimulationError:
                continue
            return i, state
        return index, fallback[:, index]


def _simulated_times(data: Measurements, start_time: float) -> Floats:
    """Times of the measurements, and a time a mean distance after the last measured instant of an impact."""
    lasts = [(np.nanmax(times), len(times)) for times, _ in data.instants.values()]
    end = max((last + (last - start_time) / count for last, count in lasts), default=-math.inf)
    return np.append(data.times, [end] if end > data.times[-1] else [])


def _extrapolated_instants(instants: Floats, slopes: Floats, count: int, motion: Motion) -> tuple[Floats, Floats]:
    """First ``count`` instants of impacts and their derivatives; those that a motion lacks, at the last distance."""
    rows, constant = np.column_stack([instants, slopes]), np.zeros(slopes.shape[1])
    start, end = (np.append(time, constant) for time in (motion.start_time, motion.times[-1]))
    before, last = np.vstack([start, rows if len(rows) else end])[-2:]
    missing = np.arange(1, 1 + count - len(rows))[:, None]
    rows = np.vstack([rows, last + missing * (last - before)])[:count]
    return rows[:, 0], rows[:, 1:]


def smoothed_values(data: Measurements, output: str, indices: Sequence[int], fallback: Floats) -> Floats:
    """Values of an output at some times, from parabolas fitted to nearby measurements of it or of its integral.

    :param indices: of the times.
    :param fallback: values to return if neither was measured.
    """
    name, _ = array_and_index(output)
    base = name.removesuffix("_dot") + output[len(name) :]
    signal = output if output in data.signals else base
    if signal not in data.signals:
        return fallback
    values = data.values[data.signals.index(signal)]
    times, values = data.times[np.isfinite(values)], values[np.isfinite(values)]
    near = np.empty(len(indices))
    for i, time in enumerate(data.times[indices]):
        closest = np.argsort(np.abs(times - time))[:_PARABOLA_POINTS]
        parabola = np.polynomial.Polynomial.fit(times[closest], values[closest], min(2, len(closest) - 1))
        near[i] = (parabola if signal == output else parabola.deriv())(time)
    return near
