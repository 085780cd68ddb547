"""Operators of a live page: those of the catalogue that its script follows by itself, without an FMU of theirs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import sin
from pathlib import Path
from typing import Any

import numpy as np

from liaisons.base.archive import START_VALUES, Archive
from liaisons.cosim import SystemComponent, SystemDocument, read_description

Motion = tuple[str, Any]
"""Name of an operator in ``sources.js``, and its parameters or knots."""


def with_page_motions(document: SystemDocument) -> tuple[SystemDocument, dict[tuple[str, str], Motion]]:
    """Return a document without operators that a page's script follows; and (component, coordinate) -> motion of each.

    The coordinate's start value is that of its operator.
    """
    parts, motions = dict(document.parts), dict[tuple[str, str], Motion]()
    for name, part in document.parts.items():
        fed = [c for c in document.connections if name in (c.source.part.name, c.target.part.name)]
        found = _MOTIONS.get(read_description(part.fmu.path).root["modelName"])
        if found is None or len(fed) != 3 or any(c.conversion != (1.0, 0.0) for c in fed):
            continue
        target = next((c.target for c in fed if c.source.name == "y"), None)
        triple = target and target.triple()
        if target is None or not triple or {c.target.reference for c in fed} != {p.reference for p in triple}:
            continue
        start, motion = found(part)
        owner = parts[target.part.name]
        parts[owner.name] = replace(owner, starts={**owner.starts, target.name: start})
        motions[target.reference] = motion
        del parts[name]
    left = [
        replace(
            c,
            source=replace(c.source, part=parts[c.source.part.name]),
            target=replace(c.target, part=parts[c.target.part.name]),
        )
        for c in document.connections
        if {c.source.part.name, c.target.part.name} <= parts.keys()
    ]
    return replace(document, parts=parts, connections=left), motions


def _parameters(part: SystemComponent) -> dict[str, float]:
    """Parameters of an operator by name."""
    scalars = {n: v.start for n, v in part.fmu.variables.items() if v.causality == "parameter"} | dict(part.starts)
    return {name: float(str(value)) for name, value in scalars.items() if not isinstance(value, tuple)}


def _sinusoid(part: SystemComponent) -> tuple[float, Motion]:
    of = _parameters(part)
    motion = {"amplitude": of["amplitude"], "angular frequency": of["angular_frequency"]}
    phase = {"phase": of["phase"]} if of["phase"] else {}
    return of["offset"] + of["amplitude"] * sin(of["phase"]), ("Sinusoid", motion | phase)


def _ramp(part: SystemComponent) -> tuple[float, Motion]:
    of = _parameters(part)
    return of["offset"], ("Ramp", {"rate": of["rate"]} | _delay(of))


def _smooth_step(part: SystemComponent) -> tuple[float, Motion]:
    of = _parameters(part)
    motion = {"height": of["end_value"] - of["start_value"], "duration": of["duration"]}
    return of["start_value"], ("SmoothStep", motion | _delay(of))


def _delay(of: Mapping[str, float]) -> dict[str, float]:
    return {"start time": of["start_time"]} if of["start_time"] else {}


def _planned_motion(part: SystemComponent) -> tuple[float, Motion]:
    knots = _embedded_table(part.fmu.path)
    if knots is None:
        knots = np.array([part.starts[name] for name in ("instant", "value", "rate", "acceleration")], dtype=float)
        knots = knots[:, : 1 + np.max(np.flatnonzero(np.diff(knots[0]) > 0)) + 1]  # the rest is room
    return float(knots[1, 0]), ("Table", knots.tolist())


def _embedded_table(path: Path) -> np.ndarray | None:
    """Table in the resources of an FMU, shape (4, knots); None if there is none."""
    with Archive(path) as archive:
        if START_VALUES not in archive.names:
            return None
        with archive.open(START_VALUES) as file:
            lines = [line.split() for line in file.read().decode().splitlines() if line.startswith("t ")]
    if not lines:
        return None
    _, _, count, *numbers = lines[-1]
    return np.frombuffer(bytes.fromhex("".join(numbers[: int(count)])), dtype=">f8").reshape(4, -1)


_MOTIONS: Mapping[str, Callable[[SystemComponent], tuple[float, Motion]]] = {
    "Sinusoid": _sinusoid,
    "Ramp": _ramp,
    "SmoothStep": _smooth_step,
    "PlannedMotion": _planned_motion,
}
