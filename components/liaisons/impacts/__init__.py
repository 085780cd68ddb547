"""Impacts that several FMUs take part in: where impulses go through connections, they are those of the whole system."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import final

from liaisons.cosim import Kernel, Simulation, VariableReference
from liaisons.impacts.impulses import ImpulsivePort, forces_through, impulse_sums, impulsive_ports
from liaisons.impacts.steps import ImpactSteps

__all__ = ["ConnectedImpulses", "connected_impulses"]


@final
@dataclass(frozen=True)
class ConnectedImpulses:
    """Impulses that go through connections of a simulation.

    :param ports: these connections.
    """

    simulation: Simulation
    ports: Sequence[ImpulsivePort]

    @property
    def forces(self) -> Collection[VariableReference]:
        """Forces that are connected together with their impulses."""
        return forces_through(self.ports)

    @property
    def variables(self) -> list[VariableReference]:
        """Sums of impulses, and forces that act alike."""
        return [variable for pair in impulse_sums(self.simulation, self.ports).items() for variable in pair]

    def happening(self, kernel: Kernel) -> ImpactSteps:
        """Steps across impacts."""
        return ImpactSteps(kernel, self.ports)


def connected_impulses(simulation: Simulation) -> ConnectedImpulses | None:
    """Impulses that go through connections; None if there are none, or an FMU cannot go back.

    :raises SimulationError: if errors choose the steps.
    """
    ports = impulsive_ports(simulation)
    return ConnectedImpulses(simulation, ports) if ports else None
