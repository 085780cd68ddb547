"""Polynomials of inputs within a step, and their effects on accelerations: the data of the error estimate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import final

import numpy as np

from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.signals import curve
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.running.contacts import ContactMechanism, contact_variables
from liaisons.cosim.running.estimate import InputReconstruction, Shape
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.components import Components, Port, SystemComponent
from liaisons.cosim.structure.schedule import OutputInput, VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS

Gains = Mapping[OutputInput, int]
"""Output and input -> column of the derivative; behind the bus those of :class:`InitialDerivatives`."""


@final
class InitialDerivatives:
    """Derivatives of accelerations by inputs at the start, where Newton's method does not calculate them.

    :param solved: those that Newton's method calculates.
    :ivar calls: calculate them.
    :ivar gains: their indices in ``values``, counted from the end of the bus.
    """

    def __init__(self, simulation: Simulation, instances: Instances, bus: Bus, solved: Gains) -> None:
        self.calls: list[Call] = []
        self.gains: dict[OutputInput, int] = {}
        solved_inputs = {input_ for _, input_ in solved}
        width = len(bus.values)
        parts: list[Vector] = []
        for name, part in simulation.parts.items():
            fed = [input_ for input_ in bus.inputs[name] if input_ not in solved_inputs]
            if not fed or part.approximation.method is None or not part.fmu.provides_directional_derivatives:
                continue
            moving = [p for p in (*bus.outputs(name), *bus.inputs[name]) if _acceleration(part, p[1]) is not None]
            variables = part.fmu.variables
            for input_ in fed:
                rows = [p for p in moving if simulation.depends(p, input_)]
                if rows:
                    parts.append(np.empty(len(rows)))
                    unknown, about = [variables[row] for _, row in rows], [variables[input_[1]]]
                    self.calls.append(instances[name].directional(unknown, about, np.ones(1), parts[-1]))
                    self.gains |= {(row, input_): width + len(self.gains) + k for k, row in enumerate(rows)}
        self._parts = parts

    @property
    def values(self) -> Vector:
        """The derivatives, as they were taken last."""
        return np.concatenate([np.empty(0), *self._parts])


def contact_mechanisms(simulation: Simulation, bus: Bus) -> list[ContactMechanism]:
    """Components with contacts whose inputs are connected."""
    mechanisms: list[ContactMechanism] = []
    for name, contacts in contacts_of_fed(simulation).items():
        part, index = simulation.parts[name], bus.index
        columns = np.array([[index[variable] for variable in contact] for contact in contacts], dtype=np.intp)
        inputs = frozenset(index[place] for place in bus.inputs[name] if Port(part, place[1]).triple() is not None)
        mechanisms.append(ContactMechanism(name, columns, inputs))
    return mechanisms


def contacts_of_fed(simulation: Simulation) -> dict[str, list[list[VariableReference]]]:
    """Name of each component with contacts whose inputs are connected -> variables of its contacts."""
    fed = {name for name, _ in simulation.feeds}
    contacts = {name: contact_variables(part) for name, part in simulation.parts.items() if name in fed}
    return {name: variables for name, variables in contacts.items() if variables}


def input_reconstructions(
    simulation: Simulation,
    bus: Bus,
    slopes: Mapping[VariableReference, int],
    gains: Gains,
    deviations: Mapping[VariableReference, tuple[int, int]],
) -> list[InputReconstruction]:
    """Polynomials of all connected inputs within a step: for each, the first row of the table that applies.

    :param slopes: columns of the derivatives of outputs that FMUs give.
    :param deviations: of inputs of functions of time: column of the first integral of the deviation, and how many
        numbers the function returns.
    """
    parts, feeds = simulation.parts, simulation.feeds
    group = {name: k for k, names in enumerate(simulation.groups) for name in names}
    late = set(schedule.late_inputs(bus.order, feeds, simulation.coupling))
    effects = _effects(parts, bus, gains)
    recorded = {source: bus.index[target] for target, source in feeds.items() if source[0] == SIGNALS}
    columns = {**bus.index, **recorded}  # functions of time are recorded as the inputs that they drive
    reconstructions: list[InputReconstruction] = []
    for target, source in feeds.items():
        name, part = target[0], parts[target[0]]
        approximation, triple, derivative = part.approximation, *Port(part, target[1]).curve()
        owner, variable = target if source[0] == SIGNALS else source
        signal = parts[owner].fmu.variables[variable]
        moves_nothing = target not in effects and derivative > 0 and part.fmu.provides_directional_derivatives
        if signal.type != "Real" or moves_nothing or approximation.samples:
            continue
        own, cyclic, method = columns[source], name in simulation.cyclic, approximation.method
        references, port_order = curve(parts, feeds, source)
        port = [columns[reference] for reference in references if reference in columns]
        past = _extrapolated(part, target, bus, own)
        integral, numbers = deviations.get(target, (0, 0))
        integrals = [integral, integral + 1]

        extrapolates = approximation.is_prescribed and not cyclic
        extrapolates |= not (simulation.iterates or approximation.interpolates)
        is_port = len(port) == len(references) > 2 and method is not None
        is_integrated = numbers == len(references)
        follows = approximation.follows_polynomials
        is_solved_with_source = simulation.iterates and cyclic and group.get(source[0]) == group[name]
        table: list[tuple[bool, Shape, list[int], int]] = [  # whether the row applies; shape, data, order
            (extrapolates and method is None and target not in late, "newest", *past),
            (extrapolates, "taylor", *past),
            (approximation.interpolates and triple is None, "hermite", [own], 0),
            (approximation.interface == "mean value", "mean", [own], 0),
            (is_port and is_integrated, "quintic", integrals, port_order),
            (is_port, "hermite", port, port_order),
            (is_integrated, "cubic", integrals, 0),
            (follows and source in slopes, "hermite", [own, slopes.get(source, own)], 0),
            (follows and not is_solved_with_source, "points", [own], 0),
            (True, "hermite", [own], 0),
        ]
        _, shape, data, order = next(row for row in table if row[0])
        if not signal.continuous and shape not in {"newest", "quintic", "cubic"}:
            continue  # it is held until the communication point at which it jumps
        reconstructions.append(
            InputReconstruction(
                f"{_name(source)} -> {'.'.join(target)}",
                bus.index[target],
                tuple(data),
                order,
                shape,
                tuple(effects.get(target, ())),
                tuple(bus.index[output] for output in bus.outputs(name)),
            )
        )
    return reconstructions


def _effects(parts: Components, bus: Bus, gains: Gains) -> dict[VariableReference, list[tuple[int, int, int]]]:
    """Input -> columns of each ∂(acceleration)/∂(input), and of the rate and the value of that acceleration."""
    effects: dict[VariableReference, list[tuple[int, int, int]]] = {}
    for (output, input_), column in gains.items():
        motion = _acceleration(parts[output[0]], output[1])
        if motion is not None:
            rate, value = (bus.index.get(port.place, -1) for port in motion)
            effects.setdefault(input_, []).append((column, rate, value))
    return effects


def _extrapolated(part: SystemComponent, target: VariableReference, bus: Bus, own: int) -> tuple[list[int], int]:
    """Columns of the data from which an FMU extrapolates an input, and which derivative of them the input is."""
    triple, order = Port(part, target[1]).curve()
    if part.approximation.method != 1 or triple is None:
        return [own], 0
    sources = [bus.source(port.place) for port in triple]
    return ([source for source in sources if source is not None], order) if None not in sources else ([own], 0)


def _acceleration(part: SystemComponent, name: str) -> tuple[Port, Port] | None:
    """Rate and value of the port whose acceleration this output is; None for another variable."""
    triple, order = Port(part, name).curve()
    if triple is None or order != 2 or part.fmu.variables[name].causality != "output":
        return None
    return triple[1], triple[0]


def _name(source: VariableReference) -> str:
    return "a function of time" if source[0] == SIGNALS else ".".join(source)
