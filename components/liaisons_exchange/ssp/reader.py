"""SSP archives as systems: flat or nested, of any tool, with inline and external parameter sets, mappings, units.

``pyssp_standard`` reads neither indices and transformations of connections nor signal dictionaries.
"""

from __future__ import annotations

import io
import weakref
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, final
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from liaisons.base.archive import Archive, size_error, unpacked_limit
from liaisons.base.arguments import as_path
from liaisons.base.folders import temporary_folder
from liaisons.base.logs import logger
from liaisons.base.unit_definitions import SAME, UnitDefinition
from liaisons.base.xml_documents import read_tree
from liaisons.cosim import Connection, Port, System, SystemComponent, SystemDocument
from liaisons.errors import ConnectError, LiaisonsError, SimulationError, suggestion
from liaisons_exchange.ssp.assignment import Quantity, mapped_parameters, parameter_quantities, value_for_variable
from liaisons_exchange.ssp.experiment import read_experiment
from liaisons_exchange.ssp.structure import Connector, ElementPath, Pin, Structure, read_structure
from liaisons_exchange.ssp.xml import STRUCTURE, child_path, tag, with_declared_prefixes

_VERSIONS = ("1.0", "2.0")
_PARTS = ("ssv:ParameterSet", "ssm:ParameterMapping", "ssb:SignalDictionary")


@final
class _Folder:
    """Owner of a folder: the folder is removed with it."""


def read(file: Path | str, make: type[System] = System, starts: Mapping[str, object] | None = None) -> System:
    """System in an archive; see :func:`read_document`.

    :param make: :class:`liaisons.System`.
    :param starts: start values that override those of the archive, by ``"component.variable"``.
    """
    return make.from_document(read_document(file, starts))


def read_document(file: Path | str, starts: Mapping[str, object] | None = None) -> SystemDocument:
    """System in an archive, whose FMUs are unpacked into a folder that lives as long as the document, or a copy.

    :param starts: start values that override those of the archive, by ``"component.variable"``.
    :returns: the system as data, with the default experiment of the archive.
    :raises SimulationError: if the archive is missing, damaged, of another version, lacks a file, or has elements
        that cannot be simulated here.
    :raises ConnectError: if a connection does not fit.
    """
    file = as_path("archive", file)
    with ExitStack() as stack:
        directory = stack.enter_context(temporary_folder())
        try:
            with Archive(file) as archive:
                document = _read_system(archive, directory, starts or {})
        except LiaisonsError as error:
            if str(file) not in str(error):
                raise type(error)(f"{file}: {error}") from error
            raise
        folder = _Folder()
        weakref.finalize(folder, stack.pop_all().close)
    return replace(document, files=folder)


def _member_name(archive: Archive, source: str, owner: str) -> str:
    """Name of the file in the archive at a relative URI; a SimulationError if there is none.

    :param owner: of the file, for messages.
    """
    if ":" in source or source.startswith("/") or ".." in PurePosixPath(unquote(source)).parts:
        raise SimulationError(f"{owner} lies at {source!r}, outside the archive; put it inside")
    name = str(PurePosixPath(unquote(source)))
    if name not in archive.names:
        raise SimulationError(f"{owner} is to be in {name!r}, but the archive lacks that file")
    return name


def _xml_root(archive: Archive, source: str, owner: str, root: str) -> Element:
    """Root element of an XML file in the archive; a SimulationError unless its name is ``root``."""
    name = _member_name(archive, source, owner)
    try:
        with archive.open(name) as file:
            try:
                element = read_tree(file)
            except ValueError as error:
                if "unbound prefix" not in str(error):
                    raise
                with archive.open(name) as again:
                    text, prefixes = with_declared_prefixes(again.read())
                element = read_tree(io.BytesIO(text))
                words = f"{archive.path}: {source} does not declare the prefix {', '.join(prefixes)}"
                logger.warning("%s; taken for what it stands for in SSP, elsewhere for nothing", words)
    except ValueError as error:
        raise SimulationError(f"{source} cannot be read: {error}") from None
    if element.tag != tag(root):
        raise SimulationError(f"{source} has the root {element.tag!r}, expected {root}")
    for part in (part for kind in _PARTS for part in element.iter(tag(kind))):
        if (version := part.get("version", _VERSIONS[0])) not in _VERSIONS:
            words = "the version %r of %s is not known; read as %s"
            logger.warning(f"%s: {words}", archive.path, version, source, _VERSIONS[-1])
    return element


def _read_system(archive: Archive, directory: Path, further: Mapping[str, object]) -> SystemDocument:
    """System in an opened archive, whose FMUs are unpacked into a directory.

    :param further: start values that override those of the archive.
    """
    if STRUCTURE not in archive.names:  # a truncated archive can end in the whole archive of an FMU
        raise SimulationError(f"has no {STRUCTURE} inside, so it is no SSP archive, or a truncated one; copy it again")
    root = _xml_root(archive, STRUCTURE, "the system structure", "ssd:SystemStructureDescription")
    if root.get("version") not in _VERSIONS:
        raise SimulationError(f"SSP version {root.get('version')!r} is not known; known: {', '.join(_VERSIONS)}")
    try:
        structure, experiment = read_structure(root, partial(_dictionary_root, archive)), read_experiment(root)
    except ValueError as error:
        raise SimulationError(f"{STRUCTURE} has a number that is none: {error}") from None
    files = _unpack(archive, structure, directory)
    units = _connector_units(structure, files)
    starts = _start_values(archive, structure, files)
    owners = {_component_name(component): component for component in files}
    for name, value in further.items():
        owner, _, variable = name.partition(".")
        if owner not in owners:
            raise SimulationError(
                f"{name} = {value!r}: the system has no component {owner!r}{suggestion(owner, owners)}"
            )
        starts[owners[owner]].pop(variable, None)
        starts[owners[owner]][variable] = value
    system = System(structure.name)
    parts = {
        component: system.add(_component_name(component), file.fmu.path, start_values=starts[component])
        for component, file in files.items()
    }
    system.join(_connections(structure, parts, units))
    return replace(system.document, experiment=experiment)


def _component_name(element: ElementPath) -> str:
    """Name of a component from those of nested elements, joined by underscores."""
    return "_".join(element).replace(".", "_")  # names of components have no dots


def _unpack(archive: Archive, structure: Structure, directory: Path) -> dict[ElementPath, SystemComponent]:
    """Unpack the FMUs into a directory, and return the components, without start values."""
    fmus: dict[str, SystemComponent] = {}
    size = archive.size
    for component, source in structure.sources.items():
        if source not in fmus:
            name = _member_name(archive, source, f"the FMU of component {'.'.join(component)}")
            path = directory / str(len(fmus)) / PurePosixPath(name).name
            archive.copy(name, path)
            try:
                fmus[source] = SystemComponent.read(name, path, {})
            except SimulationError as error:  # it names a temporary file
                raise SimulationError(str(error).replace(str(path), name)) from error
            size += fmus[source].fmu.unpacked
            if size > unpacked_limit():
                raise size_error(f"{archive.path} with its FMUs", size)
    return {c: replace(fmus[source], name=_component_name(c)) for c, source in structure.sources.items()}


def _start_values(
    archive: Archive, structure: Structure, files: Mapping[ElementPath, SystemComponent]
) -> dict[ElementPath, dict[str, Any]]:
    """Start values of each component by variable, from all parameter bindings."""
    starts: dict[ElementPath, dict[str, Any]] = {component: {} for component in files}
    for element, binding in structure.bindings:
        for name, quantity in _bound_parameters(archive, element, binding):
            targets = structure.parameter_targets(element, name)
            if not targets:
                logger.warning("%s: parameter %s fits nothing and is ignored", archive.path, name)
            for component, variable in targets:
                fmu = files[component].fmu
                if variable in fmu.arrays or variable in fmu.variables:
                    starts[component].pop(variable, None)  # later values override
                    starts[component][variable] = value_for_variable(files[component], variable, quantity)
                else:
                    logger.warning(
                        "%s: %s; the parameter is ignored", archive.path, fmu.unknown_variable_message(variable)
                    )
    return starts


def _bound_parameters(archive: Archive, element: ElementPath, binding: Element) -> Iterable[tuple[str, Quantity]]:
    """Names, values and units of the parameters that a binding assigns to an element."""
    owner = f"the parameter set of {'.'.join(element) or 'the system'}"
    source, values = _source(binding, owner), binding.find(child_path("ssd:ParameterValues", "ssv:ParameterSet"))
    if source is not None:
        values = _xml_root(archive, source, owner, "ssv:ParameterSet")
    if values is None:
        raise SimulationError(f"{owner} has neither a source nor values")
    entries: list[Element] = []
    for mapping in binding.iterfind(tag("ssd:ParameterMapping")):
        source = _source(mapping, f"the mapping of {owner}")
        inner = mapping.find(tag("ssm:ParameterMapping"))
        if source is not None:
            inner = _xml_root(archive, source, f"the mapping of {owner}", "ssm:ParameterMapping")
        entries += [] if inner is None else inner.findall(tag("ssm:MappingEntry"))
    try:
        return list(mapped_parameters(parameter_quantities(values), entries, prefix=binding.get("prefix", "")))
    except (ValueError, OverflowError) as error:
        raise SimulationError(f"{owner} cannot be read: {error}") from None


def _source(element: Element, owner: str) -> str | None:
    """Source of a file in the archive; a SimulationError if it is to lie in an FMU."""
    source = element.get("source")
    if source is not None and (base := element.get("sourceBase", "SSD")) != "SSD":
        raise SimulationError(f"{owner} has sourceBase = {base!r}; put its file beside {STRUCTURE}, which is 'SSD'")
    return source


def _dictionary_root(archive: Archive, source: str, owner: str) -> Element | None:
    """Root element of a signal dictionary in the archive; None if its file is missing, which is said."""
    if str(PurePosixPath(unquote(source))) not in archive.names:
        logger.warning("%s: %s is to be in %r, which is missing; its units are unknown", archive.path, owner, source)
        return None
    return _xml_root(archive, source, owner, "ssb:SignalDictionary")


def _connector_units(
    structure: Structure, files: Mapping[ElementPath, SystemComponent]
) -> dict[Connector, UnitDefinition]:
    """Units of connectors of components that their FMUs leave open.

    :raises SimulationError: for a unit that is not that of the FMU, or has no definition.
    """
    open_units: dict[Connector, UnitDefinition] = {}
    for (component, name), (unit, definition) in structure.declared.items():
        fmu = files[component].fmu
        if name not in fmu.variables and name not in fmu.arrays:
            continue  # a connection to it is refused
        own = fmu.variables.entry(name).prototype.unit
        known = fmu.units.get(own)
        if definition is None and unit != own:
            raise SimulationError(
                f"{'.'.join((*component, name))} has the unit {unit!r}, which has no definition; add it to Units"
            )
        if definition is not None and known is not None:
            if definition.exponents != known.exponents or definition.conversion_to(known) != SAME:
                raise SimulationError(
                    f"{'.'.join((*component, name))} has the unit {unit!r}, but {own!r} in its FMU; give it "
                    "that of its FMU, so that connections convert"
                )
        elif definition is not None:
            open_units[component, name] = definition
    return open_units


def _connections(
    structure: Structure, parts: dict[ElementPath, SystemComponent], units: Mapping[Connector, UnitDefinition]
) -> list[Connection]:
    """Connections of components, from scalar to scalar.

    :param units: of connectors that have none in their FMUs.
    """
    joined: list[Connection] = []
    for chain in structure.connection_chains():
        start, end = chain[0].start, chain[-1].end
        try:
            sources, targets = (_scalar_ports(pin, parts) for pin in (start, end))
            if len(sources) != len(targets):
                words = "they cannot be connected as a whole"
                raise ConnectError(f"{start} has {len(sources)} elements, {end} has {len(targets)}: {words}")
            joined += [
                Connection.between(
                    source,
                    target,
                    structure.conversion(chain, source.unit or units.get(start[:2]), target.unit or units.get(end[:2])),
                )
                for source, target in zip(sources, targets, strict=True)
            ]
        except ConnectError as error:
            if str(start) in str(error) and str(end) in str(error):
                raise
            raise ConnectError(f"{error}; that is the connection from {start} to {end}") from error
    return joined


def _scalar_ports(node: Pin, parts: dict[ElementPath, SystemComponent]) -> list[Port]:
    """Ports of the scalars of a connector, or of one element of it."""
    name = f"{node.connector}[{','.join(map(str, node.indices))}]" if node.indices else node.connector
    return parts[node.element][name].elements()
