"""Statuses of FMI, the logger of FMUs, and warnings of results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from liaisons.base.logs import logger
from liaisons.results import Result

OK, WARNING, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4
SUCCESS = {OK, WARNING}
STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

COMPLAINTS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
"""FMI's standard log categories of statuses that are not OK."""

_MOST_NAMED = 20  # signals, of which each has a warning


def add_warnings(result: Result, warnings: tuple[str, ...]) -> Result:
    """Result with further warnings appended to its own."""
    return replace(result, warnings=tuple(dict.fromkeys((*result.warnings, *warnings)))) if warnings else result


def warn_of_non_finite_values(result: Result) -> None:
    """Log a warning for each signal of a result that is not finite everywhere."""
    wrong = ~np.isfinite(result.values)
    rows = np.flatnonzero(wrong.any(axis=1)).tolist()
    for row in rows[:_MOST_NAMED]:
        first, signal = int(np.argmax(wrong[row])), result.values[row]
        words = "%s: %s is %g at t = %.10g s, and not finite at %d of %d points"
        said = result.title, result.names[row], signal[first], result.time[first], wrong[row].sum(), len(signal)
        logger.warning(words, *said)
    if len(rows) > _MOST_NAMED:
        logger.warning("%s: %d more signals are not finite", result.title, len(rows) - _MOST_NAMED)
