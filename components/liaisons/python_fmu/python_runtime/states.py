"""Saved states: dictionaries of numbers in memory, and the same as bytes.

The bytes are a checksum and the dictionary in JSON: reading them runs no code, and damaged bytes, or the state of
another FMU, are refused before they change anything.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

State = dict[str, Any]

NUMBERS = (
    *("t", "mode", "tolerance", "jumped", "k", "given", "u", "y", "m", "size"),
    *("past_H", "past_u", "far", "compared", "looked"),
)
"""Names of the numbers in a state."""

_DIGEST = 64


def to_bytes(state: State) -> bytes:
    """Bytes of a saved state, with a checksum."""
    text = json.dumps(state).encode()
    return hashlib.sha256(text).hexdigest().encode() + text


def from_bytes(state: bytes) -> State:
    """Saved state that bytes hold; empty if they are damaged."""
    digest, text = state[:_DIGEST], state[_DIGEST:]
    try:
        members = json.loads(text) if hashlib.sha256(text).hexdigest().encode() == digest else {}
    except (ValueError, RecursionError):
        members = {}
    return members if isinstance(members, dict) else {}


def is_usable(state: State, present: State) -> bool:
    """Whether a saved state has the members of an instance's present state, and is one of the same FMU."""
    return _member_types(state) == _member_types(present) and state["guid"] == present["guid"]


def _member_types(state: State) -> dict[str, Any]:
    """Type of each member by name; of a list the types of its elements."""
    return {name: [*map(type, value)] if isinstance(value, list) else type(value) for name, value in state.items()}
