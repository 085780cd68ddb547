"""Polynomials of inputs within a step, and their effects on accelerations: the data of the error estimate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from liaisons.cosim import Call, Kernel, Polynomial, Port, Simulation, VariableReference, contact_variables
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
    solved_inputs = {input_ for _, input_ in bus.gain_columns}
    for name, part in simulation.parts.items():
        fed = [input_ for input_ in bus.inputs[name] if input_ not in solved_inputs]
        if not fed or part.approximation.method is None or not part.fmu.provides_directional_derivatives:
            continue
        moving = [p for p in (*bus.outputs(name), *bus.inputs[name]) if _rate_and_value(Port(part, p[1])) is not None]
        variables = part.fmu.variables
        for input_ in fed:
            rows = [p for p in moving if simulation.depends(p, input_)]
            if rows:
                column = bus.add_gains(rows, input_)
                unknowns, known = [variables[row] for _, row in rows], [variables[input_[1]]]
                calls.append(kernel.instances[name].directional_derivatives(unknowns, known, np.ones(1), column))
    return calls


def _contact_mechanisms(kernel: Kernel) -> list[ContactMechanism]:
    """Mechanisms with contacts whose inputs are connected, by columns of the bus."""
    bus, mechanisms = kernel.bus, list[ContactMechanism]()
    for name, part in kernel.simulation.parts.items():
        index, contacts = bus.index, contact_variables(part)
        if contacts and bus.inputs[name]:
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
            answers = tuple(bus.index[output] for output in bus.outputs(target[0]))
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

    @property
    def simulation(self) -> Simulation:
        """The simulation."""
        return self.kernel.simulation

    @cached_property
    def columns(self) -> dict[VariableReference, int]:
        """Column of each output on the bus; of a function of time, that of the input that it drives."""
        index, parts, feeds = self.kernel.bus.index, self.simulation.parts, self.simulation.feeds.items()
        return {**index, **{source: index[target] for target, source in feeds if source[0] not in parts}}

    def polynomial(self, target: VariableReference, source: VariableReference) -> tuple[Shape, list[int], int]:
        """Polynomial that an input follows: shape, columns of its data, and which derivative of it the input is."""
        own, deviations = self.columns[source], self.kernel.deviations
        references, order = self.simulation.port_and_order(source)
        integral, numbers = deviations.columns.get(target, (0, 0)) if deviations else (0, 0)
        integrals, is_driven = [integral, integral + 1], numbers == len(references)
        match self._shape(target, is_port=len(references) == 3):
            case "port":
                port = [self.columns[reference] for reference in references]
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
        simulation, part = self.simulation, self.simulation.parts[target[0]]
        if target[0] in simulation.chosen_reconstructions or not part.approximation.takes_end_values:
            return "as set"
        return "port" if is_port and Port(part, target[1]).motion_and_order()[0] else "line"

    def _explicit_polynomial(self, target: VariableReference, own: int) -> tuple[Shape, list[int], int]:
        part, feeds = self.simulation.parts[target[0]], self.simulation.feeds
        method, (triple, order) = part.approximation.method, Port(part, target[1]).motion_and_order()
        if method is None and target not in self.kernel.late_inputs:
            return "newest", [own], 0
        port = [self.kernel.bus.index[feeds[end.reference]] for end in triple or () if end.reference in feeds]
        return ("taylor", port, order) if method == 1 and len(port) == 3 else ("taylor", [own], 0)


def _effect_columns(kernel: Kernel) -> dict[VariableReference, list[tuple[int, int, int]]]:
    """Input -> columns of each ∂(acceleration)/∂(input), and of the rate and the value of that acceleration."""
    bus, effects = kernel.bus, dict[VariableReference, list[tuple[int, int, int]]]()
    for (output, input_), column in bus.gain_columns.items():
        ports = _rate_and_value(Port(kernel.simulation.parts[output[0]], output[1]))
        if ports is not None:
            rate, value = ports
            columns = column, bus.index.get(rate.reference, -1), bus.index.get(value.reference, -1)
            effects.setdefault(input_, []).append(columns)
    return effects


def _rate_and_value(acceleration: Port) -> tuple[Port, Port] | None:
    """Rate and value of the port of an acceleration; None for a variable that is not an output acceleration."""
    triple, order = acceleration.motion_and_order()
    if triple is None or order != 2 or acceleration.variable.causality != "output":
        return None
    return triple[1], triple[0]
