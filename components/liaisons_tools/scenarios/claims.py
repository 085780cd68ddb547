"""Claims of a scenario: each with result, reference, and the bound of their difference."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons import Result, Verdict, verdict
from liaisons.base.arguments import check_finite, shown
from liaisons.check import slope
from liaisons.errors import ValidityError


@final
@dataclass(frozen=True, slots=True)
class Bound:
    """Tolerance of a claim with its unit and reason; see :func:`within`."""

    tolerance: float
    unit: str
    because: str


def within(tolerance: float, unit: str = "", *, because: str) -> Bound:
    """Return a bound for claims: a tolerance with its unit and reason.

    :param tolerance: largest error that is allowed, >= 0.
    :param unit: SI unit of error and tolerance; empty for a relative error or a count.
    :param because: the reason of this tolerance.
    :raises ValidityError: for a tolerance that is not a number, or has no reason.
    """
    check_finite("within: tolerance", tolerance, ValidityError)
    if not (isinstance(unit, str) and isinstance(because, str) and because):
        raise ValidityError(f"within({tolerance:g}, {shown(unit)}, because={shown(because)}): say why, in words")
    return Bound(float(tolerance), unit, because)


@final
class Claims:
    """Collector that a scenario calls with each claim; ``verdicts`` are those so far.

    All methods raise :class:`ValidityError` for values that are not numbers or cannot be compared, and for a bound that
    is not one.
    """

    def __init__(self) -> None:
        self.verdicts: list[Verdict] = []

    def __call__(
        self,
        text: str,
        got: ArrayLike | Result | Mapping[str, ArrayLike],
        expected: ArrayLike | Mapping[str, ArrayLike],
        bound: Bound,
        *,
        names: Iterable[str] | None = None,
    ) -> None:
        """Claim that results agree with a reference.

        :param got: numbers, real or complex; or signals by name, a result.
        :param expected: numbers that broadcast to these; or numbers by name, a closed form.
        :param names: of those that are compared, if they go by name; all that are expected unless given.
        """
        if isinstance(expected, Mapping):
            pairs = [(_checked_signal(text, got, name), expected[name]) for name in names or expected]
        else:
            pairs = [(got, expected)]
        self._append_verdict(text, [np.abs(_checked_difference(text, *pair)) for pair in pairs], bound)

    def below(self, text: str, got: ArrayLike, limit: ArrayLike, bound: Bound) -> None:
        """Claim that results do not exceed a limit; the error is the largest excess."""
        self._append_verdict(text, [np.maximum(_checked_difference(text, got, limit), 0.0)], bound)

    def order(self, text: str, sizes: ArrayLike, errors: ArrayLike, order: float, bound: Bound) -> None:
        """Claim the order of errors: the slope of their logarithms over those of the sizes, at least three."""
        self(text, slope(sizes, errors), order, bound)

    def energy(self, text: str, *runs: Result, tolerance: float) -> None:
        """Claim that the energy balance of each mechanism in the runs stays 0.

        The bound is 10 x tolerance x mean kinetic energy x time; of several balances the one nearest to it counts.

        :param tolerance: that of the runs.
        """
        accounts: list[tuple[float, float]] = []
        for run in runs:
            for name in run.names:
                owner, dot, signal = name.rpartition(".")
                if signal == "energy_balance":
                    scale = float(np.mean(run[f"{owner}{dot}kinetic_energy"])) * float(run.time[-1] - run.time[0])
                    accounts.append((float(np.max(np.abs(run[name]))), 10 * tolerance * scale))
        if not accounts:
            raise ValidityError(f"{text!r}: no run has a signal energy_balance; record it and kinetic_energy")
        error, bound = max(accounts, key=lambda account: account[0] / account[1])
        self(text, error, 0.0, within(bound, "J", because="10 x tolerance x mean kinetic energy x time"))

    def _append_verdict(self, text: str, errors: list[NDArray[Any]], bound: Bound) -> None:
        """Append the verdict on a claim; its error is the largest one of all."""
        if not isinstance(bound, Bound):
            raise ValidityError(f"{text!r}: {shown(bound)} is no bound; give within(tolerance, unit, because=...)")
        error = max(map(np.max, errors), key=lambda e: (np.isnan(e), e))
        self.verdicts.append(
            verdict(text, error=error, tolerance=bound.tolerance, unit=bound.unit, reason=bound.because)
        )


def _checked_signal(text: str, got: Any, name: str) -> ArrayLike:
    """Values of a signal; raise a ValidityError if the results have none of this name."""
    try:
        return got[name]
    except (TypeError, IndexError, KeyError):
        raise ValidityError(f"{text!r}: {shown(got)} has no signal {name!r}") from None


def _checked_difference(text: str, got: object, expected: object) -> NDArray[Any]:
    """Results less the reference; raise a ValidityError if their shapes do not agree."""
    numbers, reference = (_checked_numbers(text, values) for values in (got, expected))
    try:
        if numbers.size:
            return numbers - np.broadcast_to(reference, numbers.shape)
    except ValueError:
        pass
    raise ValidityError(f"{text!r}: shapes {numbers.shape} and {reference.shape} cannot be compared")


def _checked_numbers(text: str, values: object) -> NDArray[Any]:
    """Array of real or complex numbers; raise a ValidityError for anything else."""
    try:
        numbers = np.asarray(values)
    except ValueError:  # rows of different lengths
        numbers = np.asarray(None)
    if numbers.dtype.kind not in "biufc":
        raise ValidityError(f"{text!r}: {shown(values)} are no numbers")
    return numbers.astype(complex if numbers.dtype.kind == "c" else float)
