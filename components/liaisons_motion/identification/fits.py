"""Results of fits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn, final

import numpy as np

from liaisons import Result, Verdict
from liaisons.base.arguments import shown
from liaisons.check import table
from liaisons.errors import IdentificationError
from liaisons_motion.identification import diagrams
from liaisons_motion.identification.estimates import ParameterEstimate
from liaisons_motion.identification.measurements import Measurements
from liaisons_motion.identification.problems import Floats
from liaisons_motion.identification.verifying import replays, verdicts


@final
@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Values of unknowns with their covariance, returned by :func:`liaisons.identify`.

    ``"theta_0 (2)"`` is the value in the second experiment.
    """

    estimate: ParameterEstimate

    def __reduce__(self) -> NoReturn:
        """Refuse copies: expressions cannot be copied."""
        raise IdentificationError("a Fit is neither copied nor pickled; values, covariance and to_csv(path) hold it")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, in the order of all arrays."""
        return self.estimate.problem.names

    @property
    def units(self) -> dict[str, str]:
        """Units of the unknowns, by name."""
        return dict(zip(self.names, self.estimate.problem.units, strict=True))

    @property
    def values(self) -> dict[str, float]:
        """Values of the unknowns in SI units, by name."""
        return dict(zip(self.names, self.estimate.values.tolist(), strict=True))

    @property
    def covariance(self) -> Floats:
        """Covariance matrix, shape (unknowns, unknowns); not-a-number if undetermined or at a bound.

        All of it is not-a-number without the argument ``noise`` if there are as many unknowns as numbers.
        """
        return self.estimate.covariance

    @property
    def correlation(self) -> Floats:
        """Correlation matrix, shape (unknowns, unknowns)."""
        errors = self.estimate.standard_errors
        return self.covariance / np.outer(errors, errors)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors of the unknowns in SI units, by name."""
        return dict(zip(self.names, self.estimate.standard_errors.tolist(), strict=True))

    @property
    def cost(self) -> float:
        """Half the sum of the losses of squared standardised residuals."""
        return self.estimate.minimum.cost

    @property
    def sentences(self) -> tuple[str, ...]:
        """Warnings: undetermined unknowns, events in doubt, unknowns at a bound, and noise that cannot be estimated."""
        estimate = self.estimate
        bounds = (
            f"{self.names[i]} = {estimate.values[i]:g} is at its bound; its interval is one-sided"
            for i in estimate.at_bound
        )
        held = (f"{self.names[i]} is held at {estimate.values[i]:g}" for i in estimate.held)
        count = len(self.names) - len(estimate.fixed_indices)
        unsure = f"{count} unknowns from as many numbers leave no residual that shows the noise; give noise="
        return (
            *estimate.indeterminacy_sentences,
            *estimate.event_sentences,
            *held,
            *bounds,
            *[unsure] * (not estimate.has_noise_estimate),
        )

    def intervals(self, probability: float = 0.95) -> dict[str, tuple[float, float]]:
        """Confidence intervals in SI units; without the argument ``noise`` by Student's distribution.

        At a bound they are one-sided, by profile likelihood; undetermined unknowns have not-a-number.

        :raises IdentificationError: unless 0 < probability < 1.
        """
        if not 0 < probability < 1:
            raise IdentificationError(f"probability = {shown(probability)}: give a number between 0 and 1")
        ends = self.estimate.intervals(probability).tolist()
        return {name: (low, high) for name, (low, high) in zip(self.names, ends, strict=True)}

    @property
    def measurements(self) -> tuple[Measurements, ...]:
        """Measurements of each experiment."""
        return self.estimate.problem.measurements

    @property
    def signals(self) -> tuple[Floats, ...]:
        """The fitted motion of each experiment at its times, shape (signals, times)."""
        return self.estimate.fitted_signals

    @property
    def instants(self) -> tuple[dict[str, Floats], ...]:
        """Instants [s] of the measured impacts in the fitted motion, of each experiment."""
        return self.estimate.instants

    @property
    def residuals(self) -> tuple[Floats, ...]:
        """Measured minus fitted signals of each experiment, shape (signals, times); not-a-number for missing values."""
        return tuple(data.values - fitted for data, fitted in zip(self.measurements, self.signals, strict=True))

    @property
    def noise(self) -> tuple[Floats, ...]:
        """Standard deviations of each experiment, shape (signals,): the argument, or estimated from residuals."""
        return tuple(experiment.deviations for experiment in self.estimate.objective.experiments)

    def replay(self) -> tuple[Result, ...]:
        """Simulate the FMUs of each experiment at the fitted values."""
        return replays(self.estimate)

    def verify(self) -> list[Verdict]:
        """Verdicts: replay through the FMUs, tests of residuals, variances of 200 fits, finer steps.

        ``liaisons.check.table`` prints them; ``all(v.passed for v in ...)`` says whether all pass.
        """
        return list(verdicts(self.estimate, self.replay()))

    plot, plot_ellipse, animate, to_csv = diagrams.plot, diagrams.plot_ellipse, diagrams.animate, diagrams.to_csv

    def __repr__(self) -> str:
        errors, intervals = self.standard_errors, self.intervals()
        rows = [
            {
                "unknown": name,
                "value": f"{value:.8g}",
                "standard error": f"{errors[name]:.2g}",
                "95 %": "{:.6g} to {:.6g}".format(*intervals[name]),
                "unit": self.units[name],
            }
            for name, value in self.values.items()
        ]
        return "\n".join([table(rows), *self.sentences])
