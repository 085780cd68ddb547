"""What makes a fit believed: that least squares came to an end is never enough."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.stats import chi2, norm, t

from liaisons.check import Verdict, verdict
from liaisons.identification.estimates import ParameterEstimate
from liaisons.identification.problems import Floats
from liaisons.results import Result

_CHANCE = 1e-3
"""Of all tests of residuals together, to fail where all is well."""
_LAGS, _FEWEST = 10, 8
_REFITS = 200
_BAND = 0.99
_DEVIATION = 0.01
"""What is less of a standard deviation or error does not matter."""
_EXACT = 1e-6
"""By how much FMUs and fitted motion may differ, relative to the size of a signal."""


def verdicts(estimate: ParameterEstimate, replays: Sequence[Result]) -> Iterator[Verdict]:
    """All of them.

    :param replays: the fitted motions as the FMUs perform them.
    """
    problem = estimate.problem
    ended = 0.0 if not estimate.minimum.message else 1.0
    yield verdict("least squares came to its end", error=ended, tolerance=0.0)
    count = float(estimate.null_space.directions.shape[1])
    yield verdict("measurements determine all unknowns", error=count, tolerance=0.0)
    unknown = float(not estimate.tells_noise)
    yield verdict("the noise is given, or residuals are left that show it", error=unknown, tolerance=0.0)
    yield _replayed(estimate, replays)
    if not unknown:
        yield from residual_tests(estimate)
    if problem.noise and problem.loss == "linear" and estimate.freedom > 0:
        yield _size(estimate)
    yield from _variances(estimate)
    yield _finer(estimate)


def _replayed(estimate: ParameterEstimate, replays: Sequence[Result]) -> Verdict:
    """In each signal, relative to its size, or where that is more to its standard deviation."""
    errors = [0.0]
    for experiment, fitted, replay in zip(estimate.objective.experiments, estimate.fitted, replays, strict=True):
        data, levels = experiment.measurements, experiment.deviations
        for name, signal, level in zip(data.signals, fitted, levels, strict=True):
            size = max(np.abs(signal).max(), level * _DEVIATION / _EXACT)
            played = replay[name][np.searchsorted(replay.time, experiment.motion.times)]
            errors.append(float(np.abs(played - signal).max() / size))
    text = "replayed through the FMUs, the motion is the fitted one"
    return verdict(text, error=max(errors), tolerance=_EXACT, reason="relative, or a hundredth of the noise")


def residual_tests(estimate: ParameterEstimate) -> Iterator[Verdict]:
    """Tests of the residuals of each signal; a robust loss takes noise of any size and with any tails."""
    parts = list(estimate.standardised())
    chance = _CHANCE / (len(parts) * (3 if estimate.problem.loss == "linear" else 1))
    reason = f"chance {_CHANCE:g} in all of them"
    for label, r, rounding, grows_with in parts:
        if np.abs(r).max() <= rounding:
            text = f"residuals of {label} are the rounding of its motion"
            yield verdict(text, error=float(np.abs(r).max()), tolerance=rounding, reason="the solver's tolerance")
            continue
        lags = min(_LAGS, len(r) // 4)
        if lags:
            text = f"residuals of {label} are white: Ljung and Box's sum over {lags} lags"
            bound = float(chi2.isf(chance, lags))
            yield verdict(text, error=whiteness(r, lags), tolerance=bound, reason=reason)
        if estimate.problem.loss == "linear" and len(r) >= _FEWEST:
            text = f"residuals of {label} keep their size: Glejser's test of growth with time and signal"
            yield verdict(text, error=growth(r, grows_with), tolerance=float(chi2.isf(chance, 2)), reason=reason)
            text = f"residuals of {label} have no outlier: Grubbs's ratio of the largest to all"
            yield verdict(text, error=largest(r), tolerance=largest_bound(len(r), chance), reason=reason)


def whiteness(r: Floats, count: int) -> float:
    """The sum of Ljung and Box over so many lags; chi-squared of as many degrees of freedom for white noise."""
    n, lags = len(r), np.arange(1, count + 1)
    correlation = np.array([r[k:] @ r[:-k] for k in lags]) / (r @ r)
    return n * (n + 2) * float(np.sum(correlation**2 / (n - lags)))


def growth(r: Floats, grows_with: Floats) -> float:
    """Count times the squared correlation of sizes of residuals with what they may grow with, shape (k, count).

    Chi-squared of k degrees of freedom for constant noise (Glejser, Journal of the American Statistical Association 64
    (1969) 316-323).
    """
    sizes, centred = np.abs(r) - np.abs(r).mean(), grows_with - grows_with.mean(axis=1, keepdims=True)
    columns = (centred / np.maximum(np.abs(centred).max(axis=1, keepdims=True), np.finfo(float).tiny)).T
    explained = columns @ np.linalg.lstsq(columns, sizes)[0]
    return len(r) * float(explained @ explained / (sizes @ sizes))


def largest(r: Floats) -> float:
    """The largest deviation from the mean over the standard deviation."""
    return float(np.abs(r - r.mean()).max() / np.std(r, ddof=1))


def largest_bound(count: int, chance: float) -> float:
    """What that of normal numbers exceeds with no more than this chance (Grubbs, Technometrics 11 (1969) 1-21)."""
    square = float(t.isf(chance / (2 * count), count - 2)) ** 2
    return (count - 1) / count**0.5 * (square / (count - 2 + square)) ** 0.5


def _size(estimate: ParameterEstimate) -> Verdict:
    square, freedom = 2 * estimate.minimum.cost, estimate.freedom
    text = f"residuals are as large as the noise: chi-squared {square:.4g} of {freedom}"
    return _chi_squared(text, square, freedom, _CHANCE)


def _variances(estimate: ParameterEstimate) -> Iterator[Verdict]:
    """Variances of unknowns that are fitted to simulated measurements, as multiples of those of the estimate."""
    sure = np.flatnonzero(np.isfinite(estimate.standard_errors)).tolist()
    if not sure:
        return
    ratios = np.var(estimate.refits(_REFITS)[:, sure], axis=0, ddof=1) / estimate.standard_errors[sure] ** 2
    for i, ratio in zip(sure, ratios.tolist(), strict=True):
        name = estimate.problem.names[i]
        text = f"the variance of {name} in {_REFITS} fits to simulated measurements is {ratio:.2f} times as large"
        yield _chi_squared(text, (_REFITS - 1) * ratio, _REFITS - 1, (1 - _BAND) / len(sure))


def _chi_squared(claim: str, square: float, freedom: int, chance: float) -> Verdict:
    """How improbable it is, on both sides, as deviations of a normal number."""
    error = norm.isf(min(chi2.cdf(square, freedom), chi2.sf(square, freedom)))
    reason = f"normal deviations that have the chance {chance:g}"
    return verdict(claim, error=float(abs(error)), tolerance=float(norm.isf(chance / 2)), reason=reason)


def _finer(estimate: ParameterEstimate) -> Verdict:
    """Steps of a tenth of the tolerance."""
    errors = estimate.standard_errors
    change = np.abs(estimate.with_finer_steps().values - estimate.values) / errors
    text = "steps of a tenth of the tolerance give the same values"
    return verdict(text, error=float(np.nanmax(change, initial=0.0)), tolerance=_DEVIATION, reason="standard errors")
