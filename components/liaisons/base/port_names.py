"""Names of the variables of a port, as FMUs of liaisons have them: for FMUs without terminals, and for results."""

from __future__ import annotations

from typing import NamedTuple

MISMATCH = "_mismatch"
"""Ending of the names of variables that measure how far value, rate and acceleration contradict each other."""


class PortNames(NamedTuple):
    """Names of variables; ``point`` and ``axis`` are empty unless the port is a component of a point."""

    value: str
    rate: str
    acceleration: str
    force: str
    load: str
    point: str
    axis: str


def port_names(value: str) -> PortNames:
    """Names of the variables of a port: of ``bob_x[3]`` rate ``bob_x_dot[3]``, point ``bob[3]``, axis ``x``."""
    base = value.partition("[")[0] if value.endswith("]") else value
    index = value[len(base) :]
    point, _, axis = base.rpartition("_")
    place = (f"{point}{index}", axis) if point and axis in {"x", "y", "z"} else ("", "")
    return PortNames._make([*(f"{base}{end}{index}" for end in ("", "_dot", "_ddot", "_force", "_load")), *place])


def impulse_name(force: str) -> str:
    """Name of the sum of impulses of a force or load: ``bob_x_impulse[3]`` of ``bob_x_load[3]``."""
    base, bracket, index = force.partition("[")
    return f"{base.rpartition('_')[0]}_impulse{bracket}{index}"


def jump_name(rate: str) -> str:
    """Name of the sum of jumps of a prescribed rate: ``pivot_x_dot_jump`` of ``pivot_x_dot``."""
    base, bracket, index = rate.partition("[")
    return f"{base}_jump{bracket}{index}"
