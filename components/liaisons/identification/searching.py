"""From start values to an estimate: single shooting, and multiple shooting where that leads nowhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from liaisons.errors import LiaisonsError
from liaisons.identification.estimates import ROUNDING, ParameterEstimate
from liaisons.identification.minimising import Minimum, minimise
from liaisons.identification.problems import FittingProblem, Floats, Objective

_ROUNDS = 20
_SETTLED = 1e-6
_POOR = 2.0
"""Residuals of so many standard deviations are far above the noise."""
_ASSUMED = 0.1
"""Standard deviation of a signal while its noise is unknown, relative to that of its values."""
_SEGMENTS = (8, 32)
_LINKS = 10.0 ** -np.arange(8)
"""Standard deviations of links, relative to the size of the states."""
_NEAR = 0.05
"""What is nearer to a bound, relative to its standard deviation, may be at it."""
_LEAST = 1e-100
"""Standard deviation of a signal that stays 0; squares of what is divided by it do not overflow."""
_NORMAL = 1.4826
"""Standard deviation of normal numbers, relative to the median of their absolute values."""


def estimated(problem: FittingProblem, segments: int | None = None) -> ParameterEstimate:
    """The best estimate.

    :param segments: of multiple shooting; 1: single shooting; None: single shooting, and multiple shooting with more
        and more segments as long as residuals are far above the noise.
    :raises LiaisonsError: if no motion is possible at the start values.
    """
    levels = problem.noise or _assumed(problem)
    best: Minimum | None = None
    failure: LiaisonsError | None = None
    affordable = (count for count in _SEGMENTS if count * len(problem.starts) <= problem.count)
    for count in (1, *affordable) if segments is None else (segments,):
        try:
            start = problem.start if count == 1 else _linked(problem, levels, count)
            objective = problem.objective(start, levels)
            minimum = _determined(objective, start)[0]
        except LiaisonsError as error:
            failure = failure or error
            continue
        if best is None or minimum.cost < best.cost:
            best = minimum
        if not _is_poor(objective, best):
            break
    if best is None:
        raise failure or AssertionError
    estimate = _refined(problem, best, levels)
    return replace(  # to verify it takes time of its own
        estimate,
        problem=replace(problem, deadline=math.inf),
        objective=replace(estimate.objective, deadline=math.inf),
    )


def _assumed(problem: FittingProblem) -> tuple[Floats, ...]:
    """Standard deviations of signals whose noise is unknown; one for a name in all experiments."""
    columns: dict[str, list[Floats]] = {}
    for data in problem.measurements:
        for name, values in zip(data.signals, data.values, strict=True):
            columns.setdefault(name, []).append(values)
    levels = {name: _ASSUMED * (float(np.nanstd(np.concatenate(parts))) or 1.0) for name, parts in columns.items()}
    return tuple(np.array([levels[name] for name in data.signals]) for data in problem.measurements)


def _is_poor(objective: Objective, minimum: Minimum) -> bool:
    return _NORMAL * float(np.median(np.abs(objective(minimum.values)[0]))) > _POOR


def _linked(problem: FittingProblem, levels: Sequence[Floats], count: int) -> Floats:
    """Start values by multiple shooting, whose links become closer and closer."""
    objective, values = problem.segments(problem.start, levels, count)
    held = objective.null_space(values).dependent
    for factor in _LINKS:
        values = minimise(objective.linked(factor), values, held).values
    return values[: len(problem.start)]


def _determined(objective: Objective, start: Floats) -> tuple[Minimum, tuple[int, ...]]:
    """The minimum where unknowns that are not determined are held, and which these are."""
    held = objective.null_space(start).dependent
    while True:
        minimum = minimise(objective, start, held)
        fewer = objective.null_space(minimum.values).dependent
        if len(fewer) >= len(held):
            return minimum, tuple(held)
        start, held = minimum.values, fewer


def _refined(problem: FittingProblem, minimum: Minimum, levels: Sequence[Floats]) -> ParameterEstimate:
    """The estimate with steps that are chosen at its values, and with the noise that its residuals show."""
    rounds = 0
    while True:
        rounds += 1
        objective = problem.objective(minimum.values, levels)
        before, (minimum, held) = minimum, _determined(objective, minimum.values)
        estimate = _bounded(ParameterEstimate(problem, objective, minimum, held))
        scales = np.fmax(np.abs(minimum.values), estimate.standard_errors)
        settled = np.all(np.abs(minimum.values - before.values) <= _SETTLED * scales)
        if problem.noise is None:
            shown = _shown(estimate)
            ratio = np.abs(np.log(np.concatenate(shown) / np.concatenate(levels)))
            settled, levels = settled and ratio.max() < _SETTLED, shown
        if settled or minimum.message or rounds == _ROUNDS:
            return estimate


def _bounded(estimate: ParameterEstimate) -> ParameterEstimate:
    """The estimate with unknowns that are next to a bound put onto it, if it is the better for that."""
    values, (low, high) = estimate.values, estimate.objective.limits
    gradient = np.einsum("r,ri->i", *estimate.linearization)
    errors = estimate.standard_errors
    onto = values.copy()
    for bound, sign in ((low, 1), (high, -1)):
        pressed = (np.abs(values - bound) < _NEAR * errors) & (sign * gradient > 0)
        onto[pressed] = bound[pressed]
    at_bound = tuple(np.flatnonzero(onto != values).tolist())
    if not at_bound:
        return estimate
    minimum = minimise(estimate.objective, onto, {*estimate.held, *at_bound})
    return replace(estimate, minimum=minimum, at_bound=at_bound)


def _shown(estimate: ParameterEstimate) -> tuple[Floats, ...]:
    """Standard deviations of the signals as their residuals show them; one for a name in all experiments."""
    problem, columns = estimate.problem, {}
    experiments = estimate.objective.experiments
    for experiment, fitted in zip(experiments, estimate.fitted, strict=True):
        data = experiment.measurements
        for name, r, signal in zip(data.signals, data.values - fitted, fitted, strict=True):
            columns.setdefault(name, []).append((r[np.isfinite(r)], ROUNDING * np.abs(signal).max()))
    count = len(estimate.linearization[0])
    spread = np.sqrt(count / max(1, estimate.freedom))
    levels = {}
    for name, parts in columns.items():
        r = np.concatenate([part for part, _ in parts])
        size = np.sqrt(np.mean(r**2)) if problem.loss == "linear" else _NORMAL * np.median(np.abs(r))
        levels[name] = max(spread * size, *(rounding for _, rounding in parts), _LEAST)
    return tuple(np.array([levels[name] for name in e.measurements.signals]) for e in experiments)
