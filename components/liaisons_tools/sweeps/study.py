"""The description of a sweep, which its processes receive, and outcomes of its cases, which they send."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias, final

from liaisons.base.arrays import Floats
from liaisons.cosim import Simulation, SystemDocument, VariableReference
from liaisons.errors import LiaisonsError, RefusedError
from liaisons_tools.sweeps.measures import Measures, measure_identity


@final
@dataclass(frozen=True, eq=False)
class Study:
    """A simulation and its cases.

    :param varied: column of the cases -> variable.
    :param cases: columns of values, of one length.
    :param keep: column of the result -> measure.
    """

    simulation: Simulation
    varied: Mapping[str, VariableReference]
    cases: Mapping[str, Floats]
    keep: Measures

    @property
    def count(self) -> int:
        """Number of cases."""
        return len(next(iter(self.cases.values())))

    def case_document(self, case: int) -> SystemDocument:
        """The system with the start values of one case.

        :raises SimulationError: if a value does not fit.
        """
        columns = self.cases.items()
        starts = {name: self._typed_value(*self.varied[name], float(column[case])) for name, column in columns}
        return self.simulation.document.with_start_values(starts)

    def files(self) -> dict[Path, bytes]:
        """Contents of the FMU files, by path."""
        fmus = [part.fmu for part in self.simulation.parts.values()]
        for fmu in fmus:
            fmu.require_file("a sweep with a journal, or on a cluster,")
        return {path: path.read_bytes() for path in {fmu.path for fmu in fmus}}

    def with_fmu_paths(self, paths: Mapping[Path, Path]) -> Study:
        """Copy of the study whose FMUs are files at other paths: old path -> new path."""
        parts = {
            name: replace(part, fmu=replace(part.fmu, path=paths[part.fmu.path]))
            for name, part in self.simulation.parts.items()
        }
        return replace(self, simulation=self.simulation.with_parts(parts))

    def journal_key(self) -> str:
        """Hash that identifies the study in a journal: of its FMUs, settings, cases and measures."""
        digest = hashlib.sha256()

        def add(*parts: object) -> None:
            """Add parts to the hash, each with its length."""
            for part in parts:
                content = part if isinstance(part, bytes) else repr(part).encode()
                digest.update(f"{len(content)}:".encode() + content)

        contents = {path: hashlib.sha256(content).digest() for path, content in self.files().items()}
        for name, part in self.simulation.parts.items():
            add(name, contents[part.fmu.path], sorted(part.starts.items()))
        run = self.simulation
        add(sorted((c.source.reference, c.target.reference, *c.conversion) for c in run.connections))
        add(tuple(run.times), run.tolerance, run.coupling, list(self.varied), sorted(run.recorded))
        for name, measure in self.keep.items():
            add(name, measure_identity(measure))
        for column in self.cases.values():
            add(column.tobytes())
        return digest.hexdigest()

    def _typed_value(self, owner: str, variable: str, value: float) -> object:
        """Number in the type of its variable; unchanged where it does not fit, which is refused later."""
        kind = self.simulation.parts[owner].fmu.variables[variable].type
        if kind in {"Integer", "Enumeration"} and value.is_integer():
            return int(value)
        return bool(value) if kind == "Boolean" and value in {0.0, 1.0} else value


@final
@dataclass(frozen=True, slots=True)
class Failure:
    """Why a case has no measures.

    :param reason: one line.
    :param refused: whether the model refused it, and would again; else the machine or a function of the user failed.
    """

    reason: str
    refused: bool


@final
@dataclass(frozen=True, slots=True)
class Completed:
    """Measures of a case, in the order of :attr:`Study.keep`, and its warnings."""

    values: tuple[float, ...]
    warnings: tuple[str, ...] = ()


Outcome: TypeAlias = Completed | Failure
"""Measures of a case, or why it failed."""
Outcomes: TypeAlias = dict[int, Outcome]
"""Outcomes by the numbers of their cases."""


def failure_of(error: Exception) -> Failure:
    """Failure of a case from its error; ``refused`` after Discard, Error or no convergence of its FMUs.

    Fatal is no refusal: the FMU may have run out of memory.
    """
    words = str(error) if isinstance(error, LiaisonsError) else f"{type(error).__name__}: {error}"
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, RefusedError):
        cause = cause.__cause__
    return Failure(" ".join(words.split()), refused=cause is not None)
