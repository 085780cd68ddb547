"""Components of a system: an FMU with start values each, and the ports by which they are connected."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from numbers import Real
from pathlib import Path
from typing import Any, Literal, final, get_args

from liaisons.base.arguments import as_path, shown, start_value_hints
from liaisons.base.processes import TIME_LIMIT
from liaisons.base.unit_definitions import UnitDefinition
from liaisons.cosim.description.fmu import Fmu, read
from liaisons.cosim.description.sampled_function import SampledFunction
from liaisons.cosim.description.start_values import Starts, start_values, structural_sizes
from liaisons.cosim.description.terminals import TerminalDescription
from liaisons.cosim.description.variables import NUMBERS, RECORDED, Scalar, VariableType
from liaisons.errors import ConnectError, InvalidValueError, SimulationError

INPUT_RECONSTRUCTION = "input_reconstruction"
"""Parameter of FMUs of liaisons: how inputs move within a step: 0 hold, 1 extrapolate, 2 interpolate."""

Triple = tuple[str, str, str]
"""Names of value, rate and acceleration."""

Solver = Literal["cvode"]
"""Solver of a Model Exchange FMU; None: DOP853, and an implicit one once its equations turn out to be stiff."""

InputInterface = Literal["derivatives", "intermediate update", "end value", "mean value"]
"""What an FMU takes for the values of an input within a step: derivatives at its start, values at instants inside, the
value at its end, from which it interpolates, or one value for the whole step."""


@final
@dataclass(frozen=True)
class InputApproximation:
    """How an FMU approximates its inputs within a communication step.

    :param method: 0 hold, 1 extrapolate, 2 interpolate; None if the coupling decides: for FMUs of other tools and in
        Model Exchange.
    :param is_prescribed: the user has said that inputs hold or extrapolate, without values from the end of a step.
    :param takes_every_order: derivatives of inputs of every order are taken, not the first one only.
    """

    method: int | None
    is_prescribed: bool
    interface: InputInterface
    takes_every_order: bool

    @property
    def interpolates(self) -> bool:
        """Whether inputs that are set before a step are those at its end."""
        return self.interface == "end value"

    @property
    def samples(self) -> bool:
        """Whether the user has said that inputs hold: the values depend on where communication points are."""
        return self.is_prescribed and self.method == 0

    @property
    def takes_polynomials(self) -> bool:
        """Whether it can be given polynomials, so that derivatives of its outputs are right."""
        return self.interface in {"derivatives", "intermediate update"}

    @property
    def follows_polynomials(self) -> bool:
        """Whether it follows polynomials of every order, and the user has not said otherwise."""
        return self.takes_polynomials and self.takes_every_order and not self.is_prescribed


@final
@dataclass(frozen=True, eq=False)
class SystemComponent:
    """One FMU in a system; ``component["length"]`` is a port.

    :param name: name in the system.
    :param fmu: description of the file.
    :param starts: start values that differ from those of the FMU.
    :param isolated: time limit [s] of a call in a process of its own; 0: it runs in this process.
    :param solver: of its equations, in Model Exchange; None: see :data:`Solver`.
    """

    name: str
    fmu: Fmu
    starts: Starts
    isolated: float = 0.0
    solver: Solver | None = None

    @classmethod
    def read(
        cls,
        name: str,
        path: Path | str | SampledFunction,
        starts: Mapping[str, object],
        *,
        isolated: bool | float = False,
        solver: Solver | float | None = None,  # a number for type checkers: start values come as dicts of them
    ) -> SystemComponent:
        """Read an FMU and check the start values for it.

        :param isolated: True: as long as :data:`TIME_LIMIT`.
        :raises SimulationError: if the file cannot be used here, or a start value or solver does not fit.
        """
        is_function = isinstance(path, SampledFunction)
        fmu = path.description() if is_function else read(as_path(f"{name}: fmu", path))
        with start_value_hints(fmu.variables):
            limit = time_limit(f"{name}: isolated =", isolated)
            if solver is not None and (not isinstance(solver, str) or solver not in get_args(Solver)):
                raise InvalidValueError(f"{name}: solver = {shown(solver)}: give 'cvode', or leave it out")
            if solver is not None and not fmu.is_model_exchange:
                raise InvalidValueError(
                    f"{name}: solver = {solver!r} is for FMUs of Model Exchange, and {fmu.path.name} has its own: "
                    "leave it out"
                )
        if sizes := structural_sizes(name, fmu, starts):
            fmu = read(fmu.path, sizes)
        return cls(name, fmu, start_values(name, fmu, starts), limit, solver)

    def __getitem__(self, name: str) -> Port:
        """The variable, array or terminal of a name, for example the point ``"bob"`` of ``bob_x`` and ``bob_z``.

        A port that is called otherwise than its value is that value.

        :raises ConnectError: for an unknown name; the message suggests the nearest one.
        """
        if not isinstance(name, str):
            raise ConnectError(f"{self.name}: ports go by name, {shown(name)} is none")
        port = Port(self, name)
        if port.exists:
            return port
        if port.terminal is None:
            raise ConnectError(f"{self.name}: {self.fmu.unknown_variable_message(name, *self.fmu.terminals.named)}")
        return port.value_port

    @property
    def element_starts(self) -> dict[str, Any]:
        """Start values that differ from those of the FMU, of arrays element by element."""
        return {
            element: value
            for name, values in self.starts.items()
            for element, value in zip(
                self.fmu.elements(name), values if isinstance(values, tuple) else (values,), strict=True
            )
        }

    @property
    def sampling_period(self) -> float:
        """Sampling period [s]; 0 where it does not sample."""
        if isinstance(self.fmu.function, SampledFunction):
            return self.fmu.function.period
        period = self.fmu.variables.get("period") if self.fmu.has_sampled_outputs else None
        return 0.0 if period is None else float(str(self.starts.get("period", period.start)))

    @property
    def carried(self) -> frozenset[VariableType]:
        """Types that can be read and set: strings have other addresses in another process."""
        return NUMBERS if self.isolated else RECORDED

    def recordable_names(self, name: str) -> list[str]:
        """Names of a scalar, or of all elements of an array.

        :raises SimulationError: for an unknown name, or a type that cannot be recorded.
        """
        names = self.fmu.elements(name) if name in self.fmu.arrays else [name]
        scalars = [self.scalar(element) for element in names]
        for variable in scalars:
            if variable.type not in self.carried:
                words = f"is {variable.type}{' of an isolated FMU' if self.isolated else ''} and cannot be recorded"
                allowed = ", ".join(sorted(self.carried))
                raise SimulationError(f"{self.name}.{name} {words}: leave it out; what can is {allowed}")
        return names

    def scalar(self, name: str) -> Scalar:
        """The scalar of this name.

        :raises SimulationError: for an unknown name; the message suggests the nearest one.
        """
        if name not in self.fmu.variables:
            raise SimulationError(f"{self.name}: {self.fmu.unknown_variable_message(name)}")
        return self.fmu.variables[name]

    @cached_property
    def approximation(self) -> InputApproximation:
        """How it approximates its inputs within a communication step."""
        fmu, method = self.fmu, self._input_reconstruction()
        interface: InputInterface = "derivatives" if fmu.input_derivatives else "mean value"
        if method == 2:
            interface = "end value"
        elif method is not None and fmu.inside_inputs:  # FMUs of other tools may claim it without ever asking
            interface = "intermediate update"
        is_prescribed = INPUT_RECONSTRUCTION in self.starts and method in {0, 1}
        return InputApproximation(method, is_prescribed, interface, method is not None or fmu.is_model_exchange)

    def _input_reconstruction(self) -> int | None:
        variable = self.fmu.variables.get(INPUT_RECONSTRUCTION)
        if variable is None or variable.type != "Integer" or self.fmu.is_model_exchange:
            return None
        try:
            return int(self.starts.get(INPUT_RECONSTRUCTION, variable.start or 1))  # type: ignore[arg-type] - one Integer
        except ValueError:  # not one of ours after all
            return None

    def interpolating(self) -> SystemComponent:
        """A copy that interpolates its inputs."""
        return replace(self, starts={**self.starts, INPUT_RECONSTRUCTION: 2})

    def isolated_copy(self, limit: float = TIME_LIMIT) -> SystemComponent:
        """A copy in a process of its own; itself if it has one."""
        return self if self.isolated else replace(self, isolated=limit)

    def __repr__(self) -> str:
        starts = "".join(f", {name}={shown(value)}" for name, value in self.starts.items())
        return f"<{self.name}: {self.fmu.path.name}{starts}>"


Components = Mapping[str, SystemComponent]
"""Components by name."""


@final
@dataclass(frozen=True)
class Port:
    """A variable, an array or a terminal of a component, to be connected with another."""

    part: SystemComponent
    name: str

    @property
    def variable(self) -> Scalar:
        """The variable of this name."""
        return self.part.fmu.variables[self.name]

    @property
    def unit(self) -> UnitDefinition | None:
        """The definition of its unit; None if it is undefined."""
        return self.part.fmu.units.get(self.variable.unit)

    @property
    def reference(self) -> tuple[str, str]:
        """Names of component and variable."""
        return self.part.name, self.name

    @property
    def is_array(self) -> bool:
        """Whether it is an array."""
        return self.name in self.part.fmu.arrays

    @property
    def exists(self) -> bool:
        """Whether it is a variable or an array, and not a terminal like a point."""
        return self.is_array or self.name in self.part.fmu.variables

    def elements(self) -> list[Port]:
        """The elements of an array; of a scalar, itself.

        :raises ConnectError: for a terminal that has no variable of its own.
        """
        if not self.exists:
            raise ConnectError(f"{self} is a terminal and no variable: connect its members one by one")
        return [Port(self.part, name) for name in self.part.fmu.elements(self.name)]

    @property
    def terminal(self) -> TerminalDescription | None:
        """The port that a variable is a member of, or the terminal of this name; None if there is none."""
        terminals = self.part.fmu.terminals
        return terminals.port(self.name) if self.exists else terminals.get(self.name)

    @property
    def value_port(self) -> Port:
        """The value of the port that this is or belongs to; of all else, itself."""
        motion = self.terminal and self.terminal.motion
        return Port(self.part, motion[0]) if motion else self

    @property
    def force(self) -> str | None:
        """Name of the force of the port that this is a member of; None if there is none."""
        return self.terminal and self.terminal.force

    def triple(self) -> tuple[Port, Port, Port] | None:
        """Value, rate and acceleration, if this is the value of a port; else None."""
        triple, order = self.motion_and_order()
        return triple if order == 0 else None

    def motion_and_order(self) -> tuple[tuple[Port, Port, Port] | None, int]:
        """Value, rate and acceleration of a port, and which of them this is; (None, 0) if none."""
        names, order = _curve(self.part.fmu, self.name)
        return names and (Port(self.part, names[0]), Port(self.part, names[1]), Port(self.part, names[2])), order

    def __str__(self) -> str:
        return f"{self.part.name}.{self.name}"


def time_limit(label: str, isolated: object) -> float:
    """How long a call of an isolated FMU may take [s]; 0 of one that is not isolated.

    :param label: for messages.
    :raises SimulationError: unless it is a truth value or a finite number that is not negative.
    """
    seconds = TIME_LIMIT if isolated is True else float(isolated) if isinstance(isolated, Real) else math.nan
    if not 0 <= seconds < math.inf:
        raise InvalidValueError(f"{label} {shown(isolated)}: give True, or the seconds that a call may take")
    return seconds


@lru_cache(maxsize=4096)  # of one file there may be thousands of instances
def _curve(fmu: Fmu, name: str) -> tuple[Triple | None, int]:
    port = fmu.terminals.port(name) if name in fmu.variables else None
    motion = port and port.motion
    return (motion, motion.index(name)) if motion and name in motion else (None, 0)
