"""Statuses of FMI, where what FMUs say of them goes, and results with what was warned of, among it not-a-numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from liaisons.base.logs import logger
from liaisons.results import Result

OK, WARNING, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4
SUCCESS = {OK, WARNING}
STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

COMPLAINTS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
"""The log categories that come with a status."""

_MOST = 20  # variables that are named


def add_warnings(result: Result, warnings: tuple[str, ...]) -> Result:
    """A result with these warnings after its own."""
    return replace(result, warnings=tuple(dict.fromkeys((*result.warnings, *warnings)))) if warnings else result


def warn_of_non_finite_values(result: Result) -> None:
    """Warn of every signal with values that are not finite, with the first of them."""
    wrong = ~np.isfinite(result.values)
    rows = np.flatnonzero(wrong.any(axis=1)).tolist()
    for row in rows[:_MOST]:
        first, signal = int(np.argmax(wrong[row])), result.values[row]
        words = "%s: %s is %g at t = %.10g s, and not finite at %d of %d points"
        said = result.title, result.names[row], signal[first], result.time[first], wrong[row].sum(), len(signal)
        logger.warning(words, *said)
    if len(rows) > _MOST:
        logger.warning("%s: %d more signals are not finite", result.title, len(rows) - _MOST)
