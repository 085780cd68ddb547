"""FMUs that impulses go through: what each takes from others through ports, and what it returns.

The unknowns of a system are what the mover of each port hands to the FMU that is moved, a jump of the rate or an
acceleration, and then what each hands back, an impulse or a force.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import final

import numpy as np

from liaisons.base.arrays import Floats, as_indices
from liaisons.cosim import Call, Kernel, VariableReference
from liaisons.impacts.impulses import ImpulsivePort

Pick = Callable[[ImpulsivePort], VariableReference]


@final
class ImpulsiveFmu:
    """An FMU with ports that impulses go through.

    :ivar taken: indices, among the unknowns, of what it takes; ``returned`` of what it returns.
    :ivar factors: of what it returns, in the units of the other side.
    :ivar sums: jumps of rates and impulses so far, which it is told as inputs.
    :ivar handed: impulses of its operators that have been handed on.
    :ivar restore: call that returns to the state that ``save`` has saved.
    """

    def __init__(self, name: str, ports: Sequence[ImpulsivePort], kernel: Kernel) -> None:
        self.name, self.bus, count = name, kernel.bus, len(ports)
        moved = [j for j, port in enumerate(ports) if port.moved == name]
        moving = [j for j, port in enumerate(ports) if port.mover == name]
        self._moved, self._moving = ([ports[j] for j in some] for some in (moved, moving))
        self.taken = as_indices([*moved, *(count + j for j in moving)])
        self.returned = as_indices([*(count + j for j in moved), *moving])
        self.factors = np.array([*(ports[j].factors[1] for j in moved), *(ports[j].factors[0] for j in moving)])
        self.sums, self.handed = np.zeros(len(self.taken)), np.zeros(len(moved))
        self.told = self.each(lambda port: port.jump, lambda port: port.impulse.target.reference)
        self._instance, self._variables = kernel.instances[name], kernel.simulation.parts[name].fmu.variables
        self.save, self.restore = self._instance.save_and_restore_calls()

    def setter(self, references: Sequence[VariableReference], values: Floats) -> Call:
        """Call that sets some of its variables."""
        return self._instance.setter([self._variables[variable] for _, variable in references], values)

    def getter(self, references: Sequence[VariableReference], values: Floats) -> Call:
        """Call that reads some of its variables."""
        return self._instance.getter([self._variables[variable] for _, variable in references], values)

    def has(self, reference: VariableReference) -> bool:
        """Whether it has a variable."""
        return reference[1] in self._variables

    def each(self, of_moved: Pick, of_moving: Pick | None) -> list[VariableReference]:
        """A variable of each of its ports: first of those that move it, then, unless None, of those that it moves."""
        return [*map(of_moved, self._moved), *(map(of_moving, self._moving) if of_moving else ())]


def grown(total: float) -> float:
    """A sum that has grown by its last digit: it lets an FMU settle its contacts with its present inputs."""
    return float(np.nextafter(total, math.inf))
