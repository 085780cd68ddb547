"""The linear system that deviations from the present point of a run follow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, final

import numpy as np
from scipy.linalg import block_diag

from liaisons.base.arrays import Floats
from liaisons.base.unit_definitions import SAME
from liaisons.cosim import (
    SIGNALS,
    Instance,
    Linearization,
    Simulation,
    SystemComponent,
    VariableReference,
)
from liaisons.errors import SimulationError
from liaisons.linearization.fmu_equations import (
    directional_derivatives,
    identical_knowns,
    present_values,
    rates_and_states,
)


@final
class _Equations:
    """Rates and outputs of one FMU at its present point, and their derivatives by states and inputs.

    :ivar jacobian: shape (rates and outputs, states and inputs).
    """

    def __init__(self, part: SystemComponent, instance: Instance, outputs: Iterable[str], time: float) -> None:
        fmu, when = part.fmu, f" at t = {time:.10g} s"
        rates, self.states = rates_and_states(fmu)
        self.inputs = [fmu.variables[name] for name in fmu.reals("input") if fmu.variables[name].continuous]
        self.outputs = [fmu.variables[name] for name in outputs]
        knowns, unknowns = [*self.states, *self.inputs], [*rates, *self.outputs]
        self.point, self.rates = (present_values(instance, variables, when) for variables in (knowns, rates))
        if knowns and not fmu.provides_directional_derivatives and None in identical_knowns(unknowns, knowns):
            words = "it provides no directional derivatives; linearize() takes differences of FMUs for Model Exchange"
            raise SimulationError(f"{part.name} ({fmu.path.name}) cannot be linearized: {words}")
        self.jacobian = directional_derivatives(instance, unknowns, knowns, np.eye(len(knowns)), when)


def _is_output(part: SystemComponent, name: str) -> bool:
    variable = part.fmu.variables[name]
    return variable.type == "Real" and variable.causality != "input"


def _unconnected_matrices(equations: Iterable[_Equations]) -> Any:
    """Matrices A, B, C and D of all FMUs side by side."""
    jacobians = [(one.jacobian, len(one.states)) for one in equations]
    blocks = [(J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:]) for J, n in jacobians]
    return (block_diag(*of_fmus) for of_fmus in zip(*blocks, strict=True))


def _interconnection(
    simulation: Simulation, inputs: Sequence[VariableReference], outputs: Mapping[VariableReference, int]
) -> tuple[Floats, Floats, dict[VariableReference, int]]:
    """Matrices of u = M y + E v, with inputs u and outputs y of the FMUs, and the inputs v of the whole.

    :param outputs: places of the outputs in y.
    :returns: M, E, and the places of the inputs in v.
    """
    sources = {target: simulation.feeds.get(target, target) for target in inputs}
    sources = {target: target if source[0] == SIGNALS else source for target, source in sources.items()}
    outer = dict.fromkeys(source for source in sources.values() if source not in outputs)
    v = {source: i for i, source in enumerate(outer)}
    M, E = np.zeros((len(inputs), len(outputs))), np.zeros((len(inputs), len(v)))
    for i, (target, source) in enumerate(sources.items()):
        matrix, columns = (M, outputs) if source in outputs else (E, v)
        matrix[i, columns[source]] = simulation.conversions.get(target, SAME).factor
    return M, E, v


def linearization_of_run(
    simulation: Simulation, instances: Mapping[str, Instance], time: float, present: Mapping[str, float]
) -> Linearization:
    """The linear system of a simulation about its present point.

    Its inputs are those that nothing feeds, functions of time, and outputs of sampled components.

    :param time: of the point [s].
    :param present: values of recorded variables there, by name.
    :raises SimulationError: for an FMU that provides no directional derivatives, or refuses one.
    """
    feeds, parts = simulation.feeds, simulation.parts
    moving = {name: part for name, part in parts.items() if not part.fmu.has_sampled_outputs}
    names = {place: name for name, place in simulation.recorded.items()}

    def label(place: VariableReference) -> str:
        return names.get(place) or (place[1] if simulation.document.single else ".".join(place))

    observed = [(owner, name) for owner, name in names if owner in moving and _is_output(parts[owner], name)]
    needed = dict.fromkeys([*observed, *(source for source in feeds.values() if source[0] in moving)])
    equations = {
        name: _Equations(part, instances[name], [v for owner, v in needed if owner == name], time)
        for name, part in moving.items()
    }
    groups = {
        kind: [(name, variable.name) for name, one in equations.items() for variable in getattr(one, kind)]
        for kind in ("states", "inputs", "outputs")
    }
    A, B, C, D = _unconnected_matrices(equations.values())
    outputs = {source: i for i, source in enumerate(groups["outputs"])}
    M, E, v = _interconnection(simulation, groups["inputs"], outputs)
    loop = np.linalg.inv(np.eye(len(M)) - M @ D)
    by_x, by_v = loop @ M @ C, loop @ E
    rows = [outputs[place] for place in observed]
    point = [(name, zip((*one.states, *one.inputs), one.point, strict=True)) for name, one in equations.items()]
    values = {label((name, variable.name)): float(value) for name, pairs in point for variable, value in pairs}
    values |= present
    variables = {label((o, n)): parts[o].fmu.variables[n].unit for o, n in (*groups["states"], *v, *observed)}
    return Linearization(
        simulation.title,
        A + B @ by_x,
        B @ by_v,
        (C + D @ by_x)[rows],
        (D @ by_v)[rows],
        *(tuple(map(label, group)) for group in (groups["states"], v, observed)),
        rates=np.concatenate([np.empty(0), *(one.rates for one in equations.values())]),
        values={name: values[name] for name in variables},
        units=variables,
        method="directional derivatives",
    )
