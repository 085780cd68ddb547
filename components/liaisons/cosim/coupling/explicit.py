"""Explicit coupling: the program of :mod:`liaisons.cosim.structure.schedule` as calls of FMUs, prepared once."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import c_double
from functools import cache, partial
from typing import NamedTuple

from liaisons.cosim.compiled.calls import Call, Vector
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.schedule import Operation
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS, Drive

Calls = list[Call]


class CommunicationCalls(NamedTuple):
    """Calls that exchange values in initialization, at one instant after it, and in a communication step.

    :param crossing: those of the tiny step to a break, behind which a smooth piece begins.
    """

    initialization: Calls
    instant: Calls
    step: Calls
    crossing: Calls


def explicit_calls(simulation: Simulation, instances: Instances, bus: Bus) -> CommunicationCalls:
    """The calls of explicit coupling, which remembers nothing; those of a repeated operation are shared."""
    calls_of = cache(partial(_operation_calls, simulation, instances, bus))

    def calls(program: Sequence[Operation], *, initial: bool = False) -> Calls:
        return [call for operation in program for call in calls_of(operation, initial)]

    order, feeds, depends = bus.order, simulation.feeds, simulation.depends
    parts = simulation.parts.items()
    newest = {
        name for name, part in parts if part.approximation.method in {None, 2} and not part.fmu.has_sampled_outputs
    }
    step = calls(schedule.step_program(order, feeds, depends, simulation.coupling, newest))
    return CommunicationCalls(
        calls(schedule.consistent_program(order, feeds, partial(depends, initially=True)), initial=True),
        calls(schedule.consistent_program(order, feeds, depends)),
        step,
        crossing=step,
    )


def _operation_calls(
    simulation: Simulation, instances: Instances, bus: Bus, operation: Operation, initial: bool
) -> Calls:
    """Prepare the calls of one operation; in initialization, only connected outputs are read."""
    action, name = operation
    if name == SIGNALS:
        drives = simulation.drives if action == "get" else ()
        return [Call(_evaluate_drive, drive, bus.end, bus.view(drive.references)) for drive in drives]
    instance = instances[name]
    if action == "step":
        return [instance.stepper(bus.start, bus.size)]
    outputs = bus.connected_outputs[name] if initial else bus.outputs(name)
    references = bus.inputs[name] if action == "set" else outputs
    if not references:
        return []
    prepare = instance.setter if action == "set" else instance.getter
    transfer = prepare(simulation.parts[name].scalars(references), bus.view(references))
    return [*bus.copies(references), transfer] if action == "set" else [transfer]


def _evaluate_drive(drive: Drive, time: c_double, values: Vector) -> None:
    values[:] = drive(time.value)
