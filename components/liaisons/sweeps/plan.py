"""A sweep as it goes to the processes that do it: everything but the cases that are done already."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import final

from liaisons.cosim import System
from liaisons.cosim.connections import Connection
from liaisons.cosim.parts import Part
from liaisons.cosim.schedule import Coupling, Place
from liaisons.cosim.starts import start_values
from liaisons.errors import SimulationError, suggestion
from liaisons.sweeps.cases import Cases
from liaisons.sweeps.kept import Measure, identity


@final
@dataclass(frozen=True, eq=False)
class Plan:
    """Components, connections, settings and cases.

    :param recorded: name in a result -> variable.
    :param varied: name of what is varied -> variable.
    :param times: communication points [s].
    """

    title: str
    parts: Mapping[str, Part]
    connections: tuple[Connection, ...]
    recorded: Mapping[str, Place]
    varied: Mapping[str, Place]
    cases: Cases
    keep: Mapping[str, Measure]
    times: tuple[float, ...]
    tolerance: float | None
    coupling: Coupling | None

    def starts(self, case: int) -> dict[str, Part]:
        """The components with the start values of one case.

        :raises SimulationError: if a value does not fit.
        """
        given: dict[str, dict[str, object]] = {name: {} for name in self.parts}
        for name, value in self.cases.case(case).items():
            owner, variable = self.varied[name]
            given[owner][variable] = self._converted(owner, variable, value)
        return {
            name: replace(part, starts=start_values(name, part.fmu, {**part.starts, **given[name]}))
            for name, part in self.parts.items()
        }

    def unit(self, place: Place) -> str:
        """Unit of a variable; empty if it has none."""
        owner, variable = place
        return self.parts[owner].fmu.variables[variable].unit

    def files(self) -> dict[Path, bytes]:
        """The FMUs."""
        return {path: path.read_bytes() for path in {part.fmu.path for part in self.parts.values()}}

    def moved(self, paths: Mapping[Path, Path]) -> Plan:
        """The same with its FMUs elsewhere."""
        parts = {
            name: replace(part, fmu=replace(part.fmu, path=paths[part.fmu.path])) for name, part in self.parts.items()
        }
        return replace(self, parts=parts)

    def key(self) -> str:
        """Hash of all that the outcomes depend on: what the FMUs contain, their guids among it, and the settings."""
        digest = hashlib.sha256()

        def add(*parts: object) -> None:
            for part in parts:
                content = part if isinstance(part, bytes) else repr(part).encode()
                digest.update(f"{len(content)}:".encode() + content)

        contents = {path: hashlib.sha256(content).digest() for path, content in self.files().items()}
        for name, part in self.parts.items():
            add(name, contents[part.fmu.path], sorted(part.starts.items()))
        add(sorted((connection.source.place, connection.target.place) for connection in self.connections))
        add(self.times, self.tolerance, self.coupling, list(self.varied), sorted(self.recorded))
        for name, measure in self.keep.items():
            add(name, identity(measure))
        for column in self.cases.values():
            add(column.tobytes())
        return digest.hexdigest()

    def _converted(self, owner: str, variable: str, value: float) -> object:
        """A number as the type of its variable; what does not fit is left to the one who checks start values."""
        known = self.parts[owner].fmu.variables.get(variable)
        kind = "Real" if known is None else known.type
        if kind in {"Integer", "Enumeration"} and value.is_integer():
            return int(value)
        return bool(value) if kind == "Boolean" and value in {0.0, 1.0} else value


def places(system: System | None, parts: Mapping[str, Part], names: Sequence[str]) -> dict[str, Place]:
    """The variables that names stand for: plain ones of a single FMU, ``component.variable`` of a system.

    :raises SimulationError: with the nearest name, if there is no such variable.
    """
    found: dict[str, Place] = {}
    for name in names:
        if system is None:
            owner, variable = next(iter(parts)), name
        else:
            owner, _, variable = name.partition(".")
            if owner not in parts:
                raise SimulationError(f"{system.name} has no component {owner!r}{suggestion(owner, parts)}")
        fmu = parts[owner].fmu
        if variable not in fmu.variables:
            raise SimulationError(f"{owner}: {fmu.unknown(variable)}")
        found[name] = (owner, variable)
    return found
