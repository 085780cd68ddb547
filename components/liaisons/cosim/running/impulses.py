"""Impulses of impacts, which FMUs do not hand over: they exchange forces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.messages import logger
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation

_NOTHING = 1e-8
"""Smallest impulse that counts, relative to the largest force times the whole time."""


class MissingImpulses(NamedTuple):
    """Sum of impulses that a connection lacks, at the communication points; ``points`` where it has changed."""

    connection: Connection
    variable: VariableReference
    sums: Vector
    points: Indices


def sums_of_missing(simulation: Simulation) -> dict[VariableReference, Connection]:
    """Sums of impulses, with the connection of a force that lacks them.

    Those of the operators of a mechanism that is moved; and those of the contacts of one that moves another, which
    takes no part in the impacts.
    """
    connections: dict[VariableReference, Connection] = {}
    for connection in simulation.connections:
        if not connection.back:
            continue
        moved, mover = connection.source.part, connection.target.part
        name, force, element = connection.source.name.rpartition("_force")
        if force and (impulse := f"{name}_impulse{element}") in moved.fmu.variables:
            connections[moved.name, impulse] = connection
        for name, ending, element in (n.rpartition("_impacts") for n in mover.fmu.variables):
            if ending:
                connections[mover.name, f"{name}_impulse{element}"] = connection
    return connections


def missing_impulses(
    connections: Mapping[VariableReference, Connection], times: Vector, columns: Mapping[VariableReference, Vector]
) -> list[MissingImpulses]:
    """Impulses that connections lack, of each connection that lacks some.

    :param connections: by their sums of impulses.
    :param columns: values at the communication points.
    """
    missing: list[MissingImpulses] = []
    for variable, connection in connections.items():
        sums, force = columns[variable], columns[connection.source.place]
        least = _NOTHING * np.abs(force).max() * (times[-1] - times[0])
        if len(points := 1 + np.flatnonzero(np.abs(np.diff(sums)) > least)):
            missing.append(MissingImpulses(connection, variable, sums, points))
    return missing


def warn_of_missing(title: str, times: Vector, impulses: Iterable[MissingImpulses]) -> None:
    """Warn of each connection that lacks impulses."""
    for connection, variable, sums, (first, *others) in impulses:
        logger.warning(
            "%s: impulses do not go through %s: of %s, %.4g N.s at t = %.6g s and %d more; what follows is wrong by an "
            "unknown amount: make one FMU of the system by flatten()",
            title,
            connection,
            ".".join(variable),
            sums[first] - sums[first - 1],
            times[first],
            len(others),
        )
