"""An archive as a system: flat or nested, of any make, with parameter sets inline and beside, mappings, units."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, final
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from liaisons.cosim.archive import Archive as Zip
from liaisons.cosim.archive import too_big, unpacked_limit
from liaisons.cosim.component import Component, End
from liaisons.cosim.description import Fmu
from liaisons.cosim.description import read as read_fmu
from liaisons.cosim.documents import tree
from liaisons.cosim.messages import logger
from liaisons.cosim.ports import Link, links
from liaisons.cosim.ssp.assignment import Parameter, fitted, mapped, parameters
from liaisons.cosim.ssp.experiment import Experiment, read_experiment
from liaisons.cosim.ssp.structure import Node, Structure, read_structure
from liaisons.cosim.ssp.structure import Path as Place
from liaisons.cosim.ssp.xml import STRUCTURE, path, tag
from liaisons.errors import ConnectError, LiaisonsError, SimulationError, suggestion
from liaisons.folders import passing_folder

if TYPE_CHECKING:
    from liaisons.cosim.system import System

_VERSIONS = ("1.0", "2.0")


@final
@dataclass(frozen=True, slots=True)
class Archive:
    """A system and its default experiment."""

    system: System
    experiment: Experiment


def read(file: Path | str, system: Callable[[str], System], starts: Mapping[str, object] | None = None) -> Archive:
    """Read an archive; its FMUs are unpacked into a directory that lives as long as the system.

    :param system: makes a system of a name.
    :param starts: start values that count more than those of the archive, by ``"component.variable"``.
    :raises SimulationError: if the archive is missing, damaged, of another version, lacks a file, or has something
        that cannot be simulated here; one line that names it.
    :raises ConnectError: if a connection does not fit.
    """
    file = Path(file)
    with ExitStack() as stack:
        directory = stack.enter_context(passing_folder())
        try:
            with Zip(file) as archive:
                made = _read(_Files(archive), directory, system, starts or {})
        except LiaisonsError as error:
            if str(file) not in str(error):
                raise type(error)(f"{file}: {error}") from error
            raise
        weakref.finalize(made.system, stack.pop_all().close)
    return made


@final
@dataclass(frozen=True, slots=True)
class _Files:
    """The files of an archive, by their relative URIs."""

    archive: Zip

    def name(self, source: str, owner: str) -> str:
        """The file that a URI names.

        :param owner: what names it, for messages.
        """
        if ":" in source or source.startswith("/") or ".." in PurePosixPath(unquote(source)).parts:
            raise SimulationError(f"{owner} lies at {source!r}, outside the archive; put it inside")
        name = str(PurePosixPath(unquote(source)))
        if name not in self.archive.names:
            raise SimulationError(f"{owner} is to be in {name!r}, but the archive lacks that file")
        return name

    def xml(self, source: str, owner: str, root: str) -> Element:
        """An XML file with this root."""
        with self.archive.open(self.name(source, owner)) as file:
            try:
                element = tree(file)
            except ValueError as error:
                raise SimulationError(f"{source} cannot be read: {error}") from None
        if element.tag != tag(root):
            raise SimulationError(f"{source} has the root {element.tag!r}, expected {root}")
        return element


def _read(files: _Files, directory: Path, make: Callable[[str], System], further: Mapping[str, object]) -> Archive:
    if STRUCTURE not in files.archive.names:  # half an archive can end in a whole one, that of an FMU inside
        raise SimulationError(f"has no {STRUCTURE} inside, so it is no SSP archive, or a truncated one; copy it again")
    root = files.xml(STRUCTURE, "the system structure", "ssd:SystemStructureDescription")
    if root.get("version") not in _VERSIONS:
        raise SimulationError(f"SSP version {root.get('version')!r} is not known; known: {', '.join(_VERSIONS)}")
    try:
        structure, experiment = read_structure(root), read_experiment(root)
    except ValueError as error:
        raise SimulationError(f"{STRUCTURE} has a number that is none: {error}") from None
    fmus = _unpacked(files, structure, directory)
    starts = _starts(files, structure, fmus)
    owners = {_name(place): place for place in fmus}
    for name, value in further.items():
        owner, _, variable = name.partition(".")
        if owner not in owners:
            raise SimulationError(
                f"{name} = {value!r}: the system has no component {owner!r}{suggestion(owner, owners)}"
            )
        starts[owners[owner]].pop(variable, None)
        starts[owners[owner]][variable] = value
    system = make(structure.name)
    components = {place: system.add(_name(place), fmu.path, **starts[place]) for place, fmu in fmus.items()}
    system.join(_links(structure, components))
    return Archive(system, experiment)


def _name(place: Place) -> str:
    return "_".join(place).replace(".", "_")  # names of components have no dots here


def _unpacked(files: _Files, structure: Structure, directory: Path) -> dict[Place, Fmu]:
    fmus: dict[str, Fmu] = {}
    size = files.archive.size
    for place, source in structure.sources.items():
        if source not in fmus:
            name = files.name(source, f"the FMU of component {'.'.join(place)}")
            path = directory / str(len(fmus)) / PurePosixPath(name).name
            files.archive.copy(name, path)
            try:
                fmus[source] = read_fmu(path)
            except SimulationError as error:  # it names a file that nobody has seen
                raise SimulationError(str(error).replace(str(path), name)) from error
            size += fmus[source].unpacked
            if size > unpacked_limit():
                raise too_big(f"{files.archive.path} with its FMUs", size)
    return {place: fmus[source] for place, source in structure.sources.items()}


def _starts(files: _Files, structure: Structure, fmus: dict[Place, Fmu]) -> dict[Place, dict[str, Any]]:
    starts: dict[Place, dict[str, Any]] = {place: {} for place in fmus}
    for element, binding in structure.bindings:
        for parameter in _bound(files, element, binding):
            meant = structure.meant(element, parameter.name)
            if not meant:
                logger.warning("%s: parameter %s fits nothing and is ignored", files.archive.path, parameter.name)
            for place, variable in meant:
                fmu = fmus[place]
                if variable in fmu.arrays or variable in fmu.variables:
                    starts[place].pop(variable, None)  # what is named later counts
                    starts[place][variable] = fitted(_name(place), fmu, variable, parameter)
                else:
                    logger.warning("%s: %s; the parameter is ignored", files.archive.path, fmu.unknown(variable))
    return starts


def _bound(files: _Files, element: Place, binding: Element) -> Iterable[Parameter]:
    owner = f"the parameter set of {'.'.join(element) or 'the system'}"
    source = binding.get("source")
    if source is not None:
        values = files.xml(source, owner, "ssv:ParameterSet")
    else:
        inline = binding.find(path("ssd:ParameterValues", "ssv:ParameterSet"))
        if inline is None:
            raise SimulationError(f"{owner} has neither a source nor values")
        values = inline
    entries: list[Element] = []
    for mapping in binding.iterfind(tag("ssd:ParameterMapping")):
        source = mapping.get("source")
        inner = mapping.find(tag("ssm:ParameterMapping"))
        if source is not None:
            inner = files.xml(source, f"the mapping of {owner}", "ssm:ParameterMapping")
        entries += [] if inner is None else inner.findall(tag("ssm:MappingEntry"))
    try:
        return list(mapped(parameters(values), entries, prefix=binding.get("prefix", "")))
    except (ValueError, OverflowError) as error:
        raise SimulationError(f"{owner} cannot be read: {error}") from None


def _links(structure: Structure, components: dict[Place, Component]) -> list[Link]:
    """The scalar connections; one that takes a force back through a port is marked so, as by ``System.connect``."""
    pairs = [
        pair
        for start, end in structure.links()
        for pair in _matched(start, _ends(start, components), end, _ends(end, components))
    ]
    possible = [link for pair in pairs for link in links(*pair)]
    found = {(link.source.place, link.target.place): link for link in sorted(possible, key=lambda link: link.back)}
    return [found[source.place, target.place] for source, target in pairs]


def _ends(node: Node, components: dict[Place, Component]) -> list[End]:
    """The scalars that a connector or an element of it stands for."""
    name = f"{node.connector}[{','.join(map(str, node.indices))}]" if node.indices else node.connector
    return components[node.element][name].elements()


def _matched(start: Node, sources: list[End], end: Node, targets: list[End]) -> Iterable[tuple[End, End]]:
    if len(sources) != len(targets):
        raise ConnectError(
            f"{start} has {len(sources)} elements, {end} has {len(targets)}: they cannot be connected as a whole"
        )
    return zip(sources, targets, strict=True)
