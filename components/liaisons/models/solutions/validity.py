"""What a closed form demands of its arguments, said in one line when it does not get it."""

from __future__ import annotations

from liaisons.errors import ValidityError


def require(holds: bool, message: str) -> None:
    """Raise a ValidityError with the message unless the condition holds."""
    if not holds:
        raise ValidityError(message)
