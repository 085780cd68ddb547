"""Statuses of FMI, where what FMUs say of them goes, and results with what was warned of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import ParamSpec

from liaisons.logs import collected_warnings, logger
from liaisons.results import IncompleteError, Interrupted, Result

__all__ = ["COMPLAINTS", "DISCARD", "ERROR", "FATAL", "STATUSES", "WARNING", "keeping_warnings", "logger"]

OK, WARNING, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4
STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

COMPLAINTS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
"""The log categories that come with a status."""

P = ParamSpec("P")


def keeping_warnings(function: Callable[P, Result]) -> Callable[P, Result]:
    """The same function of a run, whose result has in ``warnings`` what was logged meanwhile, too."""

    @wraps(function)
    def call(*arguments: P.args, **options: P.kwargs) -> Result:
        with collected_warnings() as found:
            try:
                result = function(*arguments, **options)
            except (IncompleteError, Interrupted) as error:
                error.result = _with(error.result, found.texts)
                raise
        return _with(result, found.texts)

    return call


def _with(result: Result, warnings: tuple[str, ...]) -> Result:
    """A result with these warnings after its own."""
    return replace(result, warnings=tuple(dict.fromkeys((*result.warnings, *warnings)))) if warnings else result
