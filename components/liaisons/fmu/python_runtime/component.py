"""The component as the FMU carries it, in its resources folder: a JSON table with CasADi functions."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .calls import Array


@dataclass(frozen=True, slots=True)
class Entry:
    """A variable."""

    name: str
    start: float
    low: float  # least allowed number
    high: float  # largest allowed number
    domain: str  # the allowed numbers in words
    fixed: bool  # a parameter that is set before initialization ends

    def allows(self, value: float) -> bool:
        """Whether the value lies in the domain."""
        return self.low <= value <= self.high


@dataclass(frozen=True, eq=False)
class Component:
    """A component at run time.  Value references count from 1: sizes, variables, input_reconstruction."""

    guid: str
    tolerance: float  # default
    parameters: tuple[Entry, ...]
    inputs: tuple[Entry, ...]
    outputs: tuple[Entry, ...]
    drawn: tuple[Entry, ...]  # for pictures, calculated when they are read
    sizes: tuple[tuple[str, int], ...]  # structural sizes by name
    active: NDArray[np.int_]  # indices of σ, σ̇ and σ̈ among the inputs, shape (3, a)
    mismatches: NDArray[np.int_]  # indices of their mismatches in the memory, shape (a,); -1: it has none
    jumps: NDArray[np.int_]  # effect of jumps of each pair of them, shape (a, a), see fmu.jumps; empty: none
    condition_texts: tuple[str, ...]
    lasting: int  # number of conditions that the motion has to satisfy; the others are for the start alone
    functions: dict[str, ca.Function]

    @property
    def variables(self) -> tuple[Entry, ...]:
        return self.parameters + self.inputs + self.outputs + self.drawn

    def failed_condition(self, t: float, y: Array, u: Array, k: Array, least: float, count: int) -> str:
        """The first of so many conditions whose margin is not greater than the least one; empty if there is none."""
        margins = np.asarray(self.functions["conditions"](t, y, u, k)).ravel()
        for text, margin in zip(self.condition_texts[:count], margins[:count], strict=True):
            if not margin > least:
                return f"{text}; at t = {t:.9g} it {'hardly does' if margin > 0 else 'does not'} ({margin:.3g})"
        return ""


def violation(entries: Iterable[Entry], values: Array, t: float) -> str:
    """Message for the first value outside of its domain at a time; empty if there is none."""
    for entry, value in zip(entries, values.tolist(), strict=True):
        if not entry.allows(value):
            return f"{entry.name} = {value:.9g} at t = {t:.9g}: it must be {entry.domain}"
    return ""


def load(resources: str) -> Component:
    """Read the component of an FMU; all its instances share one.

    :param resources: the unpacked resources folder.
    """
    return _decode((Path(resources) / "component.json").read_text(encoding="utf-8"))


def start_values(resources: str) -> Iterator[tuple[str, int, Any]]:
    """Start values in the folder that replace those of the component: kind, value reference, value.

    See ``starts.c`` of the native FMUs; here every variable is one number.
    """
    file = Path(resources + "/starts.txt")
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        kind, reference, _, bits, *_ = line.split()
        yield kind, int(reference), struct.unpack(">d" if kind == "r" else ">q", bytes.fromhex(bits))[0]


@lru_cache(maxsize=64)
def _decode(text: str) -> Component:
    document = json.loads(text)
    for kind in ("parameters", "inputs", "outputs", "drawn"):
        document[kind] = tuple(Entry(**entry) for entry in document[kind])
    active, jumps = document["active"], document["jumps"]
    document["active"] = np.array(active, dtype=int).reshape(-1, 3).T
    document["mismatches"] = np.array(document["mismatches"], dtype=int)
    document["jumps"] = np.array(jumps, dtype=int).reshape(-1, len(active))
    document["functions"] = {name: ca.Function.deserialize(code) for name, code in document["functions"].items()}
    return Component(**document)
