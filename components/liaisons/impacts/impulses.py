"""Connections through which impulses go from an FMU to another, see :mod:`liaisons.impacts.impacts`."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

from liaisons.base.port_names import jump_name
from liaisons.cosim import Connection, Simulation, VariableReference, contact_variables
from liaisons.errors import SimulationError


@final
@dataclass(frozen=True)
class ImpulsivePort:
    """A connection through which impulses go.

    :param rate: what moves, and the input that it feeds.
    :param jump: input that sums the jumps of that rate.
    :param factors: of the rate, and of the impulse, in the units of the other side.
    """

    impulse: Connection
    rate: Connection
    jump: VariableReference
    factors: tuple[float, float]

    @property
    def acceleration(self) -> VariableReference:
        """Input of the FMU that is moved."""
        terminal = self.impulse.source.terminal
        assert terminal is not None
        assert terminal.motion is not None
        return self.moved, terminal.motion[2]

    @property
    def mover_acceleration(self) -> VariableReference:
        """Output of the FMU that moves."""
        terminal = self.impulse.target.terminal
        assert terminal is not None
        assert terminal.motion is not None
        return self.mover, terminal.motion[2]

    @property
    def force(self) -> VariableReference:
        """Output of the FMU that is moved."""
        return self.moved, self.impulse.source.force or ""

    @property
    def load(self) -> VariableReference:
        """Input of the FMU that moves."""
        return self.mover, self.impulse.target.force or ""

    @property
    def mover(self) -> str:
        """Name of the FMU that moves."""
        return self.impulse.target.part.name

    @property
    def moved(self) -> str:
        """Name of the FMU that is moved."""
        return self.impulse.source.part.name


def impulsive_ports(simulation: Simulation) -> list[ImpulsivePort]:
    """Connections through which impulses go: both FMUs can go back, take steps of any size, and follow polynomials.

    :raises SimulationError: if errors choose the steps.
    """
    free = all(part.fmu.can_get_and_set_state and part.fmu.variable_step for part in simulation.parts.values())
    if not (free and simulation.iterates):
        return []
    by_target = {connection.target.reference: connection for connection in simulation.connections}
    ports: list[ImpulsivePort] = []
    for connection in simulation.impulses:
        parts = connection.source.part, connection.target.part
        able = all(part.approximation.follows_polynomials for part in parts)
        terminals = connection.source.terminal, connection.target.terminal
        motions = [terminal.motion for terminal in terminals if terminal is not None and terminal.motion]
        if not able or len(motions) < 2:
            continue
        (_, moved, _), (_, moving, _) = motions
        rate, jump = by_target.get((parts[0].name, moved)), jump_name(moved)
        if rate is None or rate.source.reference != (parts[1].name, moving) or jump not in parts[0].fmu.variables:
            continue
        factors = rate.conversion.factor, connection.conversion.factor
        ports.append(ImpulsivePort(connection, rate, (parts[0].name, jump), factors))
    if ports and simulation.error_tolerance is not None:
        words = f"impulses go through {ports[0].impulse}, across which error_tolerance chooses no steps"
        raise SimulationError(f"{simulation.title}: {words}; give step_size instead, or make one FMU by flatten()")
    return ports


def forces_through(ports: Iterable[ImpulsivePort]) -> set[VariableReference]:
    """Forces that are connected together with their impulses."""
    return {port.force for port in ports}


def impulse_sums(simulation: Simulation, ports: Sequence[ImpulsivePort]) -> dict[VariableReference, VariableReference]:
    """Sum of impulses of each connection and contact that take part in impacts -> force that acts alike."""
    sums = {port.impulse.source.reference: port.force for port in ports}
    for name in dict.fromkeys(name for port in ports for name in (port.moved, port.mover)):
        sums |= {contact.impulse: contact.force for contact in contact_variables(simulation.parts[name])}
    return sums


def connections_that_stop_impulses(
    simulation: Simulation, solved: Collection[VariableReference], received: Mapping[VariableReference, str]
) -> dict[VariableReference, Connection]:
    """Received sum of impulses -> connection that should hand them on, since its force depends on loads or rates.

    :param solved: forces that are connected together with their impulses.
    :param received: sums of impulses that an FMU receives -> load beside.
    """
    unsolved = [c for c in simulation.connections if c.is_reaction and c.source.reference not in solved]
    jumping = {place[0]: place for place in received}  # FMUs whose rates jump, by a sum of impulses that makes them
    for _ in unsolved:
        movers = {c.source.part.name: jumping.get(c.target.part.name) for c in unsolved}
        jumping = {**{name: place for name, place in movers.items() if place}, **jumping}
    connections: dict[VariableReference, Connection] = {}
    for connection in unsolved:
        (moved, force), terminal = connection.source.reference, connection.source.terminal
        causes = [(place, load) for place, load in received.items() if place[0] == moved]
        if (place := jumping.get(connection.target.part.name)) and terminal is not None and terminal.motion:
            causes.append((place, terminal.motion[2]))
        for place, cause in causes:
            if cause in connection.source.part.fmu.variables and simulation.depends((moved, force), (moved, cause)):
                connections.setdefault(place, connection)
    return connections
