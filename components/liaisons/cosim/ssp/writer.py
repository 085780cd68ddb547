"""A system as an archive.

*Portable* (SSP 1.0) is for every importer that there is: flat, connections from element to element, ``Real``, a
parameter set a component, and, where the FMU can take them, the start values inside the FMU, too, since some importers
pass over parameter sets.  *Full* (SSP 2.0) says everything that SSP can say: connectors of the system, ``Float64``,
arrays, one parameter set with a mapping, documentation.  Both have units.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import get_args
from xml.etree.ElementTree import Element, SubElement
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

from liaisons.arguments import chosen
from liaisons.cosim.component import Component
from liaisons.cosim.ports import Link
from liaisons.cosim.ssp.baking import baked, takes_starts
from liaisons.cosim.ssp.connectors import (
    Connector,
    Form,
    Place,
    Units,
    add_connectors,
    add_units,
    connector,
    inner,
    outer,
    units_of,
)
from liaisons.cosim.ssp.documentation import page
from liaisons.cosim.ssp.experiment import Experiment, add_experiment, add_master
from liaisons.cosim.ssp.parameters import bind, mapping, parameter_set, scalars
from liaisons.cosim.ssp.xml import STRUCTURE, document, tag
from liaisons.errors import SimulationError
from liaisons.files import replacing

Files = dict[str, bytes | Path]

_PAGE = "documentation/index.html"


def write(
    path: Path,
    name: str,
    components: Mapping[str, Component],
    links: Collection[Link],
    *,
    form: Form,
    experiment: Experiment,
) -> None:
    """Write an archive; it appears when it is complete.

    :param name: name of the system.
    :raises SimulationError: if it cannot be written, or is to be portable and uses arrays of FMI 3.0.
    """
    chosen("form", form, get_args(Form))
    files: Files = {}
    root = Element(tag("ssd:SystemStructureDescription"), version="1.0" if form == "portable" else "2.0", name=name)
    system = SubElement(root, tag("ssd:System"), name=name)
    units = units_of(components.values())
    if form == "portable":
        _check_scalars(path, components.values(), links)
        _add_portable(system, components.values(), links, units, files)
    else:
        _add_full(system, components.values(), links, units, files)
        files[_PAGE] = page(name, components.values(), links, experiment).encode()
    add_master(system, experiment)
    add_units(root, "ssd:Units", units)
    add_experiment(root, experiment)
    if form == "full":
        SubElement(root, tag("ssc:MetaData"), kind="general", type="text/html", source=_PAGE)
    with replacing(path) as part, ZipFile(part, "w") as archive:
        for file, content in {STRUCTURE: document(root), **files}.items():
            data = content.read_bytes() if isinstance(content, Path) else content
            # FMUs are compressed already; without a date, equal systems are equal files
            archive.writestr(ZipInfo(file), data, ZIP_STORED if file.endswith(".fmu") else ZIP_DEFLATED)


def _add_portable(
    system: Element, components: Collection[Component], links: Collection[Link], units: Units, files: Files
) -> None:
    elements = SubElement(system, tag("ssd:Elements"))
    # All outputs, since some importers record connectors only; no free inputs, since these would set them to 0.
    shown = [place for place, found in outer(components, links).items() if found.kind == "output" and not found.shape]
    for component in components:
        bake = bool(component.starts) and takes_starts(component)
        source = _add_file(files, f"{component.name}.fmu", baked(component)) if bake else _add_fmu(files, component)
        element = _add_component(elements, component.name, source)
        add_connectors(element, inner(component, links, shown), units, "portable")
        if component.starts:
            listed = [(variable, component, variable) for variable in scalars(component)]
            bind(element, _add_file(files, f"{component.name}.ssv", parameter_set(listed, units, "portable")))
    _add_connections(system, links, {})


def _add_full(
    system: Element, components: Collection[Component], links: Collection[Link], units: Units, files: Files
) -> None:
    shown = outer(components, links)
    add_connectors(system, shown.values(), units, "full")
    listed = [(f"{c.name}_{variable}", c, variable) for c in components for variable in scalars(c)]
    if listed:
        values = _add_file(files, "parameters.ssv", parameter_set(listed, units, "full"))
        bind(system, values, _add_file(files, "parameters.ssm", mapping(listed)))
    elements = SubElement(system, tag("ssd:Elements"))
    for component in components:
        element = _add_component(elements, component.name, _add_fmu(files, component))
        add_connectors(element, inner(component, links, shown), units, "full")
    _add_connections(system, links, shown)


def _add_component(elements: Element, name: str, source: str) -> Element:
    kind = "application/x-fmu-sharedlibrary"
    return SubElement(elements, tag("ssd:Component"), name=name, type=kind, source=source)


def _add_connections(system: Element, links: Iterable[Link], shown: Mapping[Place, Connector]) -> None:
    """Those between components, arrays of FMI 3.0 element by element, and those with the system's connectors."""
    group = SubElement(system, tag("ssd:Connections"))
    for link in links:
        attributes: dict[str, str] = {}
        for role, end in (("start", link.source), ("end", link.target)):
            found, index = connector(end.component, end.name)
            attributes |= {f"{role}Element": end.component.name, f"{role}Connector": found.name}
            if index:
                attributes[f"{role}Indices"] = " ".join(map(str, index))
        SubElement(group, tag("ssd:Connection"), attributes)
    for (component, variable), found in shown.items():
        inside = {"startElement": component, "startConnector": variable}
        if found.kind == "output":
            SubElement(group, tag("ssd:Connection"), inside | {"endConnector": found.name})
        else:
            ends = {"endElement": component, "endConnector": variable}
            SubElement(group, tag("ssd:Connection"), {"startConnector": found.name} | ends)
    if not len(group):
        system.remove(group)


def _add_fmu(files: Files, component: Component) -> str:
    """The FMU itself; components of one file share it."""
    path = component.fmu.path
    known = next((name for name, content in files.items() if content == path), None)
    return known or _add_file(files, path.name, path)


def _add_file(files: Files, name: str, content: bytes | Path) -> str:
    """Put a file among the resources, under a name that is safe in a URI and not taken."""
    stem, dot, suffix = re.sub(r"[^\w.\-]", "_", name, flags=re.ASCII).rpartition(".")
    number, free = 1, f"resources/{stem}{dot}{suffix}"
    while free in files:
        number += 1
        free = f"resources/{stem}_{number}{dot}{suffix}"
    files[free] = content
    return free


def _check_scalars(path: Path, components: Iterable[Component], links: Iterable[Link]) -> None:
    used = [(end.component, end.name) for link in links for end in (link.source, link.target)]
    used += [(component, name) for component in components for name in component.starts]
    arrays = [f"{component.name}.{name}" for component, name in used if component.fmu.variables.whole(name)]
    if arrays:
        raise SimulationError(
            f"{path}: {arrays[0]} belongs to an array of FMI 3.0, which SSP 1.0 does not know: choose form='full'"
        )
