"""Parameters that were fitted to measurements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from liaisons.base.arguments import shown
from liaisons.check import Verdict, table
from liaisons.errors import IdentificationError
from liaisons.identification import diagrams
from liaisons.identification.estimates import ParameterEstimate
from liaisons.identification.measurements import Measurements
from liaisons.identification.problems import Floats
from liaisons.identification.replaying import replays
from liaisons.identification.verifying import verdicts
from liaisons.results import Result


@final
@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """What :func:`liaisons.identify` returns: values of unknowns, and how sure they are.

    Of several experiments, ``"theta_0 (2)"`` is the value of the second one.
    """

    estimate: ParameterEstimate

    @property
    def names(self) -> tuple[str, ...]:
        """Of the unknowns, in the order of all arrays."""
        return self.estimate.problem.names

    @property
    def units(self) -> dict[str, str]:
        """Of the unknowns."""
        return dict(zip(self.names, self.estimate.problem.units, strict=True))

    @property
    def values(self) -> dict[str, float]:
        """Of the unknowns, in SI units."""
        return dict(zip(self.names, self.estimate.values.tolist(), strict=True))

    @property
    def covariance(self) -> Floats:
        """Shape (unknowns, unknowns); not-a-number for what is not determined, or is at a bound.

        So it is for all where no noise was given and there are as many unknowns as numbers.
        """
        return self.estimate.covariance

    @property
    def correlation(self) -> Floats:
        """Shape (unknowns, unknowns)."""
        errors = self.estimate.standard_errors
        return self.covariance / np.outer(errors, errors)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Square roots of the variances."""
        return dict(zip(self.names, self.estimate.standard_errors.tolist(), strict=True))

    @property
    def cost(self) -> float:
        """Half the sum of squared residuals, each over its standard deviation; of a robust loss, of their losses."""
        return self.estimate.minimum.cost

    @property
    def sentences(self) -> tuple[str, ...]:
        """What measurements do not determine, which unknowns are at a bound, and whether nothing tells the noise."""
        estimate = self.estimate
        bounds = (
            f"{self.names[i]} = {estimate.values[i]:g} is at its bound; its interval is one-sided"
            for i in estimate.at_bound
        )
        kept = (f"{self.names[i]} is held at {estimate.values[i]:g}" for i in estimate.held)
        count = len(self.names) - len(estimate.fixed)
        unsure = f"{count} unknowns from as many numbers leave no residual that shows the noise; give noise="
        return (*estimate.sentences, *kept, *bounds, *[unsure] * (not estimate.tells_noise))

    def intervals(self, probability: float = 0.95) -> dict[str, tuple[float, float]]:
        """Confidence intervals, by Student's distribution where no noise was given.

        At a bound they are one-sided, by profile likelihood; of what is not determined, not-a-number.

        :raises IdentificationError: unless 0 < probability < 1.
        """
        if not 0 < probability < 1:
            raise IdentificationError(f"probability = {shown(probability)}: give a number between 0 and 1")
        ends = self.estimate.intervals(probability).tolist()
        return {name: (low, high) for name, (low, high) in zip(self.names, ends, strict=True)}

    @property
    def measurements(self) -> tuple[Measurements, ...]:
        """Those of each experiment."""
        return self.estimate.problem.measurements

    @property
    def signals(self) -> tuple[Floats, ...]:
        """The fitted motion of each experiment at its times, shape (signals, times)."""
        return self.estimate.fitted

    @property
    def residuals(self) -> tuple[Floats, ...]:
        """Measured less fitted signals of each experiment, shape (signals, times); not-a-number for missing values."""
        return tuple(data.values - fitted for data, fitted in zip(self.measurements, self.signals, strict=True))

    @property
    def noise(self) -> tuple[Floats, ...]:
        """Standard deviation of the signals of each experiment, shape (signals,): as given, or as residuals show it."""
        return tuple(experiment.deviations for experiment in self.estimate.objective.experiments)

    def replay(self) -> tuple[Result, ...]:
        """The fitted motion of each experiment as the FMUs perform it."""
        return replays(self.estimate)

    def verify(self) -> list[Verdict]:
        """Replay through the FMUs, tests of residuals, variances against 200 fits, finer steps.

        :returns: verdicts; ``liaisons.check.table`` prints them, and ``all(v.passed for v in ...)`` sums them up.
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
