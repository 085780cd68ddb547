"""Strings of FMUs as numbers, since a run transfers and records numbers only; a number is valid in one process."""

from __future__ import annotations

from itertools import count

from liaisons.errors import SimulationError

_numbers: dict[bytes, int] = {b"": 0}
_texts: dict[int, bytes] = {0: b""}
_next = count(1)


def number(text: bytes | None) -> int:
    """Number that stands for a string."""
    index = _numbers.get(text or b"")
    if index is None:
        index = _numbers.setdefault(text or b"", next(_next))
        _texts[index] = text or b""
    return index


def text(number: float) -> bytes:
    """String for which a number stands.

    :raises SimulationError: if the number is from another process.
    """
    if number not in _texts:
        raise SimulationError("a string comes from an isolated FMU, which cannot pass it on")
    return _texts[int(number)]
