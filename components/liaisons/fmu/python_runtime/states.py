"""Saved states: trusted dictionaries in memory, and untrusted bytes.

The bytes are a checksum and the dictionary in JSON: reading them runs no code, and a state that no instance can have is
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

ARRAYS = ("t", "k", "given", "u", "y", "m", "past", "size")
"""Those of :class:`~.vectors.Vectors` that make up a state."""

SCALARS = {"mode": int, "tolerance": float, "started": bool, "jumped": bool, "unusable": str}
"""Other members of an instance's state, and their types."""

_OUTSIDE = "outside"  # marks a state that comes from bytes
_DIGEST = 64


def to_bytes(state: State) -> bytes:
    """The state with its checksum."""
    text = json.dumps({name: value for name, value in state.items() if name != _OUTSIDE}).encode()
    return hashlib.sha256(text).hexdigest().encode() + text


def from_bytes(content: bytes) -> State:
    """The state; an empty one, which is not usable, if the bytes are damaged."""
    digest, text = content[:_DIGEST], content[_DIGEST:]
    try:
        intact = hashlib.sha256(text).hexdigest().encode() == digest
        state = json.loads(text) if intact else None
    except (ValueError, RecursionError):
        state = None
    if not isinstance(state, dict):
        return {}
    if isinstance(state.get("unusable"), str) and state["unusable"]:  # no message shows what the bytes hold
        state["unusable"] = "initialization failed before this state was saved; reset and initialize again"
    return state | {_OUTSIDE: True}


def usable(state: State, table: Table, sizes: Mapping[str, int]) -> bool:
    """Whether an instance of the component can have the state.

    :param sizes: of the arrays.
    """
    if not isinstance(state, dict) or state.get("guid") != table.guid:
        return False
    return not state.get(_OUTSIDE) or (_has_all(state, sizes) and _in_range(state, table))


def _has_all(state: State, sizes: Mapping[str, int]) -> bool:
    """Whether everything is there, with its type."""
    types = {**SCALARS, "stepping": bool}
    return (
        state.keys() == {"guid", _OUTSIDE, *types, *sizes}
        and all(type(state[name]) is kind for name, kind in types.items())
        and all(
            type(state[name]) is list and len(state[name]) == size and all(type(x) is float for x in state[name])
            for name, size in sizes.items()
        )
    )


def _in_range(state: State, table: Table) -> bool:
    """Whether every number is finite and in its domain; before a start, states and memory are calculated anyway."""
    tolerance = state["tolerance"]
    runs = state["stepping"] and not state["unusable"]
    finite = ["t", "k", "given", "u", "past", *(("y", "m", "size") if runs else ())]
    fixed = [(entry, x) for entry, x in zip(table.parameters, state["k"], strict=True) if entry.variability == "fixed"]
    return (
        HOLD <= state["mode"] <= INTERPOLATE
        and (TIGHTEST <= tolerance <= LOOSEST or tolerance == table.tolerance)
        and all(math.isfinite(x) for name in finite for x in state[name])
        and (state["started"] or not state["stepping"])
        and (not runs or all(size > 0 for size in state["size"]))
        and (not runs or all(entry.allows(x) for entry, x in fixed))
    )
