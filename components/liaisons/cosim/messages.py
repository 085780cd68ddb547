"""Statuses of FMI, what FMUs say of them, and the error of one that says no."""

from __future__ import annotations

import logging
from typing import final

from liaisons.errors import SimulationError

WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4
STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

COMPLAINTS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
"""The log categories that come with a status."""

logger = logging.getLogger("liaisons.cosim")


@final
class RefusedError(SimulationError):
    """An FMU has answered Discard or Error, or an iteration did not converge.

    The FMU may go on from a saved state, and a shorter step may go.  After any other status it may not.
    """
