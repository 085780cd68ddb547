"""The linear system that deviations from the present point of a run follow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, final

import numpy as np
from scipy.linalg import block_diag

from liaisons.base.unit_definitions import SAME
from liaisons.cosim.arrays import Vector
from liaisons.cosim.description.variables import Scalar
from liaisons.cosim.instances.protocol import Instance, Instances
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS
from liaisons.errors import SimulationError

Method = Literal["directional derivatives", "differences"]
"""How derivatives are calculated: by the FMU, or from values at points near each other."""


@final
@dataclass(frozen=True, eq=False, repr=False)
class Linearization:
    """x' = rates + A Δx + B Δu, y = y* + C Δx + D Δu, for deviations Δ from a point x*, u*, y*.

    :param title: what was linearized.
    :param A: shape (states, states).
    :param B: shape (states, inputs).
    :param C: shape (outputs, states).
    :param D: shape (outputs, inputs).
    :param states: names, element by element.
    :param inputs: names, element by element.
    :param outputs: names, element by element.
    :param rates: of the states at the point, shape (states,); 0 at an equilibrium.
    :param values: of states, inputs and outputs at the point, by name.
    :param units: name -> unit; empty where there is none.
    :param method: the FMU's ``"directional derivatives"``, or ``"differences"``.
    """

    title: str
    A: Vector
    B: Vector
    C: Vector
    D: Vector
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    rates: Vector
    values: Mapping[str, float]
    units: Mapping[str, str]
    method: Method

    def __repr__(self) -> str:
        sizes = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<Linearization of {self.title}: {sizes}, by {self.method}>"

    @property
    def poles(self) -> Any:
        """Eigenvalues of A [1/s], complex, shape (states,)."""
        return np.sort_complex(np.linalg.eigvals(self.A))

    def to_control(self) -> Any:
        """The linear system as ``StateSpace`` of python-control; its names have ``_`` for dots.

        :raises SimulationError: if python-control is missing (``pip install 'liaisons[control]'``).
        """
        try:
            from control import ss
        except ImportError:
            raise SimulationError("to_control needs python-control; pip install 'liaisons[control]'") from None
        labels = {
            kind: [name.replace(".", "_") for name in getattr(self, kind)] for kind in ("states", "inputs", "outputs")
        }
        return ss(self.A, self.B, self.C, self.D, **labels)


@final
class _Equations:
    """Rates and outputs of one FMU at its present point, and their derivatives by states and inputs.

    :ivar jacobian: shape (rates and outputs, states and inputs).
    """

    def __init__(self, part: SystemComponent, instance: Instance, outputs: Iterable[str], time: float) -> None:
        fmu, when = part.fmu, f" at t = {time:.10g} s"
        places: dict[int, dict[int, Scalar]] = {}
        for variable in fmu.variables.values() if fmu.continuous_states else ():
            places.setdefault(variable.index, {}).setdefault(variable.position, variable)
        rates, self.states = ([v for pair in fmu.continuous_states for v in places[pair[i]].values()] for i in (0, 1))
        self.inputs = [fmu.variables[name] for name in fmu.reals("input") if fmu.variables[name].continuous]
        self.outputs = [fmu.variables[name] for name in outputs]
        knowns, unknowns = [*self.states, *self.inputs], [*rates, *self.outputs]
        self.point, self.rates = (_present_values(instance, variables, when) for variables in (knowns, rates))
        self.jacobian = np.zeros((len(unknowns), len(knowns)))
        number = {(known.reference, known.position): k for k, known in enumerate(knowns)}
        same = [number.get((unknown.reference, unknown.position)) for unknown in unknowns]
        self.jacobian[[i for i, k in enumerate(same) if k is not None], [k for k in same if k is not None]] = 1
        calculated = [i for i, k in enumerate(same) if k is None]
        if not calculated or not knowns:
            return
        if not fmu.provides_directional_derivatives:
            words = "it provides no directional derivatives; linearize() takes differences of FMUs for Model Exchange"
            raise SimulationError(f"{part.name} ({fmu.path.name}) cannot be linearized: {words}")
        seed, values = np.zeros(len(knowns)), np.empty(len(calculated))
        derive = instance.directional_derivatives([unknowns[i] for i in calculated], knowns, seed, values)
        for k in range(len(knowns)):
            seed[:] = np.arange(len(knowns)) == k
            derive.perform(when)
            self.jacobian[calculated, k] = values


def _present_values(instance: Instance, variables: list[Scalar], when: str) -> Vector:
    """The present values of variables of an FMU."""
    values = np.empty(len(variables))
    if variables:
        instance.getter(variables, values).perform(when)
    return values


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
) -> tuple[Vector, Vector, dict[VariableReference, int]]:
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


def linearization(
    simulation: Simulation, instances: Instances, time: float, present: Mapping[str, float]
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
