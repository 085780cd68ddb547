"""Impacts that several FMUs take part in: where impulses go through connections, they are those of the whole system.

Which contacts of an FMU push, stick or slide, with which impulses, and what is rounding there, its core decides.  It
is asked through the ports: by jumps of rates and sums of impulses in an impact, by accelerations and loads for dry
friction.  Three rules stand here, since no variable of an FMU tells effective mass, thresholds and scales of its
contacts, and none takes modes: of the combinations of modes on which FMUs agree, that in which most sticks is taken; a
velocity of rounding is told by the rates and accelerations of the ports; and all FMUs together gain no energy, of which
each sees its part only.
"""

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
