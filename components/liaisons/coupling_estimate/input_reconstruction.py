"""Polynomials of inputs within a step, and their effects on accelerations: the data of the error estimate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from operator import itemgetter
from typing import final

import numpy as np

from liaisons.cosim import (
    Call,
    Fmu,
    Kernel,
    Polynomial,
    Port,
    VariableReference,
    contact_variables,
    interpolation_to_end,
)
from liaisons.coupling_estimate.contacts import ContactMechanism
from liaisons.coupling_estimate.estimate import Estimate, InputReconstruction, Shape


def coupling_estimate(kernel: Kernel) -> Estimate | None:
    """Estimate of the errors of a run's steps, for which the bus grows by derivatives; None if none can be estimated.

    :param kernel: the FMUs of the run, before its steps are prepared.
    """
    calls, columns = _prepare_initial_gains(kernel), kernel.bus.index
    units = kernel.simulation.units_of(columns)
    estimate = Estimate(_input_reconstructions(kernel), columns, units, _contact_mechanisms(kernel), calls)
    return estimate if estimate.can_estimate else None


def _prepare_initial_gains(kernel: Kernel) -> list[Call]:
    """Prepare calls that calculate ∂(acceleration)/∂(input) at the start, where Newton's method does not."""
    simulation, bus, calls = kernel.simulation, kernel.bus, list[Call]()
    solved_inputs = {*map(itemgetter(1), bus.gain_columns)}
    for name, part in simulation.parts.items():
        if part.approximation.method is None or not part.fmu.provides_directional_derivatives:
            continue
        moving = _rates_and_values(part.fmu)
        for input_ in bus.inputs[name]:
            ours = () if input_ in solved_inputs else (*bus.outputs(name), *bus.inputs[name])
            if rows := [p for p in ours if p[1] in moving and simulation.depends(p, input_)]:
                column, unknowns, known = bus.add_gains(rows, input_), part.scalars(rows), part.scalars([input_])
                calls.append(kernel.instances[name].directional_derivatives(unknowns, known, np.ones(1), column))
    return calls


def _contact_mechanisms(kernel: Kernel) -> list[ContactMechanism]:
    """Mechanisms with contacts whose inputs are connected, by columns of the bus."""
    bus, mechanisms = kernel.bus, list[ContactMechanism]()
    for name, part in kernel.simulation.parts.items():
        if part.fmu.has_contacts and bus.inputs[name] and (contacts := contact_variables(part)):
            index = bus.index
            columns = np.array([bus.columns(contact) for contact in contacts])
            inputs = frozenset(index[place] for place in bus.inputs[name] if Port(part, place[1]).triple() is not None)
            mechanisms.append(ContactMechanism(name, columns, inputs))
    return mechanisms


def _input_reconstructions(kernel: Kernel) -> list[InputReconstruction]:
    """Polynomials that connected inputs follow within a step; none for an input without an effect."""
    simulation, bus, effects, table = kernel.simulation, kernel.bus, _effect_columns(kernel), _PolynomialTable(kernel)
    parts = simulation.parts
    reconstructions: list[InputReconstruction] = []
    for target, source in simulation.feeds.items():
        part = parts[target[0]]
        is_function = source[0] not in parts
        owner, variable = target if is_function else source
        signal = parts[owner].fmu.variables[variable]
        is_rate = Port(part, target[1]).motion_and_order()[1] > 0
        moves_nothing = is_rate and target not in effects and part.fmu.provides_directional_derivatives
        if signal.type != "Real" or moves_nothing or part.approximation.holds_by_choice or part.fmu.has_sampled_outputs:
            continue
        shape, data, order = table.polynomial(target, source)
        if signal.continuous or shape in {"newest", "quintic", "cubic"}:  # others jump at communication points only
            answers = tuple(map(bus.index.__getitem__, bus.outputs(target[0])))
            origin = "a function of time" if is_function else ".".join(source)
            name, own_effects = f"{origin} -> {'.'.join(target)}", tuple(effects.get(target, ()))
            reconstructions.append(
                InputReconstruction(name, bus.index[target], tuple(data), order, shape, own_effects, answers)
            )
    return reconstructions


@final
@dataclass(frozen=True)
class _PolynomialTable:
    """The polynomials that inputs follow within a step: shape, columns of the data, and which derivative an input is.

    ============================================  =========================================
    inputs                                        polynomial
    ============================================  =========================================
    that hold or extrapolate                      newest value, or Taylor polynomial
    that the FMU interpolates by itself           straight line; of a port the quintic
    that are one value in each step               mean of both ends
    port, of an FMU; of a function of time        quintic; with integrals of its deviation
    another function of time                      cubic, with integrals of its deviation
    output with a derivative                      cubic
    output without one, of an earlier component   cubic through points
    all else                                      straight line
    ============================================  =========================================
    """

    kernel: Kernel

    @cached_property
    def columns(self) -> dict[VariableReference, int]:
        """Column of each output on the bus; of a function of time, that of the input that it drives."""
        columns, simulation = dict(self.kernel.bus.index), self.kernel.simulation
        for target, source in simulation.feeds.items():
            if source[0] not in simulation.parts:
                columns[source] = columns[target]
        return columns

    def polynomial(self, target: VariableReference, source: VariableReference) -> tuple[Shape, list[int], int]:
        """Polynomial that an input follows: shape, columns of its data, and which derivative of it the input is."""
        own, deviations = self.columns[source], self.kernel.deviations
        references, order = self.kernel.simulation.port_and_order(source)
        integral, numbers = deviations.columns.get(target, (0, 0)) if deviations else (0, 0)
        integrals, is_driven = [integral, integral + 1], numbers == len(references)
        match self._shape(target, is_port=len(references) == 3):
            case "port":
                port = [*map(self.columns.__getitem__, references)]
                return ("quintic", integrals, order) if is_driven else ("hermite", port, order)
            case "points":
                return ("cubic", integrals, 0) if is_driven else ("points", [own], 0)
            case "slopes":
                return "hermite", [own, self.kernel.bus.slope_columns[source]], 0
            case "line":
                return "hermite", [own], 0
            case "mean":
                return "mean", [own], 0
            case "as set":
                return self._explicit_polynomial(target, own)

    def _shape(self, target: VariableReference, *, is_port: bool) -> Polynomial:
        """What the coupled step says of an input; in explicit coupling FMUs have values at the end, or their own."""
        if self.kernel.coupled is not None:
            return self.kernel.coupled.polynomials[target]
        simulation, part = self.kernel.simulation, self.kernel.simulation.parts[target[0]]
        if target[0] in simulation.chosen_reconstructions or not part.approximation.takes_end_values:
            return "as set"
        return interpolation_to_end(Port(part, target[1]), is_fed_by_port=is_port)

    def _explicit_polynomial(self, target: VariableReference, own: int) -> tuple[Shape, list[int], int]:
        part, feeds = self.kernel.simulation.parts[target[0]], self.kernel.simulation.feeds
        method, (triple, order) = part.approximation.method, Port(part, target[1]).motion_and_order()
        if method is None and target not in self.kernel.late_inputs:
            return "newest", [own], 0
        port = [self.kernel.bus.index[feeds[end.reference]] for end in triple or () if end.reference in feeds]
        return ("taylor", port, order) if method == 1 and len(port) == 3 else ("taylor", [own], 0)


def _effect_columns(kernel: Kernel) -> dict[VariableReference, list[tuple[int, int, int]]]:
    """Input -> columns of each ∂(acceleration)/∂(input), and of the rate and the value of that acceleration."""
    bus, effects = kernel.bus, dict[VariableReference, list[tuple[int, int, int]]]()
    for (output, input_), column in bus.gain_columns.items():
        owner, acceleration = output
        if names := _rates_and_values(kernel.simulation.parts[owner].fmu).get(acceleration):
            rate, value = names
            columns = column, bus.index.get((owner, rate), -1), bus.index.get((owner, value), -1)
            effects.setdefault(input_, []).append(columns)
    return effects


@lru_cache(maxsize=64)
def _rates_and_values(fmu: Fmu) -> dict[str, tuple[str, str]]:
    """Output that is an acceleration -> rate and value of its port."""
    names: dict[str, tuple[str, str]] = {}
    for acceleration in fmu.reals("output"):
        port = fmu.terminals.port(acceleration)
        if port is not None and port.motion is not None and port.motion[2] == acceleration:
            value, rate, _ = port.motion
            names[acceleration] = rate, value
    return names
