"""Saved states: dictionaries of numbers in memory, and the same as bytes.

The bytes are a checksum and the dictionary in JSON: reading them runs no code, and a state that no instance can have is
refused before it changes anything.
"""

from __future__ import annotations

import hashlib
import json
import math
from typing import Any

from .component import Component
from .motion import ARRAYS, HOLD, INTERPOLATE, LOOSEST, TIGHTEST

State = dict[str, Any]

_DIGEST = 64
_CALCULATED = {"y", "m", "size"}  # by the end of initialization


def to_bytes(state: State) -> bytes:
    """The state with its checksum."""
    text = json.dumps(state).encode()
    return hashlib.sha256(text).hexdigest().encode() + text


def from_bytes(content: bytes) -> State:
    """The state; an empty one if the bytes are damaged."""
    digest, text = content[:_DIGEST], content[_DIGEST:]
    try:
        state = json.loads(text) if hashlib.sha256(text).hexdigest().encode() == digest else {}
    except (ValueError, RecursionError):
        state = {}
    return state if isinstance(state, dict) else {}


def is_usable(state: State, present: State, component: Component) -> bool:
    """Whether an instance of the component, of which the present state is known, can have the state."""
    if _types(state) != _types(present) or state["guid"] != component.guid:
        return False
    runs, tolerance = state["stepping"] and not state["unusable"], state["tolerance"]
    arrays = ARRAYS if runs else set(ARRAYS) - _CALCULATED
    return (
        all(math.isfinite(number) for name in arrays for number in state[name])
        and HOLD <= state["mode"] <= INTERPOLATE
        and (TIGHTEST <= tolerance <= LOOSEST or tolerance == component.tolerance)
        and (not runs or _is_in_domain(state, component))
    )


def _is_in_domain(state: State, component: Component) -> bool:
    """Whether nominal values and fixed parameters are such as initialization allows."""
    parameters = zip(component.parameters, state["k"], strict=True)
    return min(state["size"], default=1.0) > 0 and all(e.allows(number) for e, number in parameters if e.fixed)


def _types(state: State) -> dict[str, Any]:
    """Types of all members, and of the elements of lists."""
    return {
        name: [*map(type, value)] if isinstance(value, list) else type(value) for name, value in state.items()
    }
