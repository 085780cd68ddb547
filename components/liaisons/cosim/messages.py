"""Statuses of FMI, and where what FMUs say of them goes."""

from __future__ import annotations

import logging

WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4
STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

COMPLAINTS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
"""The log categories that come with a status."""

logger = logging.getLogger("liaisons.cosim")
