"""What a closed form demands of its arguments, said in one line when it does not get it."""

from __future__ import annotations

from liaisons.errors import ValidityError


def require(holds: bool, message: str) -> None:
    """Raise a ValidityError with the message unless the condition holds."""
    if not holds:
        raise ValidityError(message)


def require_positive(where: str, **values: float) -> None:
    """Refuse the first of the named values that is not > 0 (NaN included)."""
    for name, value in values.items():
        require(value > 0, f"{where}: {name} = {value} must be > 0")


def require_not_negative(where: str, **values: float) -> None:
    """Refuse the first of the named values that is not >= 0 (NaN included)."""
    for name, value in values.items():
        require(value >= 0, f"{where}: {name} = {value} must be >= 0")
