"""The component as the FMU carries it: a JSON table with CasADi functions, in the resources folder."""

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

from .calls import Array


@dataclass(frozen=True, slots=True)
class Entry:
    """A variable."""

    name: str
    causality: str
    variability: str
    start: float | None
    minimum: float | None
    maximum: float | None
    strict: bool  # True: the bounds themselves are forbidden too
    domain: str  # the allowed values in words; empty: all

    def margins(self, value: Any) -> list[Any]:
        """Distances to the bounds; the value is allowed while each is > 0, or >= 0 if not strict.

        :param value: a number or a CasADi expression.
        """
        below = [] if self.minimum is None else [value - self.minimum]
        above = [] if self.maximum is None else [self.maximum - value]
        return below + above

    def allows(self, value: float) -> bool:
        """Whether the value lies in the domain."""
        return all(margin > 0 or (margin == 0 and not self.strict) for margin in self.margins(value))


@dataclass(frozen=True, eq=False)
class Table:
    """A component at run time.  Value references count from 1: sizes, parameters + inputs + outputs, the setting."""

    name: str
    guid: str
    tolerance: float  # default
    parameters: tuple[Entry, ...]
    inputs: tuple[Entry, ...]
    outputs: tuple[Entry, ...]
    drawn: tuple[Entry, ...]  # for pictures, calculated when they are read
    sizes: tuple[tuple[str, int], ...]  # structural sizes by name
    active: tuple[tuple[int, int, int], ...]  # indices of s, s_dot, s_ddot among the inputs
    mismatches: tuple[int, ...]  # indices in the memory of the mismatches of these coordinates; -1: it has none
    jumps: tuple[tuple[int, ...], ...]  # effect of jumps of each pair of them, see prescribed.py; empty: none
    coupled: int  # the first so many states act on the motion
    condition_texts: tuple[str, ...]
    start_only: int  # number of conditions, the last ones, that only the start has to satisfy
    functions: dict[str, ca.Function]

    @property
    def first(self) -> int:
        """Value reference of the first parameter."""
        return 1 + len(self.sizes)

    @property
    def settable(self) -> tuple[Entry, ...]:
        return self.parameters + self.inputs

    @property
    def variables(self) -> tuple[Entry, ...]:
        return self.settable + self.outputs + self.drawn

    @property
    def lasting(self) -> int:
        """Number of conditions that the motion has to satisfy, too."""
        return len(self.condition_texts) - self.start_only

    def failed_condition(self, t: float, y: Array, u: Array, k: Array, least: float, *, start: bool = False) -> str:
        """The first condition whose margin is not greater than the least one; empty if there is none."""
        margins = np.asarray(self.functions["conditions"](t, y, u, k)).ravel()
        count = len(self.condition_texts) if start else self.lasting
        for text, margin in zip(self.condition_texts[:count], margins[:count], strict=True):
            if not margin > least:
                return f"{text}; at t = {t:.9g} it {'hardly does' if margin > 0 else 'does not'} ({margin:.3g})"
        return ""


def violation(entries: Iterable[Entry], values: Array, t: float) -> str:
    """What is said of the first value outside of its domain at a time; empty if there is none."""
    for entry, value in zip(entries, values.tolist(), strict=True):
        if not entry.allows(value):
            return f"{entry.name} = {value:.9g} at t = {t:.9g}: it must be {entry.domain}"
    return ""


def load(resources: str) -> Table:
    """Read the component of an FMU; all instances of it share one table.

    :param resources: the unpacked resources folder.
    """
    return _decode((Path(resources) / "component.json").read_text(encoding="utf-8"))


def starts(resources: str) -> Iterator[tuple[str, int, Any]]:
    """Start values in the folder that replace those of the component: kind, value reference, value.

    See ``starts.c`` of the native FMUs; here every variable is one number.
    """
    try:
        lines = (Path(resources + "/starts.txt")).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return
    for kind, reference, _, bits, *_ in map(str.split, lines):
        yield kind, int(reference), struct.unpack(">d" if kind == "r" else ">q", bytes.fromhex(bits))[0]


@lru_cache(maxsize=64)
def _decode(text: str) -> Table:
    document = json.loads(text)
    for kind in ("parameters", "inputs", "outputs", "drawn"):
        document[kind] = tuple(Entry(**entry) for entry in document[kind])
    for kind in ("sizes", "active", "mismatches", "jumps", "condition_texts"):
        document[kind] = tuple(document[kind])
    functions = {name: ca.Function.deserialize(code) for name, code in document.pop("functions").items()}
    return Table(**document, functions=functions)
