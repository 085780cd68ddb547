"""What the inputs of a system follow within a step, and how much they matter: for the estimate of errors."""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import c_double
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.signals import curve
from liaisons.cosim.instances import Instance
from liaisons.cosim.running.estimate import InputReconstruction, Shape
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.components import Port, SystemComponent
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS

Gains = Mapping[tuple[VariableReference, VariableReference], int]
"""Output and input -> column of the derivative of one by the other; behind the bus stand those of :class:`Begin`."""


@final
class Begin:
    """Derivatives of accelerations by inputs, taken once, where Newton's method does not.

    :param known: those that it does.
    :ivar calls: take them.
    :ivar gains: where they stand in ``values``, counted from the end of the bus.
    """

    def __init__(self, simulation: Simulation, instances: Mapping[str, Instance], bus: Bus, known: Gains) -> None:
        self.calls: list[Call] = []
        self.gains: dict[tuple[VariableReference, VariableReference], int] = {}
        solved = {input_ for _, input_ in known}
        width = len(bus.values)
        parts: list[NDArray[np.float64]] = []
        seed = (c_double * 1)(1.0)
        for name, part in simulation.parts.items():
            fed = [place for place in bus.inputs[name] if place not in solved]
            if not fed or part.reconstruction is None or not part.fmu.provides_directional_derivatives:
                continue
            moving = [p for p in (*bus.outputs(name), *bus.inputs[name]) if _acceleration(part, p[1]) is not None]
            variables = part.fmu.variables
            for input_ in fed:
                rows = [p for p in moving if simulation.depends(p, input_)]
                if rows:
                    buffer = (c_double * len(rows))()
                    unknown, about = [variables[row] for _, row in rows], [variables[input_[1]]]
                    self.calls.append(instances[name].directional(unknown, about, seed, buffer))
                    self.gains |= {(row, input_): width + len(self.gains) + k for k, row in enumerate(rows)}
                    parts.append(np.ctypeslib.as_array(buffer))
        self._parts = parts

    @property
    def values(self) -> NDArray[np.float64]:
        """The derivatives, as they were taken last."""
        return np.concatenate([np.empty(0), *self._parts])


def followed(  # noqa: C901 - one case after the other
    simulation: Simulation,
    bus: Bus,
    slopes: Mapping[VariableReference, int],
    gains: Gains,
    inside: Mapping[VariableReference, tuple[int, int]],
) -> list[InputReconstruction]:
    """What every connected input follows.

    :param slopes: where the slopes of outputs stand that FMUs give.
    :param inside: where the integrals of functions of time stand, and how many numbers each returns, by its inputs.
    """
    parts, feeds = simulation.parts, simulation.feeds
    group = {name: k for k, names in enumerate(simulation.groups) for name in names}
    late = set(schedule.late_inputs(bus.order, feeds, simulation.coupling))
    effects: dict[VariableReference, list[tuple[int, int, int]]] = {}
    for (output, input_), column in gains.items():
        motion = _acceleration(parts[output[0]], output[1])
        if motion is not None:
            rate, value = (bus.index.get(port.place, -1) for port in motion)
            effects.setdefault(input_, []).append((column, rate, value))
    given = {source: bus.index[target] for target, source in feeds.items() if source[0] == SIGNALS}
    columns = {**bus.index, **given}  # functions of time are recorded where they are given
    found: list[InputReconstruction] = []
    for target, source in feeds.items():
        name, part = target[0], parts[target[0]]
        giver, given_as = target if source[0] == SIGNALS else source
        if parts[giver].fmu.variables[given_as].type != "Real":
            continue
        if target not in effects and Port(part, target[1]).curve()[1] > 0 and part.fmu.provides_directional_derivatives:
            continue  # a rate that moves nothing
        if part.samples:
            continue  # samples are what was asked for
        own = columns[source]
        places, order = curve(parts, feeds, source)
        data = [columns[place] for place in places if place in columns]
        within = simulation.iterates and name in simulation.cyclic and group.get(source[0]) == group[name]
        shape: Shape = "hermite"
        straight = False
        if (part.left_alone and name not in simulation.cyclic) or not (simulation.iterates or part.interpolates):
            data, order = _own(part, target, bus, own)
            shape = "newest" if part.reconstruction is None and target not in late else "taylor"
        elif straight := part.interpolates and Port(part, target[1]).curve()[0] is None:
            data, order = [own], 0
        elif part.way == "mean":
            shape, data, order = "mean", [own], 0
        elif len(data) < 3 or len(data) < len(places) or (part.reconstruction is None and not part.interpolates):
            sloped = part.follows and source in slopes
            shape = "hermite" if sloped or within or not part.follows else "points"
            data, order = [own, slopes[source]] if sloped else [own], 0
        if shape in {"hermite", "points"} and not straight and inside.get(target, (0, 0))[1] == len(places):
            shape, data = "quintic" if len(data) == 3 else "cubic", [inside[target][0], inside[target][0] + 1]
        elif not parts[giver].fmu.variables[given_as].continuous and shape != "newest":
            shape = "stairs"
        found.append(
            InputReconstruction(
                f"{_name(source)} -> {'.'.join(target)}",
                bus.index[target],
                tuple(data),
                order,
                shape,
                tuple(effects.get(target, ())),
                tuple(bus.index[place] for place in bus.outputs(name)),
            )
        )
    return found


def _own(part: SystemComponent, target: VariableReference, bus: Bus, own: int) -> tuple[list[int], int]:
    """What an FMU of ours that extrapolates takes for its input: of a port, the parabola that it tells."""
    triple, order = Port(part, target[1]).curve()
    if part.reconstruction != 1 or triple is None:
        return [own], 0
    sources = [bus.source(port.place) for port in triple]
    return ([source for source in sources if source is not None], order) if None not in sources else ([own], 0)


def _acceleration(part: SystemComponent, name: str) -> tuple[Port, Port] | None:
    """Rate and value, if this is an acceleration that the FMU gives."""
    if "_ddot" not in name or part.fmu.variables[name].causality != "output":
        return None
    triple, order = Port(part, name).curve()
    return (triple[1], triple[0]) if triple is not None and order == 2 else None


def _name(source: VariableReference) -> str:
    return "a function of time" if source[0] == SIGNALS else ".".join(source)
