"""The equations of one FMU: rates of its continuous states, and outputs, as functions of states and inputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any, Self, final, get_args

import numpy as np

from liaisons.base.arguments import check_choice
from liaisons.base.array_names import suffixed_name
from liaisons.base.arrays import Floats
from liaisons.base.differences import extrapolated_derivative
from liaisons.base.folders import temporary_folder
from liaisons.cosim import (
    Call,
    Instance,
    Linearization,
    LinearizationMethod,
    SystemComponent,
    extract_fmus,
    make_instance,
    try_to_start,
)
from liaisons.errors import RefusedError, SimulationError
from liaisons.fmu_files import Fmu, Scalar, checked_starts, read

_COMPARED = 1e-4
"""Size of the difference that the extrapolated one is compared with, relative to that of the variable."""
_AGREEMENT = 1e-3
"""Relative error of these differences."""
_NOISE = 1e-6
"""Relative error of the values themselves."""


@final
class FmuEquations:
    """Equations of an FMU that is initialized for Model Exchange; a context manager that releases it.

    :param values: start values of variables, arrays and states; of a state ``x`` that of ``x_0`` where there is one.
    :param inputs: names of the inputs; None: all continuous ones.
    :param outputs: names of the outputs, or of further variables; None: all real outputs.
    :param time: of initialization [s].
    :ivar states, inputs, outputs: the variables, element by element.
    :ivar unknowns: rates and outputs; ``knowns``: states and inputs.
    :ivar x, u: states and inputs after initialization, shapes (states,) and (inputs,).
    :ivar has_events: whether it has event indicators or a time event.
    :raises SimulationError: for an unknown name, a value that does not fit or is refused, an FMU without this kind, or
        one that is sampled.
    """

    def __init__(
        self,
        path: Path,
        values: Mapping[str, object],
        *,
        inputs: Iterable[str] | None = None,
        outputs: Iterable[str] | None = None,
        time: float = 0.0,
    ) -> None:
        name, self.time = path.stem, time
        fmu = read(path, prefers="ModelExchange")
        if fmu.has_sampled_outputs:
            words = "its outputs hold, and depend on nothing between samples; linearize what it controls"
            raise SimulationError(f"{name} is sampled: {words}")
        if not fmu.is_model_exchange:
            raise SimulationError(f"{path}: its states cannot be moved, for it is not made for Model Exchange")
        part = SystemComponent(name, fmu, {})
        rates, self.states = rates_and_states(fmu)
        self.inputs, self.outputs = (
            [fmu.variables[n] for group in (default if names is None else names) for n in part.recordable_names(group)]
            for names, default in (
                (inputs, [n for n in fmu.reals("input") if fmu.variables[n].continuous]),
                (outputs, fmu.reals("output")),
            )
        )
        self.fmu, self.unknowns, self.knowns = fmu, [*rates, *self.outputs], [*self.states, *self.inputs]
        starts, states = self._starts_and_states(values)
        part = SystemComponent(name, fmu, checked_starts(name, fmu, starts))
        with ExitStack() as stack:
            folder = extract_fmus([fmu], stack.enter_context(temporary_folder()))[fmu.path]
            try_to_start(part, folder, (time, time + 1.0))
            self._instance = stack.enter_context(make_instance(name, fmu, folder))
            self._instance.initialize(part.starts, None, time, time + 1.0)
            self._instance.exit_initialization()
            self._in, self._out = np.zeros(len(self.inputs)), np.zeros(len(self.unknowns))
            self._calls: list[Call] = [
                prepare(variables, values)
                for prepare, variables, values in (
                    (self._instance.setter, self.inputs, self._in),
                    (self._instance.getter, self.unknowns, self._out),
                )
                if variables
            ]
            self.u = present_values(self._instance, self.inputs, self._when)
            self.x, nominals = self._instance.continuous_states
            if not len(rates) == len(self.states) == len(self.x):
                raise SimulationError(f"{path}: names {len(self.states)} of its {len(self.x)} states; ask its maker")
            for state, value in states.items():
                self.x[[s.name in fmu.elements(state) for s in self.states]] = value
            sizes = np.abs(np.concatenate([self.x, self.u]))
            self.sizes = np.where(sizes > 0, sizes, np.concatenate([nominals, np.ones_like(self.u)]))
            self.has_events = self._instance.has_events
            self._stack = stack.pop_all()

    @staticmethod
    def are_differentiable(path: Path) -> bool:
        """Whether an FMU is in continuous time, and provides directional derivatives."""
        fmu = read(path, prefers="ModelExchange")
        return fmu.provides_directional_derivatives and not fmu.has_sampled_outputs

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _starts_and_states(self, values: Mapping[str, object]) -> tuple[dict[str, object], dict[str, Any]]:
        """Start values, and values of states that are set after initialization."""
        fmu, names = self.fmu, {state.name for state in self.states}
        present = {*fmu.arrays, *fmu.variables}
        starts, states = dict(values), {}
        for name in values:
            start = suffixed_name(name, "_0")
            if name not in present or fmu.variables.entry(name).prototype.settable:
                continue
            if start in present:
                starts[start] = starts.pop(name)
            elif names.issuperset(fmu.elements(name)):
                states[name] = starts.pop(name)
        return starts, states

    @property
    def _when(self) -> str:
        return f" at t = {self.time:.10g} s"

    def __call__(self, time: float, x: Floats, u: Floats) -> Floats:
        """Rates and outputs at a time [s], which remains the point of the FMU, shape (unknowns,).

        :raises RefusedError: if the FMU discards them.
        """
        self.time = time
        self._instance.set_time_and_states(time, x)
        self._in[:] = u
        for call in self._calls:
            call.perform(self._when)
        return self._out.copy()

    def directional_derivatives(self, directions: Floats) -> Floats:
        """Derivatives of rates and outputs along directions, from the FMU at its present point, (unknowns, directions).

        :param directions: shape (knowns, directions).
        """
        return directional_derivatives(self._instance, self.unknowns, self.knowns, directions, self._when)

    def differences(self) -> Floats:
        """Derivatives by each state and input, extrapolated from differences, (unknowns, knowns)."""
        columns = [
            extrapolated_derivative(partial(self._displaced_unknowns, k), size)[0] for k, size in enumerate(self.sizes)
        ]
        return np.array(columns).reshape(len(self.knowns), len(self.unknowns)).T

    def checked_jacobian(self) -> Floats:
        """Directional derivatives by each state and input, (unknowns, knowns), compared with differences.

        :raises SimulationError: naming both variables, if a derivative contradicts them.
        """
        values = self(self.time, self.x, self.u)
        jacobian = self.directional_derivatives(np.eye(len(self.knowns)))
        for k, (known, size, column) in enumerate(zip(self.knowns, self.sizes, jacobian.T, strict=True)):
            with suppress(RefusedError):  # at the edge of its domain
                sides = [(self._displaced_unknowns(k, h) - values) / (h * size) for h in (_COMPARED, -_COMPARED)]
                (low, high), largest = np.sort(sides, axis=0), np.abs(sides).max(axis=0)
                allowed = high - low + _AGREEMENT * largest + _NOISE * (np.abs(values) / size + np.abs(column).max())
                right = (low - allowed <= column) & (column <= high + allowed)
                if not right.all():
                    i = int(np.argmin(right))
                    raise SimulationError(
                        f"{self.fmu.path.name}: its derivative of {self.unknowns[i].name} by {known.name} is "
                        f"{column[i]:g}, but {sides[0][i]:g} by a difference; ask its maker, or take differences"
                    )
        return jacobian

    def linearization(self, method: LinearizationMethod | None = None) -> Linearization:
        """The linear system of deviations from states and inputs after initialization.

        :param method: None: directional derivatives where there are any.
        :raises SimulationError: for another method, or if a directional derivative contradicts differences.
        """
        if method is not None:
            check_choice("linearize: method", method, get_args(LinearizationMethod))
        states, point = len(self.states), self(self.time, self.x, self.u)
        method = method or ("directional derivatives" if self.fmu.provides_directional_derivatives else "differences")
        jacobian = self.differences() if method == "differences" else self.checked_jacobian()
        variables, values = [*self.knowns, *self.outputs], (*self.x, *self.u, *point[states:])
        return Linearization(
            self.fmu.path.stem,
            jacobian[:states, :states],
            jacobian[:states, states:],
            jacobian[states:, :states],
            jacobian[states:, states:],
            *(tuple(variable.name for variable in group) for group in (self.states, self.inputs, self.outputs)),
            rates=point[:states],
            values={variable.name: float(value) for variable, value in zip(variables, values, strict=True)},
            units={variable.name: variable.unit for variable in variables},
            method=method,
        )

    def _displaced_unknowns(self, k: int, factor: float) -> Floats:
        """Rates and outputs after one state or input has moved by a multiple of its size, (unknowns,)."""
        moved = np.concatenate([self.x, self.u])
        moved[k] += factor * self.sizes[k]
        return self(self.time, *np.split(moved, [len(self.x)]))


def rates_and_states(fmu: Fmu) -> tuple[list[Scalar], list[Scalar]]:
    """Derivatives and continuous states of an FMU, element by element, without aliases."""
    positions: dict[int, dict[int, Scalar]] = {}
    for variable in fmu.variables.values():
        positions.setdefault(variable.index, {}).setdefault(variable.position, variable)
    rates, states = ([v for pair in fmu.continuous_states for v in positions[pair[i]].values()] for i in (0, 1))
    return rates, states


def present_values(instance: Instance, variables: Sequence[Scalar], when: str) -> Floats:
    """The present values of variables of an FMU.

    :param when: words for the time, of an error.
    """
    values = np.empty(len(variables))
    if variables:
        instance.getter(variables, values).perform(when)
    return values


def identical_knowns(unknowns: Iterable[Scalar], knowns: Iterable[Scalar]) -> list[int | None]:
    """Which of the knowns each unknown is; None for one that an FMU calculates."""
    numbers = {(known.reference, known.position): k for k, known in enumerate(knowns)}
    return [numbers.get((unknown.reference, unknown.position)) for unknown in unknowns]


def directional_derivatives(
    instance: Instance, unknowns: Sequence[Scalar], knowns: Sequence[Scalar], directions: Floats, when: str
) -> Floats:
    """Derivatives of unknowns along directions from the FMU at its present point, shape (unknowns, directions).

    :param directions: shape (knowns, directions).
    :param when: words for the time, of an error.
    :raises SimulationError: if the FMU refuses one.
    """
    identical = identical_knowns(unknowns, knowns)
    calculated = [i for i, k in enumerate(identical) if k is None]  # FMUs need not know the derivatives of the others
    result = np.zeros((len(unknowns), directions.shape[1]))
    result[[i for i, k in enumerate(identical) if k is not None]] = directions[[k for k in identical if k is not None]]
    if calculated and directions.size:
        seed, values = np.zeros(len(knowns)), np.empty(len(calculated))
        derive = instance.directional_derivatives([unknowns[i] for i in calculated], knowns, seed, values)
        for k, direction in enumerate(directions.T):
            seed[:] = direction
            derive.perform(when)
            result[calculated, k] = values
    return result
