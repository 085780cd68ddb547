"""Warnings of outputs that are not finite."""

from __future__ import annotations

import numpy as np

from liaisons.cosim.messages import logger
from liaisons.results import Result

_MOST = 20  # variables that are named


def warn_of_what_is_not_finite(result: Result) -> None:
    """Warn of every signal with values that are not finite, with the first of them."""
    count = 0
    for name, values in zip(result.names, result.values, strict=True):
        wrong = ~np.isfinite(values)
        if wrong.any():
            first, count = int(np.argmax(wrong)), count + 1
            if count <= _MOST:
                words = "%s: %s is %g at t = %.10g s, and not finite at %d of %d points"
                said = result.title, name, values[first], result.time[first], wrong.sum(), len(values)
                logger.warning(words, *said)
    if count > _MOST:
        logger.warning("%s: %d more signals are not finite", result.title, count - _MOST)
