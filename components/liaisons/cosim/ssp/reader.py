"""An archive as a system: flat or nested, of any make, with parameter sets inline and beside, mappings, units."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, final
from urllib.parse import unquote
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from zipfile import BadZipFile, ZipFile

from liaisons.cosim.component import Component, End
from liaisons.cosim.description import Fmu
from liaisons.cosim.description import read as read_fmu
from liaisons.cosim.messages import logger
from liaisons.cosim.ports import Link, links
from liaisons.cosim.ssp.assignment import Parameter, fitted, mapped, parameters
from liaisons.cosim.ssp.experiment import Experiment, read_experiment
from liaisons.cosim.ssp.structure import Node, Structure, read_structure
from liaisons.cosim.ssp.structure import Path as Place
from liaisons.cosim.ssp.xml import STRUCTURE, path, tag
from liaisons.errors import ConnectionError, LiaisonsError, SimulationError, suggestion  # noqa: A004 - the field's word for it

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
    :raises ConnectionError: if a connection does not fit.
    """
    file = Path(file)
    if not file.is_file():
        raise SimulationError(f"{file}: {'is a directory' if file.is_dir() else 'no such file'}; check the path")
    directory = Path(tempfile.mkdtemp(prefix="liaisons-"))
    try:
        with ZipFile(file) as archive:
            made = _read(_Files(file, archive), directory, system, starts or {})
    except BaseException as error:
        shutil.rmtree(directory, ignore_errors=True)
        if isinstance(error, BadZipFile):
            raise SimulationError(f"{file}: truncated or damaged ({error}); copy it again") from None
        if isinstance(error, LiaisonsError) and str(file) not in str(error):
            raise type(error)(f"{file}: {error}") from error
        raise
    weakref.finalize(made.system, shutil.rmtree, directory, ignore_errors=True)
    return made


@final
@dataclass(frozen=True, slots=True)
class _Files:
    """The files of an archive."""

    path: Path
    archive: ZipFile

    def member(self, source: str, owner: str) -> bytes:
        """A file by its relative URI.

        :param owner: what names it, for messages.
        """
        if ":" in source or source.startswith("/") or ".." in PurePosixPath(source).parts:
            raise SimulationError(f"{owner} lies at {source!r}, outside the archive; put it inside")
        name = str(PurePosixPath(unquote(source)))
        if name not in self.archive.namelist():
            raise SimulationError(f"{owner} is to be in {name!r}, but the archive lacks that file")
        return self.archive.read(name)

    def xml(self, source: str, owner: str, root: str) -> Element:
        """An XML file with this root."""
        try:
            element = ElementTree.fromstring(self.member(source, owner))
        except ElementTree.ParseError as error:
            raise SimulationError(f"{source} cannot be read: {error}") from None
        if element.tag != tag(root):
            raise SimulationError(f"{source} has the root {element.tag!r}, expected {root}")
        return element


def _read(files: _Files, directory: Path, make: Callable[[str], System], further: Mapping[str, object]) -> Archive:
    if STRUCTURE not in files.archive.namelist():  # half an archive can end in a whole one, that of an FMU inside
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
    paths: dict[str, Path] = {}
    for place, source in structure.sources.items():
        if source not in paths:
            content = files.member(source, f"the FMU of component {'.'.join(place)}")
            paths[source] = directory / str(len(paths)) / PurePosixPath(unquote(source)).name
            paths[source].parent.mkdir()
            paths[source].write_bytes(content)
    return {place: read_fmu(paths[source]) for place, source in structure.sources.items()}


def _starts(files: _Files, structure: Structure, fmus: dict[Place, Fmu]) -> dict[Place, dict[str, Any]]:
    starts: dict[Place, dict[str, Any]] = {place: {} for place in fmus}
    for element, binding in structure.bindings:
        for parameter in _bound(files, element, binding):
            meant = structure.meant(element, parameter.name)
            if not meant:
                logger.warning("%s: parameter %s fits nothing and is ignored", files.path, parameter.name)
            for place, variable in meant:
                fmu = fmus[place]
                if variable in fmu.arrays or variable in fmu.variables:
                    starts[place].pop(variable, None)  # what is named later counts
                    starts[place][variable] = fitted(_name(place), fmu, variable, parameter)
                else:
                    logger.warning("%s: %s; the parameter is ignored", files.path, fmu.unknown(variable))
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
    return mapped(parameters(values), entries, prefix=binding.get("prefix", ""))


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
        raise ConnectionError(
            f"{start} has {len(sources)} elements, {end} has {len(targets)}: they cannot be connected as a whole"
        )
    return zip(sources, targets, strict=True)
