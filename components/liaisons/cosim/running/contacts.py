"""Contacts and dry friction of FMUs: their variables, and impulses that do not go through connections."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from liaisons.base.port_names import impulse_name
from liaisons.cosim.compiled.calls import Indices, Vector
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation

LEAST_IMPULSE = 1e-8
"""Smallest impulse that counts, relative to a force times the time in which it acts, or to a sum of impulses."""


class ContactVariables(NamedTuple):
    """Variables of a contact of an FMU: distance, its rate, whether it is closed, and number of impacts."""

    distance: VariableReference
    rate: VariableReference
    closed: VariableReference
    impacts: VariableReference

    @property
    def impulse(self) -> VariableReference:
        """Sum of its impulses."""
        return self._beside("impulse")

    @property
    def force(self) -> VariableReference:
        """Its force."""
        return self._beside("force")

    def _beside(self, kind: str) -> VariableReference:
        owner, impacts = self.impacts
        name, _, element = impacts.rpartition("_impacts")
        return owner, f"{name}_{kind}{element}"


class FrictionVariables(NamedTuple):
    """Variables of a dry friction of an FMU: its velocity, and the sign of that, 0 while it sticks."""

    velocity: VariableReference
    direction: VariableReference

    @property
    def force(self) -> VariableReference:
        """Its force."""
        owner, velocity = self.velocity
        name, bracket, element = velocity.partition("[")
        return owner, f"{name}_force{bracket}{element}"


def contact_variables(part: SystemComponent) -> list[ContactVariables]:
    """Variables of each contact of an FMU."""
    variables = part.fmu.variables
    contacts: list[ContactVariables] = []
    for name, ending, element in (variable.rpartition("_impacts") for variable in variables):
        names = [f"{name}{suffix}{element}" for suffix in ("", "_dot", "_closed", "_impacts")]
        if ending and all(other in variables for other in names):
            contacts.append(ContactVariables(*((part.name, other) for other in names)))
    return contacts


def friction_variables(part: SystemComponent) -> list[FrictionVariables]:
    """Variables of each dry friction of an FMU."""
    variables = part.fmu.variables
    parts = (name.rpartition("_sticks") for name in variables)
    pairs = [(f"{base}{element}", f"{base}_direction{element}") for base, ending, element in parts if ending]
    return [
        FrictionVariables(*((part.name, name) for name in pair))
        for pair in pairs
        if all(name in variables for name in pair)
    ]


def connections_losing_impulses(
    simulation: Simulation, solved: Collection[VariableReference]
) -> dict[VariableReference, Connection]:
    """Sum of impulses -> connection of a force that does not pass these impulses on.

    The sums are those of the operators of a mechanism that is moved, and of the contacts of one that moves another.

    :param solved: forces that are connected together with their impulses.
    """
    connections: dict[VariableReference, Connection] = {}
    for connection in simulation.connections:
        if not connection.is_reaction or connection.source.reference in solved:
            continue
        moved, mover = connection.source.part, connection.target.part
        if (impulse := impulse_name(connection.source.name)) in moved.fmu.variables:
            connections[moved.name, impulse] = connection
        connections |= {contact.impulse: connection for contact in contact_variables(mover)}
    return connections


def missing_impulses(
    connections: Mapping[VariableReference, Connection], times: Vector, columns: Mapping[VariableReference, Vector]
) -> list[tuple[Indices, str]]:
    """Points at which impulses did not go through connections, of each connection with some, and a warning of it.

    :param connections: see :func:`connections_losing_impulses`.
    :param columns: values of variables at the communication points.
    """
    missing: list[tuple[Indices, str]] = []
    for variable, connection in connections.items():
        sums, force = columns[variable], columns[connection.source.reference]
        least = LEAST_IMPULSE * np.abs(force).max() * (times[-1] - times[0])
        if len(points := 1 + np.flatnonzero(np.abs(np.diff(sums)) > least)):
            first = points[0]
            jump = f"{sums[first] - sums[first - 1]:.4g} N.s at t = {times[first]:.6g} s and {len(points) - 1} more"
            words = f"impulses do not go through {connection}: of {'.'.join(variable)}, {jump}"
            cure = "what follows is wrong by an unknown amount: make one FMU of the system by flatten()"
            missing.append((points, f"{words}; {cure}"))
    return missing
