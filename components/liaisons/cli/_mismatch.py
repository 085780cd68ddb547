"""Contradictory motions: the variables ``s_mismatch`` of our FMUs, and what is said of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from liaisons.array_names import split

if TYPE_CHECKING:
    from liaisons.cosim.description import Fmu
    from liaisons.results import Result

_ENDING = "_mismatch"


def mismatches(fmu: Fmu) -> list[str]:
    """Local variables that say how far σ, σ̇ and σ̈ of the inputs contradict each other; none in other tools' FMUs."""
    inputs = {split(name)[0] for name in fmu.reals("input")}
    found = ((name, split(name)[0]) for name in fmu.reals("local"))
    return [name for name, base in found if base.endswith(_ENDING) and _triple(base.removesuffix(_ENDING)) <= inputs]


def taken_out(result: Result, names: Collection[str]) -> tuple[Result, list[str]]:
    """The result without these signals, and a line for each that is not 0."""
    kept = [row for row, name in enumerate(result.names) if name not in names]
    shown = tuple(result.names[row] for row in kept)
    units = {name: result.units[name] for name in shown}
    lines = [line for name in names for line in _line(result, name)]
    return replace(result, names=shown, values=result.values[kept], units=units), lines


def _triple(name: str) -> set[str]:
    return {name, f"{name}_dot", f"{name}_ddot"}


def _line(result: Result, name: str) -> Iterator[str]:
    values = np.abs(result[name])
    if not np.any(values):
        return
    base, first = split(name)[0].removesuffix(_ENDING), result.time[np.flatnonzero(values)[0]]
    largest, unit = np.max(values), result.units[name]
    yield (
        f"{base}, {base}_dot and {base}_ddot contradict each other: {name} is up to {largest:.6g} {unit}, "
        f"for the first time at t = {first:.6g} s"
    )
