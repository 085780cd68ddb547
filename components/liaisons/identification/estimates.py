"""An estimate of unknowns, and how sure it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

from liaisons.errors import LiaisonsError
from liaisons.identification.determinacy import NullSpace, sentences
from liaisons.identification.minimising import Minimum, influence, minimise
from liaisons.identification.problems import FittingProblem, Floats, Objective

_APART = 0.02
"""Relative distance of the values at which a product of unknowns has to be the same."""
_DOUBLINGS = 40
ROUNDING = 1e-7
"""Residuals that are less, relative to their signal, are those of the motion's steps."""


@final
@dataclass(frozen=True, eq=False)
class ParameterEstimate:
    """Unknowns that fit measurements best.

    :param held: indices of unknowns that keep their start values, since they are not determined.
    :param at_bound: indices of unknowns that are at one of their bounds.
    """

    problem: FittingProblem
    objective: Objective
    minimum: Minimum
    held: tuple[int, ...] = ()
    at_bound: tuple[int, ...] = ()

    @property
    def values(self) -> Floats:
        """Of the unknowns."""
        return self.minimum.values

    @cached_property
    def linearization(self) -> tuple[Floats, Floats]:
        """Residuals and their derivatives by the unknowns."""
        return self.objective(self.values)

    @cached_property
    def null_space(self) -> NullSpace:
        """What no residual determines."""
        return self.objective.null_space(self.values)

    @cached_property
    def sentences(self) -> tuple[str, ...]:
        """What is not determined, in words."""
        if not self.null_space.directions.size:
            return ()
        random = np.random.default_rng(0).uniform(_APART / 2, _APART, len(self.values))
        shifts = np.where(self.null_space.undetermined, random * np.where(self.values == 0, 1, self.values), 0)
        values = np.clip(self.values + shifts, *self.objective.limits)
        try:
            near = self.objective.null_space(values)
        except LiaisonsError:  # start values that contradict each other
            near = self.null_space
        signals = dict.fromkeys(name for data in self.problem.measurements for name in data.signals)
        return sentences(self.null_space, near, self.problem.names, list(signals))

    @cached_property
    def covariance(self) -> Floats:
        """Of the unknowns; not-a-number for what is not determined or at a bound, and where nothing tells the noise."""
        own = np.setdiff1d(np.arange(len(self.values)), self.fixed)
        covariance = np.full((len(self.values),) * 2, np.nan)
        if not self.tells_noise:
            return covariance
        residuals, derivatives = self.linearization
        slope, curvature = influence(self.objective.loss, residuals)
        scale = np.linalg.norm(derivatives[:, own], axis=0)
        Q, R = np.linalg.qr(derivatives[:, own] / scale)  # JᵀJ would lose half of the digits
        root = np.linalg.inv(R) / scale[:, None]
        if self.objective.loss != "linear":
            root = (
                root @ np.linalg.inv(np.einsum("ri,r,rj->ij", Q, curvature, Q)) @ np.linalg.qr(Q * slope[:, None])[1].T
            )
        inverse = root @ root.T
        covariance[np.ix_(own, own)] = inverse
        unsure = self.null_space.undetermined
        covariance[unsure], covariance[:, unsure] = np.nan, np.nan
        return covariance

    @cached_property
    def standard_errors(self) -> Floats:
        """Of the unknowns; not-a-number where there is no variance."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def fitted(self) -> tuple[Floats, ...]:
        """Signals of each experiment at its times, shape (signals, times)."""
        return tuple(experiment.forward(self.values)[0] for experiment in self.objective.experiments)

    def standardised(self) -> Iterator[tuple[str, Floats, float, Floats]]:
        """Of each signal its name, its residuals over their standard deviation, and the rounding of these.

        Then what noise may grow with, the time and the size of the signal, shape (2, residuals).
        """
        several = len(self.fitted) > 1
        for i, (experiment, fitted) in enumerate(zip(self.objective.experiments, self.fitted, strict=True), start=1):
            data = experiment.measurements
            rows = zip(data.signals, data.values, fitted, experiment.deviations, strict=True)
            for name, measured, signal, level in rows:
                seen = np.isfinite(measured)
                label = f"{name} ({i})" if several else name
                grows_with = np.array([data.times[seen], np.abs(signal[seen])])
                rounding = ROUNDING * float(np.abs(signal).max()) / level
                yield label, (measured - signal)[seen] / level, rounding, grows_with

    def with_finer_steps(self) -> Minimum:
        """The minimum for steps of a tenth of the tolerance."""
        levels = [experiment.deviations for experiment in self.objective.experiments]
        finer = self.problem.objective(self.values, levels, self.problem.tolerance / 10)
        return minimise(finer, self.values, self.fixed)

    @property
    def fixed(self) -> tuple[int, ...]:
        """Indices of unknowns that are held, or at a bound."""
        return *self.held, *self.at_bound

    @property
    def freedom(self) -> int:
        """Count of measured values and priors, less that of the unknowns that were fitted."""
        return len(self.linearization[0]) - len(self.values) + len(self.fixed)

    @property
    def tells_noise(self) -> bool:
        """Whether the noise is given, or residuals are left that show it."""
        return self.problem.noise is not None or self.freedom > 0

    def intervals(self, probability: float) -> Floats:
        """Ends of an interval for each unknown, shape (unknowns, 2); one-sided at a bound, by profile likelihood."""
        half = self._quantile((1 + probability) / 2) * self.standard_errors
        ends = np.clip(self.values + np.outer([-1, 1], half), *self.objective.limits).T
        for i in self.at_bound:
            ends[i] = sorted([self.values[i], self._profile(i, self._quantile(probability))])
        return ends

    def _quantile(self, probability: float) -> float:
        return float(norm.ppf(probability) if self.problem.noise else t.ppf(probability, max(1, self.freedom)))

    def _profile(self, i: int, quantile: float) -> float:
        """Value of an unknown at which the least cost has risen by half the square of a quantile."""
        best = self.minimum
        side = 1 if self.values[i] == self.objective.limits[0, i] else -1
        latest = [best]

        def excess(distance: float) -> float:
            start = latest[0].values.copy()
            start[i] = self.values[i] + side * distance
            latest[0] = minimise(self.objective, start, {i, *self.fixed})
            return 2 * (latest[0].cost - best.cost) - quantile**2

        distance = quantile / float(np.linalg.norm(self.linearization[1][:, i]))
        for _ in range(_DOUBLINGS):
            if excess(distance) > 0:
                return float(self.values[i] + side * brentq(excess, 0, distance, xtol=1e-6 * distance))
            distance *= 2
        return side * np.inf

    def refits(self, count: int, seed: int = 0) -> Floats:
        """Unknowns from simulated measurements, shape (count, unknowns): those of the estimate with other noise.

        Noise is normal; of a robust loss, it is drawn from the residuals.
        """
        return np.array([minimum.values for minimum in self._refits(count, np.random.default_rng(seed))])

    def _refits(self, count: int, random: np.random.Generator) -> Iterator[Minimum]:
        residuals, _ = self.linearization
        for _ in range(count):
            noise = random.standard_normal(residuals.shape)
            if self.objective.loss != "linear":
                noise = random.choice(residuals, residuals.shape)
            simulated = replace(self.objective, shift=self.objective.shift - residuals - noise)
            yield minimise(simulated, self.values, self.fixed, 1e-8)
