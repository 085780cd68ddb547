"""The component as the FMU carries it, in its resources folder: a JSON table with CasADi functions."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca


@dataclass(frozen=True, eq=False)
class ComponentTable:
    """A component at run time.  Value references count from 1: sizes, Real variables, input_reconstruction."""

    guid: str
    names: list[str]  # of all variables
    first: int  # value reference of the first parameter
    sizes: list[int]  # values of the structural sizes
    domains: list[tuple[float, float, str]]  # of parameters and inputs: least and largest number; in words
    fixed: list[bool]  # whether each of them is a parameter that is set before initialization ends
    impulses: list[int]  # value references of the sums of impulses, which are not taken
    never_0: list[int]  # value references of the active coordinates of which 0 is not allowed
    active: list[list[int]]  # of prescribed coordinates: σ, σ̇, σ̈ among the inputs; what is derived in the memory
    warnings: list[tuple[int, list[str]]]  # likewise: mismatch in the memory; contradiction, jump, σ̈ and σ̇ missing
    start_rates: list[tuple[int, int]]  # indices of their start values, and of rates that constraints may change
    condition_texts: list[str]
    reaches: list[tuple[str, list[str]]]  # constraints: what is said of them, and the prescribed coordinates
    lasting: int  # number of conditions that the motion has to satisfy; the others are for the start alone
    numbers: dict[str, list[float]]  # of a new instance
    functions: dict[str, ca.Function]


def load_component(resources: str) -> ComponentTable:
    """Return the component of an FMU, which all its instances share.

    :param resources: the unpacked resources folder.
    """
    return _decoded_table((Path(resources) / "component.json").read_text(encoding="utf-8"))


@lru_cache(maxsize=64)
def _decoded_table(text: str) -> ComponentTable:
    """Return the component that a JSON text describes."""
    document = json.loads(text)
    functions = {name: ca.Function.deserialize(code) for name, code in document.pop("functions").items()}
    return ComponentTable(**document, functions=functions)


def start_values(resources: str) -> Iterator[tuple[str, int, Any]]:
    """Yield kind, value reference and value of each start value in ``starts.txt``.

    See ``starts.c`` of the native FMUs; here every variable is one number.
    """
    file = Path(resources + "/starts.txt")
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        kind, reference, _, bits, *_ = line.split()
        yield kind, int(reference), struct.unpack(">d" if kind == "r" else ">q", bytes.fromhex(bits))[0]
