"""Search for the estimate: single shooting first, multiple shooting if residuals stay far above the noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from liaisons.errors import LiaisonsError
from liaisons_motion.identification.estimates import ROUNDING, ParameterEstimate
from liaisons_motion.identification.minimising import Minimum, minimise
from liaisons_motion.identification.problems import FittingProblem, Floats, Objective

_MAX_REFINEMENTS = 20
_CONVERGED = 1e-6
"""Relative change of unknowns and noise that ends the refinement."""
_POOR_FIT = 2.0
"""Median residual, in standard deviations, above which the fit is poor."""
_INITIAL_NOISE = 0.1
"""Initial guess of unknown noise, relative to the standard deviation of the signal."""
_SEGMENT_COUNTS = (8, 32)
_LINK_DEVIATIONS = 10.0 ** -np.arange(8)
"""Standard deviations of links, one after another, relative to the size of the states."""
_NEAR_BOUND = 0.05
"""Distance to a bound, in standard errors, below which the bound itself is tried."""
_LEAST_DEVIATION = 1e-100
"""Standard deviation of a signal that is 0: small, but squares of quotients do not overflow."""
_DEVIATION_PER_MEDIAN = 1.4826
"""Standard deviation of normal numbers, divided by the median of their absolute values."""


def parameter_estimate(problem: FittingProblem, segments: int | None = None) -> ParameterEstimate:
    """Estimate of the unknowns that minimise the objective.

    :param segments: of multiple shooting; 1: single shooting; None: single shooting, then multiple shooting with more
        and more segments until residuals are near the noise.
    :raises LiaisonsError: if no motion is possible at the start values.
    """
    levels = problem.noise or _initial_noise(problem)
    best: Minimum | None = None
    failure: LiaisonsError | None = None
    affordable = (count for count in _SEGMENT_COUNTS if count * len(problem.starts) <= problem.value_count)
    for count in (1, *affordable) if segments is None else (segments,):
        try:
            start = problem.start if count == 1 else _start_by_multiple_shooting(problem, levels, count)
            objective = problem.build_objective(start, levels)
            minimum = _minimum_with_undetermined_held(objective, start)[0]
        except LiaisonsError as error:
            failure = failure or error
            continue
        if best is None or minimum.cost < best.cost:
            best = minimum
        if _DEVIATION_PER_MEDIAN * np.median(np.abs(objective(best.values)[0])) <= _POOR_FIT:
            break
    if best is None:
        raise failure or AssertionError
    estimate = _estimate_with_residual_noise(problem, best, levels)
    without_deadline = replace(problem, deadline=math.inf)  # to verify it takes time of its own
    return replace(estimate, objective=replace(estimate.objective, problem=without_deadline))


def _initial_noise(problem: FittingProblem) -> tuple[Floats, ...]:
    """Initial guesses of the standard deviation of each signal, by experiment."""
    columns: dict[str, list[Floats]] = {}
    for data in problem.measurements:
        for name, values in zip(data.signals, data.values, strict=True):
            columns.setdefault(name, []).append(values)
    levels = {
        name: _INITIAL_NOISE * (float(np.nanstd(np.concatenate(parts))) or 1.0) for name, parts in columns.items()
    }
    return tuple(np.array([levels[name] for name in data.signals]) for data in problem.measurements)


def _start_by_multiple_shooting(problem: FittingProblem, levels: Sequence[Floats], count: int) -> Floats:
    """Unknowns at which to begin single shooting, from multiple shooting with links tightened step by step."""
    objective = problem.multiple_shooting_objective(problem.start, levels, count)
    values = objective.start
    held = objective.null_space(values).unknowns_to_hold
    for factor in _LINK_DEVIATIONS:
        links = tuple(replace(link, deviations=factor * link.deviations) for link in objective.links)
        values = minimise(replace(objective, links=links), values, held).values
    return values[: len(problem.start)]


def _minimum_with_undetermined_held(objective: Objective, start: Floats) -> tuple[Minimum, tuple[int, ...]]:
    """Minimum with as many unknowns held as are undetermined, and their indices."""
    held = objective.null_space(start).unknowns_to_hold
    while True:
        minimum = minimise(objective, start, held)
        fewer = objective.null_space(minimum.values).unknowns_to_hold
        if len(fewer) >= len(held):
            return minimum, tuple(held)
        start, held = minimum.values, fewer


def _estimate_with_residual_noise(
    problem: FittingProblem, minimum: Minimum, levels: Sequence[Floats]
) -> ParameterEstimate:
    """Estimate with step sizes and noise of its own, repeated until neither changes."""
    rounds = 0
    while True:
        rounds += 1
        objective = problem.build_objective(minimum.values, levels)
        before, (minimum, held) = minimum, _minimum_with_undetermined_held(objective, minimum.values)
        estimate = _moved_to_bounds(ParameterEstimate(objective, minimum, held))
        scales = np.fmax(np.abs(minimum.values), estimate.standard_errors)
        settled = np.all(np.abs(minimum.values - before.values) <= _CONVERGED * scales)
        if problem.noise is None:
            noise = _residual_noise(estimate)
            ratio = np.abs(np.log(np.concatenate(noise) / np.concatenate(levels)))
            settled, levels = settled and ratio.max() < _CONVERGED, noise
        if settled or minimum.message or rounds == _MAX_REFINEMENTS:
            return estimate


def _moved_to_bounds(estimate: ParameterEstimate) -> ParameterEstimate:
    """Estimate with unknowns moved to a nearby bound where the cost falls towards it."""
    values, (low, high) = estimate.values, estimate.objective.limits
    gradient = np.einsum("r,ri->i", *estimate.linearization)
    errors = estimate.standard_errors
    onto = values.copy()
    for bound, sign in ((low, 1), (high, -1)):
        pressed = (np.abs(values - bound) < _NEAR_BOUND * errors) & (sign * gradient > 0)
        onto[pressed] = bound[pressed]
    at_bound = tuple(np.flatnonzero(onto != values).tolist())
    if not at_bound:
        return estimate
    minimum = minimise(estimate.objective, onto, {*estimate.held, *at_bound})
    return replace(estimate, minimum=minimum, at_bound=at_bound)


def _residual_noise(estimate: ParameterEstimate) -> tuple[Floats, ...]:
    """Standard deviations estimated from residuals, one for each signal, by experiment."""
    problem, columns = estimate.problem, {}
    experiments = estimate.objective.experiments
    for experiment, fitted in zip(experiments, estimate.fitted_signals, strict=True):
        data = experiment.measurements
        for name, r, signal in zip(data.signals, data.values - fitted, fitted, strict=True):
            columns.setdefault(name, []).append((r[np.isfinite(r)], ROUNDING * np.abs(signal).max()))
    count = len(estimate.linearization[0])
    spread = np.sqrt(count / max(1, estimate.degrees_of_freedom))
    levels = {}
    for name, parts in columns.items():
        r = np.concatenate([part for part, _ in parts])
        size = np.sqrt(np.mean(r**2)) if problem.loss == "linear" else _DEVIATION_PER_MEDIAN * np.median(np.abs(r))
        levels[name] = max(spread * size, *(rounding for _, rounding in parts), _LEAST_DEVIATION)
    return tuple(np.array([levels[name] for name in e.measurements.signals]) for e in experiments)
