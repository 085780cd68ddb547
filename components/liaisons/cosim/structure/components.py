"""An FMU in a system, what SSP calls a component, and its ports: the things that are connected."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from numbers import Real
from pathlib import Path
from typing import Literal, final, get_args

from liaisons.arguments import as_path, settings_beside, shown
from liaisons.cosim.description.fmu import Fmu, read
from liaisons.cosim.description.start_values import Value, start_values, structural_sizes
from liaisons.cosim.description.variables import NUMBERS, RECORDED, Scalar, VariableType
from liaisons.errors import ConnectError, SimulationError
from liaisons.processes import TIME_LIMIT

INPUT_RECONSTRUCTION = "input_reconstruction"
"""Parameter by which an FMU of ours says what its inputs do within a step: 0 hold, 1 extrapolate, 2 interpolate."""

Triple = tuple[str, str, str]
"""Names of value, rate and acceleration."""

Solver = Literal["cvode"]
"""What integrates an FMU of Model Exchange from the begin on, where that is not left to what its equations are like."""

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

    @property
    def needs_newest_inputs(self) -> bool:
        """Whether inputs are to be set to the newest values before a step: it interpolates, or is of another tool."""
        return self.method in {None, 2}


@final
@dataclass(frozen=True, eq=False)
class SystemComponent:
    """One FMU in a system, under a name of its own; ``part["length"]`` is one of its ports.

    :param name: name in the system.
    :param fmu: what was read from the file.
    :param starts: start values that differ from those of the FMU.
    :param isolated: it runs in a process of its own, where a call may take so long [s]; 0: in this one.
    :param solver: of its equations, in Model Exchange; None: DOP853 until they turn out to be stiff.
    """

    name: str
    fmu: Fmu
    starts: Mapping[str, Value]
    isolated: float = 0.0
    solver: Solver | None = None

    @classmethod
    def of(
        cls,
        name: str,
        path: Path | str,
        starts: Mapping[str, object],
        *,
        isolated: bool | float = False,
        solver: Solver | float | None = None,  # a number for type checkers: start values come as dicts of them
    ) -> SystemComponent:
        """Read an FMU and check the start values for it.

        :param isolated: True: as long as :data:`TIME_LIMIT`.
        :raises SimulationError: if the file cannot be used here, or a start value or solver does not fit.
        """
        fmu = read(as_path(f"{name}: fmu", path))
        with settings_beside(fmu.variables):
            limit = time_limit(f"{name}: isolated =", isolated)
            if solver is not None and (not isinstance(solver, str) or solver not in get_args(Solver)):
                raise SimulationError(f"{name}: solver = {shown(solver)}: give 'cvode', or leave it out")
            if solver is not None and not fmu.is_model_exchange:
                raise SimulationError(
                    f"{name}: solver = {solver!r} is for FMUs of Model Exchange, and {fmu.path.name} has its own: "
                    "leave it out"
                )
        if sizes := structural_sizes(name, fmu, starts):
            fmu = read(fmu.path, sizes)
        return cls(name, fmu, start_values(name, fmu, starts), limit, solver)

    def __getitem__(self, name: str) -> Port:
        """A variable, an array, the port of that name, or a named point (``"bob"`` for ``bob_x`` and ``bob_z``).

        :raises ConnectError: with the nearest name, if there is nothing of that name.
        """
        if not isinstance(name, str):
            raise ConnectError(f"{self.name}: ports go by name, {shown(name)} is none")
        port = Port(self, name)
        if not port.exists and not port.axes():
            points = {other[:-2] for other in self.fmu.variables.entries if other.endswith(("_x", "_y", "_z"))}
            raise ConnectError(f"{self.name}: {self.fmu.unknown(name, *points)}")
        return port

    @property
    def carried(self) -> frozenset[VariableType]:
        """Types of what can be read from it and given to it: strings have other numbers in another process."""
        return NUMBERS if self.isolated else RECORDED

    def recordable(self, name: str) -> list[str]:
        """Names of the scalars that a name stands for: itself, or all elements of an array.

        :raises SimulationError: if there is none of this name, or its values cannot be recorded.
        """
        names = self.fmu.elements(name) if name in self.fmu.arrays else [name]
        found = [self.scalar(element) for element in names]
        for variable in found:
            if variable.type not in self.carried:
                words = f"is {variable.type}{' of an isolated FMU' if self.isolated else ''} and cannot be recorded"
                known = ", ".join(sorted(self.carried))
                raise SimulationError(f"{self.name}.{name} {words}: leave it out; what can is {known}")
        return names

    def scalar(self, name: str) -> Scalar:
        """The scalar of this name.

        :raises SimulationError: with the nearest name, if there is none.
        """
        if name not in self.fmu.variables:
            raise SimulationError(f"{self.name}: {self.fmu.unknown(name)}")
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
        """The same, but that it interpolates its inputs."""
        return replace(self, starts={**self.starts, INPUT_RECONSTRUCTION: 2})

    def apart(self, limit: float = TIME_LIMIT) -> SystemComponent:
        """The same, isolated, unless it is so already."""
        return self if self.isolated else replace(self, isolated=limit)

    def __repr__(self) -> str:
        starts = "".join(f", {name}={shown(value)}" for name, value in self.starts.items())
        return f"<{self.name}: {self.fmu.path.name}{starts}>"


@final
@dataclass(frozen=True)
class Port:
    """A variable, array, port or point of one component, to be connected with another."""

    part: SystemComponent
    name: str

    @property
    def variable(self) -> Scalar:
        """The variable of this name."""
        return self.part.fmu.variables[self.name]

    @property
    def place(self) -> tuple[str, str]:
        """Names of component and variable."""
        return self.part.name, self.name

    @property
    def is_array(self) -> bool:
        """Whether it stands for all elements of an array."""
        return self.name in self.part.fmu.arrays

    @property
    def exists(self) -> bool:
        """Whether it is a variable or an array; a point is none."""
        return self.is_array or self.name in self.part.fmu.variables

    def elements(self) -> list[Port]:
        """The scalars of an array; of a scalar, itself."""
        return [Port(self.part, name) for name in self.part.fmu.elements(self.name)]

    def beside(self, suffix: str) -> Port | None:
        """The port whose name has this suffix more, before the index if there is one; None if there is none.

        ``theta[3]`` with ``_dot`` is ``theta_dot[3]``.
        """
        base, index = _split(self.name)
        port = Port(self.part, f"{base}{suffix}{index}")
        return port if port.exists else None

    def without(self, suffix: str) -> Port | None:
        """The port whose name has this suffix less; None if there is none."""
        base, index = _split(self.name)
        port = Port(self.part, f"{base.removesuffix(suffix)}{index}")
        return port if base.endswith(suffix) and port.exists else None

    def triple(self) -> tuple[Port, Port, Port] | None:
        """Value, rate and acceleration, where all three exist and are real inputs or real outputs; else None."""
        return self._named(_triple(self.part.fmu, self.name))

    def curve(self) -> tuple[tuple[Port, Port, Port] | None, int]:
        """The port that this is a part of, and as which derivative of it; (None, 0) if of none."""
        names, order = _curve(self.part.fmu, self.name)
        return self._named(names), order

    def _named(self, names: Triple | None) -> tuple[Port, Port, Port] | None:
        return names and (Port(self.part, names[0]), Port(self.part, names[1]), Port(self.part, names[2]))

    def axes(self) -> dict[str, Port]:
        """The components of the point of this name that are ports."""
        ports = {axis: self.beside(f"_{axis}") for axis in "xyz"}
        return {axis: port for axis, port in ports.items() if port is not None and port.triple() is not None}

    def __str__(self) -> str:
        return f"{self.part.name}.{self.name}"


def time_limit(what: str, isolated: object) -> float:
    """How long a call of an isolated FMU may take [s]; 0 of one that is not isolated.

    :param what: that it is given as.
    :raises SimulationError: unless it is a truth value, or a number that is not negative.
    """
    seconds = TIME_LIMIT if isolated is True else float(isolated) if isinstance(isolated, Real) else math.nan
    if not 0 <= seconds < math.inf:
        raise SimulationError(f"{what} {shown(isolated)}: give True, or the seconds that a call may take")
    return seconds


def _split(name: str) -> tuple[str, str]:
    base, bracket, index = name.partition("[") if name.endswith("]") else (name, "", "")
    return base, f"{bracket}{index}"


@lru_cache(maxsize=4096)  # of one file there may be thousands of instances
def _triple(fmu: Fmu, name: str) -> Triple | None:
    base, index = _split(name)
    names = name, f"{base}_dot{index}", f"{base}_ddot{index}"
    if not all(other in fmu.variables for other in names):
        return None
    kinds = {(fmu.variables[other].type, fmu.variables[other].causality) for other in names}
    return names if kinds in ({("Real", "input")}, {("Real", "output")}) else None


@lru_cache(maxsize=4096)
def _curve(fmu: Fmu, name: str) -> tuple[Triple | None, int]:
    base, index = _split(name)
    for order, suffix in enumerate(("", "_dot", "_ddot")):
        triple = _triple(fmu, f"{base.removesuffix(suffix)}{index}") if base.endswith(suffix) else None
        if triple is not None:
            return triple, order
    return None, 0
