"""Connectors of components and of the system, their types and units."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Literal
from xml.etree.ElementTree import Element, SubElement

from liaisons.base.array_names import Shape, array_and_index
from liaisons.base.unit_definitions import UnitDefinition
from liaisons.base.units import BASE
from liaisons.cosim.description.fmu import LONGEST
from liaisons.cosim.description.variables import Entry, Scalar
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.ssp.xml import tag

Form = Literal["portable", "full"]

Units = Mapping[str, UnitDefinition]

_PORTABLE = {"Enumeration": "Integer"}  # SSP enumerations need names of items, which masters refuse
_SHOWN = {"input": ("Real",), "output": ("Real", "Integer", "Boolean")}
_FULL = {"Real": "Float64", "Integer": "Int32"}  # of FMI 2.0; FMI 3.0 and SSP 2.0 have the same names


def connector(part: SystemComponent, variable: str) -> tuple[Entry, Shape]:
    """Return the scalar or FMI 3.0 array of a variable, and the index of the variable in it; () for all of it."""
    array = part.fmu.variables.whole(variable)
    if array is None:
        return part.fmu.variables[variable], ()
    _, index = array_and_index(variable) if variable != array.like.name else ("", None)
    return array, index or ()


def component_connectors(
    part: SystemComponent, connections: Iterable[Connection], shown: Iterable[VariableReference]
) -> dict[str, Entry]:
    """Connectors of a component by name: those connected to other components, and those exposed by the system."""
    ends = (end.place for connection in connections for end in (connection.source, connection.target))
    entries = (connector(part, name)[0] for owner, name in (*ends, *shown) if owner == part.name)
    return {entry.like.name: entry for entry in entries}


def system_connectors(
    parts: Iterable[SystemComponent], connections: Collection[Connection]
) -> dict[VariableReference, Entry]:
    """Connectors of the system: outputs, and inputs without a source inside; no lists of thousands of scalars."""
    targets = (connection.target for connection in connections)
    fed = {(target.part.name, connector(target.part, target.name)[0].like.name) for target in targets}
    return {
        (part.name, name): connector(part, name)[0]
        for part in parts
        for key, entry in part.fmu.variables.entries.items()
        if entry.like.type in _SHOWN.get(entry.like.causality, ())
        for whole in [part.fmu.variables.whole(key)]
        if whole or entry.size <= LONGEST
        for name in ([key] if whole else entry.names())
        if (part.name, name) not in fed
    }


def add_connectors(parent: Element, connectors: Mapping[str, Entry], units: Units, form: Form) -> None:
    """Add the connectors of an element as its first child."""
    if not connectors:
        return
    group = SubElement(parent, tag("ssd:Connectors"))
    for name, entry in connectors.items():
        element = SubElement(group, tag("ssd:Connector"), name=name, kind=entry.like.causality)
        add_type(element, "ssc", entry.like, units, form)
        add_sizes(element, entry)


def add_sizes(parent: Element, entry: Entry) -> None:
    """Add the dimensions of an array."""
    for size in entry.shape:
        SubElement(parent, tag("ssc:Dimension"), size=str(size))


def add_type(parent: Element, prefix: str, variable: Scalar, units: Units, form: Form) -> Element:
    """Add and return the type of a variable, with its unit if that is defined."""
    name = (
        _PORTABLE.get(variable.type, variable.type) if form == "portable" else _FULL.get(variable.base, variable.base)
    )
    unit = {"unit": variable.unit} if variable.type == "Real" and variable.unit in units else {}
    return SubElement(parent, tag(f"{prefix}:{name}"), unit)


def units_of(parts: Iterable[SystemComponent]) -> dict[str, UnitDefinition]:
    """The units of components, without those that two of them define differently."""
    definitions: dict[str, UnitDefinition] = {}
    contradictory: set[str] = set()
    for part in parts:
        for name, unit in part.fmu.units.items():
            if definitions.setdefault(name, unit) != unit:
                contradictory.add(name)
    return {name: unit for name, unit in definitions.items() if name not in contradictory}


def add_units(parent: Element, name: str, units: Units) -> None:
    """Add an element of this name with unit definitions."""
    if not units:
        return
    group = SubElement(parent, tag(name))
    for unit, definition in units.items():
        bases = zip(BASE, definition.exponents, strict=True)
        attributes = {base: str(exponent) for base, exponent in bases if exponent}
        if definition.factor != 1.0:
            attributes["factor"] = repr(definition.factor)
        if definition.offset != 0.0:
            attributes["offset"] = repr(definition.offset)
        SubElement(SubElement(group, tag("ssc:Unit"), name=unit), tag("ssc:BaseUnit"), attributes)
