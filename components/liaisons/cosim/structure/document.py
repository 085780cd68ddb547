"""A system as data: components, connections and experiment; runs, archives, live pages, sweeps and diagrams read it.

Rooms above register what systems ask them for: FMUs of components by their names, archives, one FMU of a system.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias, final

from liaisons.base.arguments import as_path, name_dictionary
from liaisons.base.files import replacement_path
from liaisons.cosim.structure.checks import ConnectionGraph
from liaisons.cosim.structure.components import Components, SystemComponent
from liaisons.cosim.structure.connections import Connection, feeds_of
from liaisons.cosim.structure.scenes import FmuScene
from liaisons.cosim.structure.schedule import VariableReference, strong_components
from liaisons.errors import SimulationError, suggestion
from liaisons.fmu_files import DefaultExperiment, checked_starts

FmuTarget: TypeAlias = "Path | str | type[Any]"
"""Path of an FMU; or a component by its name, file or class, where :mod:`liaisons.interface` is imported, as by all
public functions."""


@final
@dataclass(frozen=True)
class Services:
    """Functions of rooms above.

    :param fmu_file: a component by its name, file or class, or the path of an FMU -> path of the FMU.
    :param read_ssp: path of an archive, start values -> :class:`SystemDocument`.
    :param write_ssp: what :meth:`liaisons.System.write_ssp` calls.
    :param flatten: what :meth:`liaisons.System.flatten` calls.
    """

    fmu_file: Callable[[Any], Path]
    read_ssp: Callable[..., Any]
    write_ssp: Callable[..., None]
    flatten: Callable[..., Path]


_registered: list[Services] = []


def register(services: Services) -> None:
    """Let systems use the functions of rooms above."""
    _registered[:] = [services]


def services() -> Services:
    """Functions of rooms above.

    :raises SimulationError: if none are registered, in a program that imports :mod:`liaisons.cosim` alone.
    """
    if not _registered:
        raise SimulationError("liaisons.cosim alone runs FMUs; take System from liaisons")
    return _registered[0]


def fmu_file(label: str, target: FmuTarget) -> Path:
    """Path of an FMU that is given by its path or, where names are known, by a component.

    :param label: of the argument, for messages.
    :raises SimulationError: for what is not a path; of names what :func:`liaisons.library.fmu_file` raises.
    """
    return _registered[0].fmu_file(target) if _registered else as_path(label, target)  # type: ignore[arg-type]


@final
@dataclass(frozen=True, slots=True)
class Diagram:
    """A diagram as an SVG element, which notebooks show."""

    svg: str

    def write(self, path: Path | str) -> None:
        """Write the SVG element to a file."""
        with replacement_path(Path(path)) as whole:
            whole.write_text(self.svg, encoding="utf-8")

    def _repr_svg_(self) -> str:
        return self.svg


@final
@dataclass(frozen=True, eq=False)
class SystemDocument:
    """A system as data, which can be pickled; ``system.document`` is one.

    :param name: used in messages, results and figures.
    :param parts: components by name, in the order of addition.
    :param connections: scalar connections, in the order of addition.
    :param experiment: start, stop and step size, where a run is given none.
    :param single: whether variables of the first FMU have no prefix; the others are its operators.
    :param files: keeps temporary files of an archive, which are removed with it.
    """

    name: str
    parts: Components
    connections: Sequence[Connection] = ()
    experiment: DefaultExperiment = field(default_factory=DefaultExperiment)
    single: bool = False
    files: object = None

    @classmethod
    def of_fmu(
        cls, fmu: FmuTarget, starts: Mapping[str, object] | None = None, *, isolated: bool | float = False
    ) -> SystemDocument:
        """System of one FMU, under the name of its file.

        :raises SimulationError: if the file cannot be used here, or a start value does not fit.
        """
        path = fmu_file("fmu", fmu)
        part = SystemComponent.read(path.stem, path, starts or {}, isolated=isolated)
        return cls(part.name, {part.name: part}).as_single()

    def as_single(self) -> SystemDocument:
        """The system as its first FMU, which gives it its name and stop time; the others are its operators."""
        first = next(iter(self.parts.values()))
        experiment = DefaultExperiment(stop_time=first.fmu.experiment.stop_time)
        return replace(self, name=first.name, experiment=experiment, single=True)

    @cached_property
    def graph(self) -> ConnectionGraph:
        """Graph of the connections: what feeds what, in which order, with which cycles."""
        return ConnectionGraph(self.parts, self.connections, ())

    @property
    def order(self) -> list[str]:
        """Names of the components, sources before their targets, without reaction forces."""
        feeds = feeds_of(c for c in self.connections if not c.is_reaction)
        return [name for group in strong_components(self.parts, feeds) for name in group]

    @property
    def common_experiment(self) -> DefaultExperiment:
        """Default experiment of the FMUs: start of all, or 0 if they differ; latest stop; shortest step size."""
        experiments = [part.fmu.experiment for part in self.parts.values()]
        starts = {experiment.start_time or 0.0 for experiment in experiments}
        stops = [stop for experiment in experiments if (stop := experiment.stop_time) is not None]
        steps = [step for experiment in experiments if (step := experiment.step_size) is not None]
        start = starts.pop() if len(starts) == 1 else 0.0
        return DefaultExperiment(start, max(stops, default=None), min(steps, default=None))

    @property
    def scene(self) -> FmuScene:
        """Picture of the system."""
        return FmuScene(self.parts, self.connections, single=self.single)

    def filled(self) -> SystemDocument:
        """The document itself.

        :raises SimulationError: if it has no components.
        """
        if not self.parts:
            raise SimulationError(f"{self.name} is empty; add() an FMU first")
        return self

    def reference(self, label: str, name: str) -> VariableReference:
        """Component and variable for a name: ``"variable"`` of a single FMU, ``"component.variable"`` of a system.

        :param label: kind of the name, for messages.
        :raises SimulationError: if there is no such component; the variable is not checked.
        """
        if self.single:
            return next(iter(self.parts)), name
        owner, _, variable = name.partition(".")
        if owner not in self.parts:
            raise SimulationError(
                f"{label} {name!r}: {self.name} has no component {owner!r}{suggestion(owner, self.parts)}"
            )
        return owner, variable

    def with_start_values(self, start_values: Mapping[str, object]) -> SystemDocument:
        """Copy with some other start values.

        :param start_values: new start values by name.
        :raises SimulationError: for an unknown name, or a value that it cannot have.
        """
        own: dict[str, dict[str, object]] = {name: dict(part.starts) for name, part in self.parts.items()}
        for name, value in name_dictionary(f"{self.name}: start_values", start_values).items():
            owner, variable = self.reference("start value", name)
            own[owner][variable] = value
        parts = {n: replace(part, starts=checked_starts(n, part.fmu, own[n])) for n, part in self.parts.items()}
        return replace(self, parts=parts)
