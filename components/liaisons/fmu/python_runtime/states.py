"""Saved states: dictionaries in memory, which are trusted, and as bytes from anywhere, which are not.

The bytes are a checksum and the dictionary in JSON: reading them runs no code, and what no instance can have is
refused before it changes anything.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

from .motion import HOLD, INTERPOLATE, LOOSEST, TIGHTEST
from .table import Table

State = dict[str, Any]

_OUTSIDE = "outside"  # marks a state that comes from bytes
_DIGEST = 64


def to_bytes(state: State) -> bytes:
    """The state with its checksum."""
    text = json.dumps({name: value for name, value in state.items() if name != _OUTSIDE}).encode()
    return hashlib.sha256(text).hexdigest().encode() + text


def from_bytes(content: bytes) -> State:
    """The state; an empty one, which nothing takes, if the bytes are damaged."""
    digest, text = content[:_DIGEST], content[_DIGEST:]
    try:
        intact = hashlib.sha256(text).hexdigest().encode() == digest
        state = json.loads(text) if intact else None
    except (ValueError, RecursionError):
        state = None
    if not isinstance(state, dict):
        return {}
    if isinstance(state.get("_unusable"), str) and state["_unusable"]:  # no message shows what the bytes hold
        state["_unusable"] = "initialization failed before this state was saved; reset and initialize again"
    return state | {_OUTSIDE: True}


def usable(state: State, table: Table, sizes: Mapping[str, int]) -> bool:
    """Whether an instance of the component can have the state.

    :param sizes: how many numbers there are in each array of a state.
    """
    if not isinstance(state, dict) or state.get("guid") != table.guid:
        return False
    return not state.get(_OUTSIDE) or (_has_all(state, sizes) and _in_range(state, table))


def _has_all(state: State, sizes: Mapping[str, int]) -> bool:
    """Whether everything is there, with its type."""
    types = {"_mode": int, "_tolerance": float, "_started": bool, "_jumped": bool, "_unusable": str, "stepping": bool}
    numbers = (state.get(name) for name in sizes)
    return (
        state.keys() == {"guid", _OUTSIDE, *types, *sizes}
        and all(type(state[name]) is kind for name, kind in types.items())
        and all(
            type(values) is list and len(values) == size and all(type(x) is float for x in values)
            for values, size in zip(numbers, sizes.values(), strict=True)
        )
    )


def _in_range(state: State, table: Table) -> bool:
    """Whether every number is finite and may be what it is; before a start, states and memory are calculated anew."""
    tolerance = state["_tolerance"]
    finite = ["_t", "_k", "_given", "_u", "_past"]
    runs = state["stepping"] and not state["_unusable"]
    if runs:
        finite += ["_y", "_m", "_size"]
    fixed = [(entry, x) for entry, x in zip(table.parameters, state["_k"], strict=True) if entry.variability == "fixed"]
    return (
        HOLD <= state["_mode"] <= INTERPOLATE
        and (TIGHTEST <= tolerance <= LOOSEST or tolerance == table.tolerance)
        and all(math.isfinite(x) for name in finite for x in state[name])
        and (state["_started"] or not state["stepping"])
        and (not runs or all(size > 0 for size in state["_size"]))
        and (not runs or all(entry.allows(x) for entry, x in fixed))
    )
