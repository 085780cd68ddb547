"""Systems as SSP archives.

*Portable* (SSP 1.0) is for every importer: flat, connections from element to element, ``Real``, a
parameter set a component, and, if the FMU supports it, embedded start values, since some importers ignore parameter
sets. Its FMUs extrapolate their inputs, since other masters do not step the sources first; inputs in algebraic loops
start from what solves these. *Full* (SSP 2.0) has
everything that SSP can express: connectors of the system, ``Float64``, arrays, one parameter set with a mapping,
documentation. Both have units.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import get_args
from xml.etree.ElementTree import Element, SubElement
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

from liaisons.base.arguments import as_path
from liaisons.base.arguments import check_choice as one_of
from liaisons.base.files import replacement_path
from liaisons.base.logs import logger
from liaisons.base.unit_definitions import SAME
from liaisons.cosim import Connection, Entry, Port, System, SystemComponent, SystemDocument, VariableReference
from liaisons.errors import SimulationError
from liaisons_exchange.ssp.connectors import (
    Form,
    Units,
    add_connectors,
    add_units,
    component_connectors,
    connector_entry,
    system_connectors,
    units_of,
)
from liaisons_exchange.ssp.documentation import system_page
from liaisons_exchange.ssp.embedded_starts import STARTS, ZEROS, contains_mark, fmu_with_starts
from liaisons_exchange.ssp.experiment import add_experiment, add_simulation_information, effective_experiment
from liaisons_exchange.ssp.parameters import add_binding, parameter_mapping, parameter_set, starts_by_parameter
from liaisons_exchange.ssp.xml import STRUCTURE, tag, xml_content

Files = dict[str, bytes | Path]

_PAGE = "documentation/index.html"
_SHORT = 1e-6
"""A step [s] that is not looked at: a run has one at least."""


def write(
    system: System,
    path: Path | str,
    *,
    form: Form = "portable",
    start_time: float | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
) -> None:
    """Write a system as an archive with its FMUs.

    The default experiment is that of the last run unless given, else the longest time and the shortest step of
    the FMUs' default experiments.

    :param form: ``"portable"`` (SSP 1.0, for every importer) or ``"full"`` (SSP 2.0, all features).
    :param start_time: start of the default experiment [s].
    :param stop_time: its end [s].
    :param step_size: its communication step [s], an annotation that some importers read.
    :raises SimulationError: if the system is empty, has what this form cannot express, or the file cannot be written.
    """
    one_of("form", form, get_args(Form))
    path, document = as_path("archive", path), replace(system.document.filled(), experiment=system.experiment)
    document = replace(document, experiment=effective_experiment(document, start_time, stop_time, step_size))
    if form == "portable":
        document = _portable(document)
    name, parts, connections, experiment = document.name, document.parts, document.connections, document.experiment
    files: Files = {}
    root = Element(tag("ssd:SystemStructureDescription"), version="1.0" if form == "portable" else "2.0", name=name)
    whole = SubElement(root, tag("ssd:System"), name=name)
    units = units_of(parts.values())
    if form == "portable":
        _refuse_fmi3_arrays(path, parts.values(), connections)
        _add_portable_components(whole, parts.values(), connections, units, files)
    else:
        _add_full(whole, parts.values(), connections, units, files)
        files[_PAGE] = system_page(document).encode()
    add_simulation_information(whole, experiment)
    add_units(root, "ssd:Units", units)
    add_experiment(root, experiment)
    if form == "full":
        SubElement(root, tag("ssc:MetaData"), kind="general", type="text/html", source=_PAGE)
    with replacement_path(path) as part, ZipFile(part, "w") as archive:
        for file, content in {STRUCTURE: xml_content(root), **files}.items():
            data = content.read_bytes() if isinstance(content, Path) else content
            # FMUs are compressed already; without a date, equal systems are equal files
            archive.writestr(ZipInfo(file), data, ZIP_STORED if file.endswith(".fmu") else ZIP_DEFLATED)


def _portable(document: SystemDocument) -> SystemDocument:
    """Copy whose names are identifiers, and whose FMUs are for masters that step all of them at once."""
    document, names = replace(document, name=_identifier(document.name)), _unique_identifiers(document.parts)
    parts = {
        names[name]: replace(part.extrapolating_copy(), name=names[name])
        for name, part in _with_solved_loops(document).items()
    }
    connections = [
        replace(link, source=_renamed_port(link.source, parts, names), target=_renamed_port(link.target, parts, names))
        for link in document.connections
    ]
    return replace(document, parts=parts, connections=connections)


def _with_solved_loops(document: SystemDocument) -> Mapping[str, SystemComponent]:
    """Components, with inputs in algebraic loops that start from the solution of the loops.

    Other masters pass values on only once or twice.
    """
    graph, parts, start_time = document.graph, document.parts, document.experiment.start_time or 0.0
    if not graph.algebraic_loops:
        return parts
    try:
        result = System.from_document(document).simulate(times=(start_time, start_time + _SHORT))
    except SimulationError as error:
        words = "%s: its algebraic loops are not solved at the start, for it cannot be run: %s"
        logger.warning(words, document.name, error)
        return parts
    starts = {owner: dict(part.starts) for owner, part in parts.items()}
    for owner, variable in (connection.target.reference for connection in document.connections):
        if owner in graph.cyclic and not parts[owner].fmu.variables.whole_array(variable):
            starts[owner][variable] = float(result[f"{owner}.{variable}"][0])
    return {owner: replace(part, starts=starts[owner]) for owner, part in parts.items()}


def _identifier(name: str) -> str:
    """Identifier from a name, with underscores for characters that some importers refuse."""
    return re.sub(r"^(?=\d)|\W", "_", name, flags=re.ASCII) or "_"


def _unique_identifiers(names: Iterable[str]) -> dict[str, str]:
    """Unique identifiers of components by their names."""
    identifiers: dict[str, str] = {}
    for name in sorted(names, key=lambda name: name != _identifier(name)):  # identifiers stay
        free, number = _identifier(name), 1
        while free in identifiers.values():
            number += 1
            free = f"{_identifier(name)}_{number}"
        identifiers[name] = free
    return identifiers


def _renamed_port(port: Port, parts: Mapping[str, SystemComponent], names: Mapping[str, str]) -> Port:
    """Port of a component that has been renamed.

    :param parts: by their new names; ``names``: old name -> new one.
    """
    return Port(parts[names[port.part.name]], port.name)


def _add_portable_components(
    system: Element, parts: Collection[SystemComponent], connections: Collection[Connection], units: Units, files: Files
) -> None:
    """Add components and connections to a system, and FMUs and parameter sets of start values to the files."""
    elements = SubElement(system, tag("ssd:Elements"))
    # All outputs, since some importers record connectors only; no unconnected inputs, since some set them to 0.
    shown = [
        p
        for p, entry in system_connectors(parts, connections).items()
        if entry.prototype.causality == "output" and not entry.shape
    ]
    for part in parts:
        zeros = _has_nonzero_connected_start(part, connections) and contains_mark(part, ZEROS)
        bake = zeros or (bool(part.starts) and contains_mark(part, STARTS))
        content = fmu_with_starts(part, ignore_zeros=zeros) if bake else b""
        source = _add_file(files, f"{part.name}.fmu", content) if bake else _add_fmu(files, part)
        element = _add_component(elements, part.name, source)
        add_connectors(element, component_connectors(part, connections, shown), units, "portable")
        if part.starts:
            listed = [(variable, part, variable, value) for variable, value in starts_by_parameter(part).items()]
            add_binding(element, _add_file(files, f"{part.name}.ssv", parameter_set(listed, units, "portable")))
    _add_connections(system, connections, {})


def _has_nonzero_connected_start(part: SystemComponent, connections: Iterable[Connection]) -> bool:
    """Whether a connected input has a start value other than 0, the value that some importers set before a step."""
    fed = (connection.target for connection in connections)
    starts = (end.variable.start for end in fed if end.part.name == part.name and end.variable.type == "Real")
    return any(start is not None and float(start) != 0 for start in starts)


def _add_full(
    system: Element, parts: Collection[SystemComponent], connections: Collection[Connection], units: Units, files: Files
) -> None:
    """Add connectors, one parameter set with its mapping, components and connections to a system."""
    shown = system_connectors(parts, connections)
    add_connectors(system, {"_".join(reference): entry for reference, entry in shown.items()}, units, "full")
    listed = [
        (f"{part.name}_{variable}", part, variable, value)
        for part in parts
        for variable, value in starts_by_parameter(part).items()
    ]
    if listed:
        values = _add_file(files, "parameters.ssv", parameter_set(listed, units, "full"))
        add_binding(system, values, _add_file(files, "parameters.ssm", parameter_mapping(listed)))
    elements = SubElement(system, tag("ssd:Elements"))
    for part in parts:
        element = _add_component(elements, part.name, _add_fmu(files, part))
        add_connectors(element, component_connectors(part, connections, shown), units, "full")
    _add_connections(system, connections, shown)


def _add_component(elements: Element, name: str, source: str) -> Element:
    """Add a component with an FMU, and return its element."""
    kind = "application/x-fmu-sharedlibrary"
    return SubElement(elements, tag("ssd:Component"), name=name, type=kind, source=source)


def _add_connections(
    system: Element, connections: Iterable[Connection], shown: Mapping[VariableReference, Entry]
) -> None:
    """Add connections between components, and between them and the connectors of the system that are shown."""
    group = SubElement(system, tag("ssd:Connections"))
    for connection in connections:
        attributes: dict[str, str] = {}
        for role, end in (("start", connection.source), ("end", connection.target)):
            entry, index = connector_entry(end.part, end.name)
            attributes |= {f"{role}Element": end.part.name, f"{role}Connector": entry.prototype.name}
            if index:
                attributes[f"{role}Indices"] = " ".join(map(str, index))
        if connection.conversion == SAME:
            SubElement(group, tag("ssd:Connection"), attributes)
        else:  # of units, too: some importers support transformations only
            element = SubElement(group, tag("ssd:Connection"), {**attributes, "suppressUnitConversion": "true"})
            numbers = {name: repr(number) for name, number in connection.conversion._asdict().items()}
            SubElement(element, tag("ssc:LinearTransformation"), numbers)
    for (part, variable), entry in shown.items():
        inside = {"startElement": part, "startConnector": variable}
        if entry.prototype.causality == "output":
            attributes = inside | {"endConnector": f"{part}_{variable}"}
        else:
            attributes = {"startConnector": f"{part}_{variable}", "endElement": part, "endConnector": variable}
        SubElement(group, tag("ssd:Connection"), attributes)
    if not len(group):
        system.remove(group)


def _add_fmu(files: Files, part: SystemComponent) -> str:
    """Add the FMU file of a component unless it is added already, and return its name in the archive."""
    part.fmu.require_file("an archive")
    path = part.fmu.path
    added = next((name for name, content in files.items() if content == path), None)
    return added or _add_file(files, path.name, path)


def _add_file(files: Files, name: str, content: bytes | Path) -> str:
    """Add a resource, and return its name in the archive, unique and safe in a URI."""
    stem, dot, suffix = re.sub(r"[^\w.\-]", "_", name, flags=re.ASCII).rpartition(".")
    number, free = 1, f"resources/{stem}{dot}{suffix}"
    while free in files:
        number += 1
        free = f"resources/{stem}_{number}{dot}{suffix}"
    files[free] = content
    return free


def _refuse_fmi3_arrays(path: Path, parts: Iterable[SystemComponent], connections: Iterable[Connection]) -> None:
    """Raise a SimulationError for FMI 3.0 arrays, which SSP 1.0 does not know."""
    used = [(end.part, end.name) for connection in connections for end in (connection.source, connection.target)]
    used += [(part, name) for part in parts for name in part.starts]
    arrays = [f"{part.name}.{name}" for part, name in used if part.fmu.variables.whole_array(name)]
    if arrays:
        raise SimulationError(
            f"{path}: {arrays[0]} belongs to an array of FMI 3.0, which SSP 1.0 does not know: choose form='full'"
        )
