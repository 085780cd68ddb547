"""Explicit coupling: the program of :mod:`liaisons.cosim.structure.schedule` as calls of FMUs, prepared once."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import c_double
from functools import cache, partial
from typing import Any, NamedTuple, Protocol, final

from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.schedule import Operation
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS, Drive

Calls = list[Call]


class CommunicationCalls(NamedTuple):
    """Calls that exchange values in initialization, at one instant after it, and in a communication step."""

    initialization: Calls
    instant: Calls
    step: Calls


class MasterAlgorithm(Protocol):
    """How FMUs exchange values: calls, and what is remembered from step to step."""

    @property
    def calls(self) -> CommunicationCalls:
        """The calls of initialization, of an instant, and of a step."""
        ...

    @property
    def error_order(self) -> int:
        """Order in H of the error of a step."""
        ...

    def cross(self) -> None:
        """Make the tiny step to a break, and start the piece behind it."""
        ...

    def forget_past(self) -> None:
        """Forget the points before the present one, where a smooth piece begins."""
        ...

    def reset(self) -> None:
        """Forget all steps, before a run starts again."""
        ...

    def save(self) -> Any:
        """What is remembered, for :meth:`restore`."""
        ...

    def restore(self, saved: Any, /) -> None:
        """Return to a saved state."""
        ...


@final
class Explicit:
    """Explicit coupling: an order of calls, which remembers nothing; those of a repeated operation are shared."""

    error_order = 1

    def __init__(self, simulation: Simulation, instances: Instances, bus: Bus) -> None:
        calls_of = cache(partial(_operation_calls, simulation, instances, bus))

        def calls(program: Sequence[Operation], *, initial: bool = False) -> Calls:
            return [call for operation in program for call in calls_of(operation, initial)]

        order, feeds, depends = bus.order, simulation.feeds, simulation.depends
        parts = simulation.parts.items()
        newest = {
            name for name, part in parts if part.approximation.method in {None, 2} and not part.fmu.has_sampled_outputs
        }
        self._bus = bus
        self.calls = CommunicationCalls(
            calls(schedule.consistent_program(order, feeds, partial(depends, initially=True)), initial=True),
            calls(schedule.consistent_program(order, feeds, depends)),
            calls(schedule.step_program(order, feeds, depends, simulation.coupling, newest)),
        )

    def cross(self) -> None:
        """Make the tiny step to a break, which is one as any other."""
        self._bus.perform(self.calls.step)

    def forget_past(self) -> None:
        """Do nothing."""

    reset = forget_past

    def save(self) -> None:
        """Return nothing."""

    def restore(self, saved: None) -> None:
        """Do nothing."""


def _operation_calls(
    simulation: Simulation, instances: Instances, bus: Bus, operation: Operation, initial: bool
) -> Calls:
    """Prepare the calls of one operation; in initialization, only connected outputs are read."""
    action, name = operation
    if name == SIGNALS:
        drives = simulation.drives if action == "get" else ()
        return [Call(_evaluate_drive, drive, bus.end, bus.view(drive.references)) for drive in drives]
    instance, variables = instances[name], simulation.parts[name].fmu.variables
    if action == "step":
        return [instance.stepper(bus.start, bus.size)]
    outputs = bus.connected_outputs[name] if initial else bus.outputs(name)
    references = bus.inputs[name] if action == "set" else outputs
    if not references:
        return []
    prepare = instance.setter if action == "set" else instance.getter
    transfer = prepare([variables[variable] for _, variable in references], bus.view(references))
    return [*bus.copies(references), transfer] if action == "set" else [transfer]


def _evaluate_drive(drive: Drive, time: c_double, values: Vector) -> None:
    values[:] = drive(time.value)
