"""Components of a system, FMUs with start values, and their ports."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Any, Literal, final

from liaisons.base.arguments import as_path, shown, start_value_hints
from liaisons.base.processes import TIME_LIMIT
from liaisons.base.unit_definitions import UnitDefinition
from liaisons.cosim.structure.schedule import VariableReference, name_of
from liaisons.errors import ConnectError, InvalidValueError, SimulationError
from liaisons.fmu_files import (
    NUMBERS,
    RECORDED,
    Fmu,
    SampledFunction,
    Scalar,
    Starts,
    TerminalDescription,
    VariableType,
    checked_starts,
    read,
    structural_sizes,
)

INPUT_RECONSTRUCTION = "input_reconstruction"
"""Parameter of FMUs of liaisons: how inputs move within a step: 0 hold, 1 extrapolate, 2 interpolate."""

InputInterface = Literal["derivatives", "intermediate update", "end value", "mean value"]
"""Values of an input that an FMU takes for a step: derivatives at its start, values at instants inside, the value at
its end, to which the FMU interpolates, or one value for the whole step."""


@final
@dataclass(frozen=True)
class InputApproximation:
    """How an FMU approximates its inputs within a communication step.

    :param method: 0 hold, 1 extrapolate, 2 interpolate; None if the coupling decides: for FMUs of other tools and in
        Model Exchange.
    :param is_chosen: whether the user has chosen to hold or extrapolate, which takes no values from the end of a step.
    :param takes_every_order: whether it takes derivatives of inputs of every order, not of the first alone.
    :param holds_by_choice: whether the user has chosen to hold inputs between communication points.
    :param takes_end_values: whether inputs that are set before a step are their values at its end.
    :param takes_polynomials: whether the motion of inputs within a step can be handed over as polynomials.
    :param follows_polynomials: whether they follow these to every order, unless the user has chosen otherwise.
    """

    method: int | None
    is_chosen: bool
    interface: InputInterface
    takes_every_order: bool
    holds_by_choice: bool
    takes_end_values: bool
    takes_polynomials: bool
    follows_polynomials: bool


@final
@dataclass(frozen=True, eq=False)
class SystemComponent:
    """An FMU in a system; ``component["length"]`` is a port.

    :param name: name in the system.
    :param fmu: description of the file.
    :param starts: start values that differ from those of the FMU.
    :param isolated: time limit [s] of a call to another process; 0: the FMU runs in this process.
    """

    name: str
    fmu: Fmu
    starts: Starts
    isolated: float = 0.0

    @classmethod
    def read(
        cls,
        name: str,
        path: Path | str | SampledFunction,
        starts: Mapping[str, object],
        *,
        isolated: bool | float = False,
    ) -> SystemComponent:
        """Component of an FMU that is read from its file, with checked start values.

        :param isolated: time limit [s] of a call to another process; True: :data:`TIME_LIMIT`.
        :raises SimulationError: if the file cannot be used here, or a start value does not fit.
        """
        is_function = isinstance(path, SampledFunction)
        fmu = path.description() if is_function else read(as_path(f"{name}: fmu", path))
        limit = 0.0
        if isolated is not False:
            with start_value_hints(fmu.variables):
                limit = time_limit(f"{name}: isolated =", isolated)
        if fmu.structural_parameters and (sizes := structural_sizes(name, fmu, starts)):
            fmu = read(fmu.path, sizes)
        return cls(name, fmu, checked_starts(name, fmu, starts), limit)

    def __getitem__(self, name: str) -> Port:
        """Port of a variable, an array or a terminal, such as the point ``"bob"`` of ``bob_x`` and ``bob_z``.

        The name of a terminal with value, rate and acceleration gives the port of its value.

        :raises ConnectError: for an unknown name; the message suggests the nearest one.
        """
        if not isinstance(name, str):
            raise ConnectError(f"{self.name}: a port is chosen by its name, not by {shown(name)}")
        port = Port(self, name)
        if port.exists:
            return port
        if port.terminal is None:
            raise ConnectError(f"{self.name}: {self.fmu.unknown_variable_message(name, *self.fmu.terminals.named)}")
        return port.value_port

    @property
    def element_starts(self) -> dict[str, Any]:
        """Start values that differ from the FMU's, by names of scalars; arrays are split into elements."""
        return {
            element: value
            for name, values in self.starts.items()
            for element, value in zip(
                self.fmu.elements(name), values if isinstance(values, tuple) else (values,), strict=True
            )
        }

    @property
    def sampling_period(self) -> float:
        """Sampling period [s]; 0 of an FMU that does not sample."""
        if isinstance(self.fmu.function, SampledFunction):
            return self.fmu.function.period
        period = self.fmu.variables.get("period") if self.fmu.has_sampled_outputs else None
        return 0.0 if period is None else float(str(self.starts.get("period", period.start)))

    @property
    def transferable_types(self) -> frozenset[VariableType]:
        """Types of variables that can be recorded and connected: no strings of an isolated FMU."""
        return NUMBERS if self.isolated else RECORDED

    def recordable_names(self, name: str) -> list[str]:
        """Names of the scalars to record for a name: its own, or those of the elements of an array.

        :raises SimulationError: for an unknown name, or a type that cannot be recorded.
        """
        names = self.fmu.elements(name) if name in self.fmu.arrays else [name]
        scalars = [self.scalar(element) for element in names]
        for variable in scalars:
            if variable.type not in self.transferable_types:
                words = f"is {variable.type}{' of an isolated FMU' if self.isolated else ''} and cannot be recorded"
                allowed = ", ".join(sorted(self.transferable_types))
                raise SimulationError(f"{self.name}.{name} {words}, only {allowed} can: leave it out")
        return names

    def scalars(self, references: Iterable[VariableReference]) -> list[Scalar]:
        """The scalar variables to which references of its own lead."""
        return [*map(self.fmu.variables.__getitem__, map(name_of, references))]

    def scalar(self, name: str) -> Scalar:
        """The scalar variable with a name.

        :raises SimulationError: for an unknown name; the message suggests the nearest one.
        """
        if name not in self.fmu.variables:
            raise SimulationError(f"{self.name}: {self.fmu.unknown_variable_message(name)}")
        return self.fmu.variables[name]

    @cached_property
    def approximation(self) -> InputApproximation:
        """Approximation of its inputs within a communication step."""
        fmu, variable, method = self.fmu, self.fmu.variables.get(INPUT_RECONSTRUCTION), None
        if variable is not None and variable.type == "Integer" and not fmu.is_model_exchange:
            with suppress(ValueError):  # an FMU of another tool
                method = int(self.starts.get(INPUT_RECONSTRUCTION, variable.start or 1))  # type: ignore[arg-type] - one Integer
        interface: InputInterface = "derivatives" if fmu.input_derivatives else "mean value"
        if method == 2:
            interface = "end value"
        elif (
            method is not None and fmu.takes_intermediate_inputs
        ):  # FMUs of other tools may claim it without ever asking
            interface = "intermediate update"
        is_chosen = INPUT_RECONSTRUCTION in self.starts and method in {0, 1}
        as_polynomials = interface in {"derivatives", "intermediate update"}
        takes_every_order = method is not None or fmu.is_model_exchange
        return InputApproximation(
            method,
            is_chosen,
            interface,
            takes_every_order,
            holds_by_choice=is_chosen and method == 0,
            takes_end_values=interface == "end value",
            takes_polynomials=as_polynomials,
            follows_polynomials=as_polynomials and takes_every_order and not is_chosen,
        )

    def interpolating_copy(self) -> SystemComponent:
        """Copy that interpolates its inputs."""
        return replace(self, starts={**self.starts, INPUT_RECONSTRUCTION: 2})

    def extrapolating_copy(self) -> SystemComponent:
        """Copy that extrapolates its inputs, if it interpolates them between values at both ends of a step."""
        if not self.approximation.takes_end_values:
            return self
        return replace(self, starts={name: v for name, v in self.starts.items() if name != INPUT_RECONSTRUCTION})

    def isolated_copy(self, limit: float = TIME_LIMIT) -> SystemComponent:
        """Copy that runs in another process, with a time limit [s] of a call; the component itself if it does."""
        return self if self.isolated else replace(self, isolated=limit)

    def __repr__(self) -> str:
        starts = "".join(f", {name}={shown(value)}" for name, value in self.starts.items())
        return f"<{self.name}: {self.fmu.path.name}{starts}>"


Components = Mapping[str, SystemComponent]
"""Components by name."""


@final
@dataclass(frozen=True)
class Port:
    """A variable, an array or a terminal of a component, by name."""

    part: SystemComponent
    name: str

    @property
    def variable(self) -> Scalar:
        """The scalar variable of the port."""
        return self.part.fmu.variables[self.name]

    @property
    def unit(self) -> UnitDefinition | None:
        """Definition of the unit of its variable; None if the FMU has none."""
        return self.part.fmu.units.get(self.variable.unit)

    @property
    def reference(self) -> VariableReference:
        """Names of component and variable."""
        return self.part.name, self.name

    @property
    def is_array(self) -> bool:
        """Whether the name is that of an array."""
        return self.name in self.part.fmu.arrays

    @property
    def exists(self) -> bool:
        """Whether the name is that of a variable or an array, not of a terminal such as a point."""
        variables = self.part.fmu.variables
        return self.name in variables.entries or self.name in variables

    def elements(self) -> list[Port]:
        """Ports of the elements of an array; of a scalar, its own.

        :raises ConnectError: for a terminal.
        """
        if not self.exists:
            raise ConnectError(f"{self} is a terminal, not a variable: connect its members one by one")
        return [Port(self.part, name) for name in self.part.fmu.elements(self.name)] if self.is_array else [self]

    @property
    def terminal(self) -> TerminalDescription | None:
        """The terminal to which the variable belongs, or which has the name; None if there is none."""
        terminals = self.part.fmu.terminals
        return terminals.port(self.name) if self.exists else terminals.get(self.name)

    @property
    def value_port(self) -> Port:
        """Port of the value of its terminal; the port itself if that has no value, rate and acceleration."""
        motion = self.terminal and self.terminal.motion
        return Port(self.part, motion[0]) if motion else self

    @property
    def force(self) -> str | None:
        """Name of the force of its terminal; None if there is none."""
        return self.terminal and self.terminal.force

    def triple(self) -> tuple[Port, Port, Port] | None:
        """Ports of value, rate and acceleration, if the port is the value; else None."""
        triple, order = self.motion_and_order()
        return triple if order == 0 else None

    def motion_and_order(self) -> tuple[tuple[Port, Port, Port] | None, int]:
        """Ports of value, rate and acceleration, and which of them the port is, 0 to 2; (None, 0) if there are none."""
        port = self.part.fmu.terminals.port(self.name) if self.name in self.part.fmu.variables else None
        motion = port and port.motion
        if not motion or self.name not in motion:
            return None, 0
        value, rate, acceleration = motion
        triple = Port(self.part, value), Port(self.part, rate), Port(self.part, acceleration)
        return triple, motion.index(self.name)

    def __str__(self) -> str:
        return f"{self.part.name}.{self.name}"


def time_limit(label: str, isolated: object) -> float:
    """Time limit of a call of an FMU [s], from the setting ``isolated``; 0 if it is not isolated.

    :param label: label of the setting, for messages.
    :raises SimulationError: unless it is a truth value or a finite number that is not negative.
    """
    seconds = TIME_LIMIT if isolated is True else float(isolated) if isinstance(isolated, Real) else math.nan
    if not 0 <= seconds < math.inf:
        raise InvalidValueError(f"{label} {shown(isolated)}: give True, or the seconds that a call may take")
    return seconds
