"""An FMU in a system, and its ends: the things that are connected."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

from liaisons.cosim.description import Fmu, Variable, read, start_value
from liaisons.errors import ConnectionError  # noqa: A004 - the field's word for it

INPUT_RECONSTRUCTION = "input_reconstruction"
"""Parameter by which an FMU of ours says what its inputs do within a step: 0 hold, 1 extrapolate, 2 interpolate."""


@final
@dataclass(frozen=True, eq=False)
class Component:
    """One FMU in a system, under a name of its own; ``component["length"]`` is one of its ends.

    :param name: name in the system.
    :param fmu: what was read from the file.
    :param starts: start values that differ from those of the FMU.
    """

    name: str
    fmu: Fmu
    starts: Mapping[str, float | int | bool | str]

    def __getitem__(self, name: str) -> End:
        """A variable, the port of that name, or a named point (``"bob"`` for ``bob_x`` and ``bob_z``).

        :raises ConnectionError: with the nearest name, if there is nothing of that name.
        """
        end = End(self, name)
        if name not in self.fmu.variables and not end.axes():
            raise ConnectionError(f"{self.name}: {self.fmu.unknown(name)}")
        return end

    @property
    def interpolates(self) -> bool:
        """Whether it takes the inputs that are set before a step for those at its end."""
        return self._reconstruction == 2

    @property
    def takes_newest(self) -> bool:
        """Whether it is to be given the newest inputs before a step: it interpolates, or it is of another make."""
        return self._reconstruction in {None, 2}

    @property
    def _reconstruction(self) -> int | None:
        variable = self.fmu.variables.get(INPUT_RECONSTRUCTION)
        if variable is None or variable.type != "Integer":
            return None
        return int(self.starts.get(INPUT_RECONSTRUCTION, variable.start or 1))

    def __repr__(self) -> str:
        starts = "".join(f", {name}={value!r}" for name, value in self.starts.items())
        return f"<{self.name}: {self.fmu.path.name}{starts}>"


def component(name: str, path: Path | str, starts: Mapping[str, object]) -> Component:
    """Read an FMU and check the start values for it.

    :raises SimulationError: if the file cannot be used here, or a start value does not fit.
    """
    fmu = read(path)
    return Component(name, fmu, {variable: start_value(name, fmu, variable, v) for variable, v in starts.items()})


@final
@dataclass(frozen=True)
class End:
    """A variable, port or point of one component, to be connected with another."""

    component: Component
    name: str

    @property
    def variable(self) -> Variable:
        """The variable of this name."""
        return self.component.fmu.variables[self.name]

    @property
    def place(self) -> tuple[str, str]:
        """Names of component and variable."""
        return self.component.name, self.name

    def beside(self, suffix: str) -> End | None:
        """The end whose name has this suffix more, before the index if there is one; None if there is none.

        ``theta[3]`` with ``_dot`` is ``theta_dot[3]``.
        """
        base, bracket, index = self.name.rpartition("[") if self.name.endswith("]") else (self.name, "", "")
        name = f"{base}{suffix}{bracket}{index}"
        return End(self.component, name) if name in self.component.fmu.variables else None

    def port(self) -> tuple[End, End, End] | None:
        """Value, rate and acceleration, where all three exist and are real inputs or real outputs; else None."""
        rate, acceleration = self.beside("_dot"), self.beside("_ddot")
        if self.name not in self.component.fmu.variables or rate is None or acceleration is None:
            return None
        triple = (self, rate, acceleration)
        kinds = {(end.variable.type, end.variable.causality) for end in triple}
        return triple if kinds in ({("Real", "input")}, {("Real", "output")}) else None

    def axes(self) -> dict[str, End]:
        """The components of the point of this name that are ports."""
        ends = {axis: self.beside(f"_{axis}") for axis in "xyz"}
        return {axis: end for axis, end in ends.items() if end is not None and end.port() is not None}

    def __str__(self) -> str:
        return f"{self.component.name}.{self.name}"
