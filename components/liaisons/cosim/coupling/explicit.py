"""Explicit coupling: the program of :mod:`liaisons.cosim.structure.schedule` as calls of FMUs, prepared once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache, partial

from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.schedule import Operation
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS, Drive

Calls = list[Call]


def prepared_calls(simulation: Simulation, instances: Instances, bus: Bus) -> tuple[Calls, Calls, Calls]:
    """Calls that exchange values in initialization, after it, and in a communication step."""

    @cache  # repeated operations share their calls
    def calls_of(operation: Operation, initial: bool) -> Calls:
        return list(_calls_of_operation(simulation, instances, bus, operation, initial))

    def calls(program: Sequence[Operation], *, initial: bool = False) -> Calls:
        return [call for operation in program for call in calls_of(operation, initial)]

    order, feeds, depends = bus.order, simulation.feeds, simulation.depends
    parts = simulation.parts.items()
    newest = {name for name, part in parts if part.approximation.method in {None, 2} and not part.fmu.is_sampled}
    return (
        calls(schedule.consistent_program(order, feeds, partial(depends, initially=True)), initial=True),
        calls(schedule.consistent_program(order, feeds, depends)),
        calls(schedule.step_program(order, feeds, depends, simulation.coupling, newest)),
    )


def _calls_of_operation(
    simulation: Simulation, instances: Instances, bus: Bus, operation: Operation, initial: bool
) -> Iterator[Call]:
    """The calls of one operation; in initialization, only what is connected is read."""
    action, name = operation
    if name == SIGNALS:
        if action == "get":
            yield from (Call(_evaluate, drive, bus, bus.view(drive.places)) for drive in simulation.drives)
        return
    instance, variables = instances[name], simulation.parts[name].fmu.variables
    if action == "step":
        yield instance.stepper(bus.start, bus.size)
        return
    references = bus.inputs[name] if action == "set" else bus.outputs(name, every=not initial)
    if not references:
        return
    if action == "set":
        yield from bus.copies(references)
    prepare = instance.setter if action == "set" else instance.getter
    yield prepare([variables[variable] for _, variable in references], bus.view(references))


def _evaluate(drive: Drive, bus: Bus, values: Vector) -> None:
    values[:] = drive(bus.end.value)
