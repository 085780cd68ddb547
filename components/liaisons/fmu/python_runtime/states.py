"""Saved states: dictionaries of numbers in memory, and the same as bytes.

The bytes are a checksum and the dictionary in JSON: reading them runs no code, and a state that no instance can have is
refused before it changes anything.
"""

from __future__ import annotations

import hashlib
import json
import math
from typing import Any

from .component import ComponentTable

State = dict[str, Any]

NUMBERS = (
    *("t", "mode", "tolerance", "jumped", "k", "given", "u", "y", "m", "size"),
    *("past_H", "past_u", "far", "compared"),
)
"""Names of the numbers in a state."""

TIGHTEST, LOOSEST = 1e-14, 1e-2  # tolerances are kept between these
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


def is_usable(state: State, present: State, component: ComponentTable) -> bool:
    """Whether a saved state fits an instance of the component, whose present state is known."""
    if _types(state) != _types(present) or state["guid"] != component.guid:
        return False
    (mode,), (tolerance,), (jumped,) = (state[name] for name in ("mode", "tolerance", "jumped"))
    runs = state["stepping"] and not state["unusable"]
    calculated = () if runs else ("y", "m", "size")  # when initialization ends
    domains = zip(component.domains, component.fixed, state["k"], strict=False)
    return (
        all(math.isfinite(number) for name in NUMBERS if name not in calculated for number in state[name])
        and mode in (0, 1, 2)
        and jumped in (0, 1)
        and (TIGHTEST <= tolerance <= LOOSEST or [tolerance] == component.numbers["tolerance"])
        and not (runs and min(state["size"], default=1) <= 0)
        and not any(runs and fixed and not low <= number <= high for (low, high, _), fixed, number in domains)
    )


def _types(state: State) -> dict[str, Any]:
    """Type of each member by name; of a list those of its elements."""
    return {name: [*map(type, value)] if isinstance(value, list) else type(value) for name, value in state.items()}
