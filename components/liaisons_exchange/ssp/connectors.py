"""Connectors of components and of the system, their types and units."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Literal
from xml.etree.ElementTree import Element, SubElement

from liaisons.base.array_names import Shape, array_and_index
from liaisons.base.unit_definitions import UnitDefinition
from liaisons.base.units import BASE
from liaisons.cosim import Connection, Entry, SystemComponent, VariableReference
from liaisons_exchange.ssp.xml import tag

Form = Literal["portable", "full"]

Units = Mapping[str, UnitDefinition]

_PORTABLE = {"Enumeration": "Integer"}  # SSP enumerations need names of items, which masters refuse
_SHOWN = {"input": ("Real",), "output": ("Real", "Integer", "Boolean")}
_FULL = {"Real": "Float64", "Integer": "Int32"}  # of FMI 2.0; FMI 3.0 and SSP 2.0 have the same names


def connector_entry(part: SystemComponent, variable: str) -> tuple[Entry, Shape]:
    """Scalar or FMI 3.0 array that a variable belongs to, and its index in that; () for all of it."""
    array = part.fmu.variables.whole_array(variable)
    if array is None:
        return part.fmu.variables[variable], ()
    _, index = array_and_index(variable) if variable != array.prototype.name else ("", None)
    return array, index or ()


def component_connectors(
    part: SystemComponent, connections: Iterable[Connection], shown: Iterable[VariableReference]
) -> dict[str, Entry]:
    """Connectors of a component by name: those with connections, and those that are shown."""
    ends = (end.reference for connection in connections for end in (connection.source, connection.target))
    entries = (connector_entry(part, name)[0] for owner, name in (*ends, *shown) if owner == part.name)
    return {entry.prototype.name: entry for entry in entries}


def system_connectors(
    parts: Iterable[SystemComponent], connections: Collection[Connection]
) -> dict[VariableReference, Entry]:
    """Connectors of the system: outputs of its components, inputs without a source, but no long lists of scalars."""
    targets = (connection.target for connection in connections)
    fed = {(target.part.name, connector_entry(target.part, target.name)[0].prototype.name) for target in targets}
    return {
        (part.name, name): connector_entry(part, name)[0]
        for part in parts
        for key, entry in part.fmu.variables.entries.items()
        if entry.prototype.type in _SHOWN.get(entry.prototype.causality, ())
        for whole in [part.fmu.variables.whole_array(key)]
        if whole or not entry.is_long
        for name in ([key] if whole else entry.names())
        if (part.name, name) not in fed
    }


def add_connectors(parent: Element, connectors: Mapping[str, Entry], units: Units, form: Form) -> None:
    """Add the connectors of an element as its first child."""
    if not connectors:
        return
    group = SubElement(parent, tag("ssd:Connectors"))
    for name, entry in connectors.items():
        element = SubElement(group, tag("ssd:Connector"), name=name, kind=entry.prototype.causality)
        add_type(element, "ssc", entry, units, form)
        add_dimensions(element, entry)


def add_dimensions(parent: Element, entry: Entry) -> None:
    """Add the dimensions of an array."""
    for size in entry.shape:
        SubElement(parent, tag("ssc:Dimension"), size=str(size))


def add_type(parent: Element, prefix: str, entry: Entry, units: Units, form: Form) -> Element:
    """Add and return the type of a variable, with its unit if that is defined."""
    variable = entry.prototype
    name = (
        _PORTABLE.get(variable.type, variable.type) if form == "portable" else _FULL.get(variable.base, variable.base)
    )
    unit = {"unit": variable.unit} if variable.type == "Real" and variable.unit in units else {}
    return SubElement(parent, tag(f"{prefix}:{name}"), unit)


def units_of(parts: Iterable[SystemComponent]) -> dict[str, UnitDefinition]:
    """Units of all components by name, without those that two of them define differently."""
    definitions: dict[str, UnitDefinition] = {}
    contradictory: set[str] = set()
    for part in parts:
        for name, unit in part.fmu.units.items():
            if definitions.setdefault(name, unit) != unit:
                contradictory.add(name)
    return {name: unit for name, unit in definitions.items() if name not in contradictory}


def add_units(parent: Element, name: str, units: Units) -> None:
    """Add an element with unit definitions.

    :param name: of the element, as ``"ssd:Units"``.
    """
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
