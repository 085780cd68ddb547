"""Verdicts on a fit: replay through the FMUs, determinacy, residual tests, variances and convergence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.stats import chi2, norm, t

from liaisons import Result, System, Verdict, build, fmu_path, operator, simulate, verdict
from liaisons.base.folders import process_folder
from liaisons.cosim import SystemDocument
from liaisons.mechanics import Model
from liaisons_motion.derivatives import input_functions
from liaisons_motion.identification.estimates import ParameterEstimate
from liaisons_motion.identification.problems import TIME_OFFSET, FittingProblem, Floats, MeasuredMotion

_FALSE_ALARM = 1e-3
"""Probability that the residual tests of a right fit fail, all together."""
_MAX_LAGS, _MIN_COUNT = 10, 8
_REFITS = 200
_VARIANCE_CONFIDENCE = 0.99
_NEGLIGIBLE_DEVIATION = 0.01
"""Error, in standard deviations, that does not matter."""
_REPLAY_TOLERANCE = 1e-6
"""Difference between FMU and fitted motion, relative to the size of a signal, that passes."""
_SOLVER_TOLERANCE = 1e-12
_MARGIN = 1e-6
"""Distance of a communication point from an impact, relative to the duration."""
_MIN_STEPS = 1000
"""Least number of communication steps; motions of operators are interpolated within a step."""


@lru_cache(maxsize=1)  # film and verdicts share the runs
def replays(estimate: ParameterEstimate) -> tuple[Result, ...]:
    """Results of the FMUs for each experiment, with the times of its measurements as communication points."""
    problem, values = estimate.problem, estimate.values.tolist()
    return tuple(
        _run_experiment(
            problem,
            experiment,
            {name: values[column] for name, column in columns.items() if name != TIME_OFFSET},
            [times.ravel() for times in impact_sides(estimate, i).values()],
        )
        for i, (experiment, columns) in enumerate(zip(estimate.objective.experiments, problem.columns, strict=True))
    )


def impact_sides(estimate: ParameterEstimate, experiment: int) -> dict[str, Floats]:
    """Times [s] just before and just after the fitted impacts of an experiment, shape (2, impacts)."""
    chosen = estimate.objective.experiments[experiment]
    begin = chosen.measurements.start_time
    delay = 0.0 if chosen.offset is None else estimate.values[chosen.offset]
    margin = _MARGIN * (chosen.motion.times[-1] - begin)
    return {
        name: np.maximum(times + delay + margin * np.array([[-1], [1]]), begin)
        for name, times in estimate.instants[experiment].items()
    }


def _run_experiment(
    problem: FittingProblem, experiment: MeasuredMotion, values: Mapping[str, float], further: Sequence[Floats]
) -> Result:
    """Simulate the FMUs with the inputs of an experiment, with further communication points."""
    starts = {**problem.start_values, **values}
    data, subject = experiment.measurements, problem.subject
    ends = np.unique(np.concatenate([[data.start_time], experiment.motion.times, *further]))
    most = np.ptp(ends) / _MIN_STEPS
    inner = [np.linspace(a, b, int(np.ceil((b - a) / most)), endpoint=False) for a, b in pairwise(ends)]
    times = np.append(np.concatenate(inner), ends[-1])
    if isinstance(subject, System):
        inputs = input_functions(subject.document, data.inputs)
        return subject.with_start_values(starts).simulate(times=times, tolerance=_SOLVER_TOLERANCE, inputs=inputs)
    for name, target in problem.operators.items():
        own = [start for start in starts if start.startswith(f"{name}.")]
        starts[name] = operator(target, start_values={start.partition(".")[2]: starts.pop(start) for start in own})
    if isinstance(subject, Model):
        fmu = build(subject, process_folder())
    else:
        fmu = Path(subject) if str(subject).endswith(".fmu") else fmu_path(subject)
    inputs = input_functions(SystemDocument.of_fmu(fmu), data.inputs)
    return simulate(fmu, times=times, tolerance=_SOLVER_TOLERANCE, inputs=inputs, start_values=starts)


def verdicts(estimate: ParameterEstimate, replays: Sequence[Result]) -> Iterator[Verdict]:
    """Yield all verdicts on an estimate: replay, determinacy, residual tests, variances, finer steps.

    :param replays: results of the FMUs at the fitted values.
    """
    problem = estimate.problem
    yield verdict("least squares came to its end", error=float(bool(estimate.minimum.message)), tolerance=0.0)
    count = float(estimate.null_space.directions.shape[1])
    yield verdict("measurements determine all unknowns", error=count, tolerance=0.0)
    unknown = float(not estimate.has_noise_estimate)
    yield verdict("the noise is given, or residuals are left that show it", error=unknown, tolerance=0.0)
    yield _replay_verdict(estimate, replays)
    if not unknown:
        yield from residual_tests(estimate)
    if problem.noise and problem.loss == "linear" and estimate.degrees_of_freedom > 0:
        square, freedom = 2 * estimate.minimum.cost, estimate.degrees_of_freedom
        text = f"residuals are as large as the noise: chi-squared {square:.4g} of {freedom}"
        yield _two_sided_verdict(text, square, freedom, _FALSE_ALARM)
    yield from _variance_verdicts(estimate)
    yield _finer_steps_verdict(estimate)


def _replay_verdict(estimate: ParameterEstimate, replays: Sequence[Result]) -> Verdict:
    """Verdict on the runs of the FMUs, relative to the size of each signal or a hundredth of the noise.

    Impacts must have been counted within this part of the duration.
    """
    errors = [0.0]
    rows = zip(estimate.objective.experiments, estimate.fitted_signals, replays, strict=True)
    for i, (experiment, fitted, replay) in enumerate(rows):
        data, levels = experiment.measurements, experiment.deviations
        for name, signal, level in zip(data.signals, fitted, levels, strict=True):
            size = max(np.abs(signal).max(), level * _NEGLIGIBLE_DEVIATION / _REPLAY_TOLERANCE)
            played = replay[name][np.searchsorted(replay.time, experiment.motion.times[: len(signal)])]
            errors.append(float(np.abs(played - signal).max() / size))
        for name, ends in impact_sides(estimate, i).items():
            counts = replay[name][np.searchsorted(replay.time, ends)]
            errors += np.abs(counts - np.arange(ends.shape[1]) - [[0], [1]]).ravel().tolist()
    text = "replayed through the FMUs, the motion is the fitted one"
    return verdict(text, error=max(errors), tolerance=_REPLAY_TOLERANCE, reason="relative, or a hundredth of the noise")


def residual_tests(estimate: ParameterEstimate) -> Iterator[Verdict]:
    """Yield tests of the residuals of each signal; with a robust loss only that of whiteness."""
    parts = list(estimate.standardised_residuals())
    chance = _FALSE_ALARM / (len(parts) * (3 if estimate.problem.loss == "linear" else 1))
    reason = f"chance {_FALSE_ALARM:g} in all of them"
    for label, r, rounding, regressors in parts:
        if np.abs(r).max() <= rounding:
            text = f"residuals of {label} are the rounding of its motion"
            yield verdict(text, error=float(np.abs(r).max()), tolerance=rounding, reason="the solver's tolerance")
            continue
        lags = min(_MAX_LAGS, len(r) // 4)
        if lags:
            text = f"residuals of {label} are white: Ljung and Box's sum over {lags} lags"
            bound = float(chi2.isf(chance, lags))
            yield verdict(text, error=ljung_box_statistic(r, lags), tolerance=bound, reason=reason)
        if estimate.problem.loss == "linear" and len(r) >= _MIN_COUNT:
            text = f"residuals of {label} keep their size: Glejser's test of growth with time and signal"
            yield verdict(
                text,
                error=glejser_statistic(r, regressors),
                tolerance=float(chi2.isf(chance, len(regressors))),
                reason=reason,
            )
            text = f"residuals of {label} have no outlier: Grubbs's ratio of the largest to all"
            yield verdict(text, error=grubbs_ratio(r), tolerance=grubbs_bound(len(r), chance), reason=reason)


def ljung_box_statistic(residuals: Floats, lag_count: int) -> float:
    """Ljung and Box's statistic of residuals, for white noise chi-squared with ``lag_count`` degrees of freedom."""
    r, n, lags = residuals, len(residuals), np.arange(1, lag_count + 1)
    correlation = np.array([r[k:] @ r[:-k] for k in lags]) / (r @ r)
    return n * (n + 2) * float(np.sum(correlation**2 / (n - lags)))


def glejser_statistic(residuals: Floats, regressors: Floats) -> float:
    """Number of residuals times the squared correlation of their sizes with the regressors, shape (k, residuals).

    For constant noise chi-squared with k degrees of freedom (Glejser, Journal of the American Statistical Association
    64 (1969) 316-323).
    """
    sizes = np.abs(residuals) - np.abs(residuals).mean()
    centred = regressors - regressors.mean(axis=1, keepdims=True)
    columns = (centred / np.maximum(np.abs(centred).max(axis=1, keepdims=True), np.finfo(float).tiny)).T
    explained = columns @ np.linalg.lstsq(columns, sizes)[0]
    return len(residuals) * float(explained @ explained / (sizes @ sizes))


def grubbs_ratio(residuals: Floats) -> float:
    """Largest deviation of residuals from their mean, divided by their standard deviation."""
    return float(np.abs(residuals - residuals.mean()).max() / np.std(residuals, ddof=1))


def grubbs_bound(count: int, chance: float) -> float:
    """Bound that Grubbs's ratio of ``count`` normal numbers exceeds with at most a probability.

    Grubbs, Technometrics 11 (1969) 1-21.
    """
    square = float(t.isf(chance / (2 * count), count - 2)) ** 2
    return (count - 1) / count**0.5 * (square / (count - 2 + square)) ** 0.5


def _variance_verdicts(estimate: ParameterEstimate) -> Iterator[Verdict]:
    """Verdicts on the variances of fits to simulated measurements."""
    sure = np.flatnonzero(np.isfinite(estimate.standard_errors)).tolist()
    if not sure:
        return
    ratios = np.var(estimate.bootstrap_fits(_REFITS)[:, sure], axis=0, ddof=1) / estimate.standard_errors[sure] ** 2
    for i, ratio in zip(sure, ratios.tolist(), strict=True):
        name = estimate.problem.names[i]
        text = f"the variance of {name} in {_REFITS} fits to simulated measurements is {ratio:.2f} times as large"
        yield _two_sided_verdict(text, (_REFITS - 1) * ratio, _REFITS - 1, (1 - _VARIANCE_CONFIDENCE) / len(sure))


def _two_sided_verdict(claim: str, statistic: float, freedom: int, chance: float) -> Verdict:
    """Two-sided verdict on a chi-squared statistic, in equivalent normal deviations."""
    error = norm.isf(min(chi2.cdf(statistic, freedom), chi2.sf(statistic, freedom)))
    reason = f"normal deviations that have the chance {chance:g}"
    return verdict(claim, error=float(abs(error)), tolerance=float(norm.isf(chance / 2)), reason=reason)


def _finer_steps_verdict(estimate: ParameterEstimate) -> Verdict:
    """Verdict on the change of the values at a tenth of the integration tolerance, in standard errors."""
    errors = estimate.standard_errors
    change = np.abs(estimate.minimum_with_finer_steps().values - estimate.values) / errors
    text = "steps of a tenth of the tolerance give the same values"
    return verdict(
        text, error=float(np.nanmax(change, initial=0.0)), tolerance=_NEGLIGIBLE_DEVIATION, reason="standard errors"
    )
