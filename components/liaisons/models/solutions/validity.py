"""Conditions on the arguments of closed forms, and their errors."""

from __future__ import annotations

from liaisons.errors import ValidityError


def require(holds: bool, message: str) -> None:
    """Raise a ValidityError with the message unless the condition holds."""
    if not holds:
        raise ValidityError(message)
