"""Estimates of unknowns with covariance and confidence intervals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

from liaisons.errors import LiaisonsError
from liaisons_motion.derivatives import Branch
from liaisons_motion.identification.determinacy import NullSpace, indeterminacy_sentences
from liaisons_motion.identification.minimising import Minimum, loss_derivatives, minimise
from liaisons_motion.identification.problems import FittingProblem, Floats, Objective

_SECOND_POINT_DISTANCE = 0.02
"""Relative distance of a second point, at which the same product of unknowns must be determined."""
_MAX_DOUBLINGS = 40
ROUNDING = 1e-7
"""Residuals below this fraction of their signal are integration errors."""


class StandardisedResiduals(NamedTuple):
    """Residuals of a signal divided by its standard deviation, and their rounding error.

    :param regressors: what noise may grow with, time and size of the signal, shape (1 or 2, residuals).
    """

    label: str
    residuals: Floats
    rounding: float
    regressors: Floats


@final
@dataclass(frozen=True, eq=False)
class ParameterEstimate:
    """Unknowns that minimise the objective.

    :param held: indices of undetermined unknowns, which keep their start values.
    :param at_bound: indices of unknowns that are at one of their bounds.
    """

    objective: Objective
    minimum: Minimum
    held: tuple[int, ...] = ()
    at_bound: tuple[int, ...] = ()

    @property
    def problem(self) -> FittingProblem:
        """The subject, its measurements and its unknowns."""
        return self.objective.problem

    @property
    def values(self) -> Floats:
        """Estimated values of the unknowns, shape (unknowns,)."""
        return self.minimum.values

    @cached_property
    def linearization(self) -> tuple[Floats, Floats]:
        """Residuals, and their derivatives by the unknowns."""
        return self.objective(self.values)

    @cached_property
    def null_space(self) -> NullSpace:
        """Changes of unknowns that change no residual."""
        return self.objective.null_space(self.values)

    @cached_property
    def indeterminacy_sentences(self) -> tuple[str, ...]:
        """Sentences that name what the measurements do not determine."""
        if not self.null_space.directions.size:
            return ()
        random = np.random.default_rng(0).uniform(_SECOND_POINT_DISTANCE / 2, _SECOND_POINT_DISTANCE, len(self.values))
        shifts = np.where(self.null_space.undetermined, random * np.where(self.values == 0, 1, self.values), 0)
        values = np.clip(self.values + shifts, *self.objective.limits)
        try:
            nearby = self.objective.null_space(values)
        except LiaisonsError:  # start values that contradict each other
            nearby = self.null_space
        signals = dict.fromkeys(name for d in self.problem.measurements for name in (*d.signals, *d.instants))
        return tuple(indeterminacy_sentences(self.null_space, nearby, self.problem.names, list(signals)))

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the unknowns; not-a-number if undetermined, at a bound, or without an estimate of the noise."""
        own = np.setdiff1d(np.arange(len(self.values)), self.fixed_indices)
        covariance = np.full((len(self.values),) * 2, np.nan)
        if not self.has_noise_estimate:
            return covariance
        residuals, derivatives = self.linearization
        slope, curvature = loss_derivatives(self.problem.loss, residuals)
        scale = np.linalg.norm(derivatives[:, own], axis=0)
        Q, R = np.linalg.qr(derivatives[:, own] / scale)  # JᵀJ would lose half of the digits
        root = np.linalg.inv(R) / scale[:, None]
        if self.problem.loss != "linear":
            root = (
                root @ np.linalg.inv(np.einsum("ri,r,rj->ij", Q, curvature, Q)) @ np.linalg.qr(Q * slope[:, None])[1].T
            )
        inverse = root @ root.T
        covariance[own[:, None], own] = inverse
        unsure = self.null_space.undetermined
        covariance[unsure], covariance[:, unsure] = np.nan, np.nan
        return covariance

    @cached_property
    def standard_errors(self) -> Floats:
        """Standard errors of the unknowns; not-a-number without a variance."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def branches(self) -> tuple[Branch, ...]:
        """The fitted motion of each experiment."""
        return tuple(experiment.branch(self.values) for experiment in self.objective.experiments)

    @property
    def fitted_signals(self) -> tuple[Floats, ...]:
        """Signals of each experiment at its times, shape (signals, times)."""
        return tuple(branch.signals for branch in self.branches)

    @property
    def instants(self) -> tuple[dict[str, Floats], ...]:
        """Fitted instants of measured impacts [s], of each experiment."""
        pairs = zip(self.objective.experiments, self.branches, strict=True)
        return tuple({name: times for name, (times, _) in e.instants(branch).items()} for e, branch in pairs)

    @property
    def event_sentences(self) -> Iterator[str]:
        """Yield sentences on events with one-sided derivatives only, and on measured impacts that the motion lacks."""
        for experiment, branch in zip(self.objective.experiments, self.branches, strict=True):
            data, names = experiment.measurements, np.array(self.problem.names)[list(experiment.columns)]
            for instant, columns, reason, lasts in branch.undefined:
                if lasts or np.isclose(experiment.motion.times, instant, rtol=1e-12, atol=1e-12).any():
                    words = f"standard errors take derivatives by {', '.join(names[columns])} to one side of it"
                    yield f"{data.title}: t = {instant:.9g} s: {reason}; {words}"
            for name, (times, _) in data.instants.items():
                count = len(branch.impacts[name][0])
                if count < len(times):
                    words = f"the motion has {count} of {len(times)} impacts"
                    yield f"{data.title}: {name}: {words}; the others are continued at equal distances"

    def standardised_residuals(self) -> Iterator[StandardisedResiduals]:
        """Yield the residuals of each signal, and those of the instants of its impacts."""
        several = len(self.fitted_signals) > 1
        for i, (experiment, fitted) in enumerate(
            zip(self.objective.experiments, self.fitted_signals, strict=True), start=1
        ):
            data = experiment.measurements
            of_signals = zip(data.signals, data.values, fitted, experiment.deviations, strict=True)
            rows = [(*row, [data.times, np.abs(row[2])]) for row in of_signals]
            for name, times in self.instants[i - 1].items():
                rows.append((f"instants of {name}", data.instants[name][0], times, data.instants[name][1], [times]))
            for name, measured, own, level, regressors in rows:
                present = np.isfinite(measured)
                rounding = ROUNDING * float(np.abs(own).max()) / level
                label = f"{name} ({i})" if several else name
                residuals = (measured - own)[present] / level
                yield StandardisedResiduals(label, residuals, rounding, np.array(regressors)[:, present])

    def minimum_with_finer_steps(self) -> Minimum:
        """Minimum of the objective at a tenth of the integration tolerance."""
        levels = [experiment.deviations for experiment in self.objective.experiments]
        finer = replace(self.problem, tolerance=self.problem.tolerance / 10).build_objective(self.values, levels)
        return minimise(finer, self.values, self.fixed_indices)

    @property
    def fixed_indices(self) -> tuple[int, ...]:
        """Indices of unknowns that are held, or at a bound."""
        return *self.held, *self.at_bound

    @property
    def degrees_of_freedom(self) -> int:
        """Number of measured values and priors minus number of fitted unknowns."""
        return len(self.linearization[0]) - len(self.values) + len(self.fixed_indices)

    @property
    def has_noise_estimate(self) -> bool:
        """Whether the noise is an argument, or can be estimated from residuals."""
        return self.problem.noise is not None or self.degrees_of_freedom > 0

    def intervals(self, probability: float) -> Floats:
        """Confidence intervals, shape (unknowns, 2); at a bound one-sided, by profile likelihood."""
        half = self._quantile((1 + probability) / 2) * self.standard_errors
        ends = np.clip(self.values + np.outer([-1, 1], half), *self.objective.limits).T
        for i in self.at_bound:
            ends[i] = sorted([self.values[i], self._profile_likelihood_end(i, self._quantile(probability))])
        return ends

    def _quantile(self, probability: float) -> float:
        """Quantile of the normal distribution, or of Student's if the noise is estimated."""
        return float(
            norm.ppf(probability) if self.problem.noise else t.ppf(probability, max(1, self.degrees_of_freedom))
        )

    def _profile_likelihood_end(self, i: int, quantile: float) -> float:
        """End of a one-sided interval: the value at which the minimal cost has risen by half the squared quantile."""
        best = self.minimum
        side = 1 if self.values[i] == self.objective.limits[0, i] else -1
        latest = [best]

        def excess(distance: float) -> float:
            """Twice the rise of the minimal cost at a distance from the bound, minus the squared quantile."""
            start = latest[0].values.copy()
            start[i] = self.values[i] + side * distance
            latest[0] = minimise(self.objective, start, {i, *self.fixed_indices})
            return 2 * (latest[0].cost - best.cost) - quantile**2

        distance = quantile / float(np.linalg.norm(self.linearization[1][:, i]))
        for _ in range(_MAX_DOUBLINGS):
            if excess(distance) > 0:
                return float(self.values[i] + side * brentq(excess, 0, distance, xtol=1e-6 * distance))
            distance *= 2
        return side * np.inf

    def bootstrap_fits(self, count: int) -> Floats:
        """Unknowns of fits to simulated measurements (parametric bootstrap), shape (count, unknowns).

        The noise is normal; for a robust loss it is drawn from the residuals.
        """
        random, (residuals, _) = np.random.default_rng(0), self.linearization
        values = np.empty((count, len(self.values)))
        for fitted in values:
            noise = random.standard_normal(residuals.shape)
            if self.problem.loss != "linear":
                noise = random.choice(residuals, residuals.shape)
            simulated = replace(self.objective, shift=self.objective.shift - residuals - noise)
            fitted[:] = minimise(simulated, self.values, self.fixed_indices, 1e-8).values
        return values
