"""Start values as parameter sets (SSV) and mappings (SSM)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from xml.etree.ElementTree import Element, SubElement

from liaisons.cosim import SystemComponent
from liaisons_exchange.ssp.assignment import Value
from liaisons_exchange.ssp.connectors import Form, Units, add_dimensions, add_type, add_units
from liaisons_exchange.ssp.xml import tag, xml_content

ParameterEntry = tuple[str, SystemComponent, str, Value]
"""Name of a parameter, its component and variable, and its value."""

_INITIAL = "initialValues"  # the set that OSP's masters read


def starts_by_parameter(part: SystemComponent) -> dict[str, Value]:
    """Start values by the names of SSP parameters: elements of FMI 2.0 arrays, and whole FMI 3.0 arrays."""
    values: dict[str, Value] = {}
    for name, value in part.starts.items():
        is_whole = part.fmu.variables.whole_array(name) is not None
        values |= {name: value} if is_whole else replace(part, starts={name: value}).element_starts
    return values


def parameter_set(listed: Iterable[ParameterEntry], units: Units, form: Form) -> bytes:
    """Content of a parameter set file (SSV)."""
    root = Element(tag("ssv:ParameterSet"), version="1.0" if form == "portable" else "2.0", name=_INITIAL)
    group = SubElement(root, tag("ssv:Parameters"))
    used: dict[str, None] = {}
    for name, part, variable, value in listed:
        parameter = SubElement(group, tag("ssv:Parameter"), name=name)
        entry = part.fmu.variables.entry(variable)
        element = add_type(parameter, "ssv", entry, units, form)
        element.attrib = {"value": value_text(value), **element.attrib}
        used |= dict.fromkeys(filter(None, [element.get("unit")]))
        add_dimensions(parameter, entry)
    add_units(root, "ssv:Units", {unit: units[unit] for unit in used})
    return xml_content(root)


def parameter_mapping(listed: Iterable[ParameterEntry]) -> bytes:
    """Content of a mapping file (SSM), from parameters of a set to variables of components."""
    root = Element(tag("ssm:ParameterMapping"), version="2.0")
    for name, part, variable, _ in listed:
        SubElement(root, tag("ssm:MappingEntry"), source=name, target=f"{part.name}.{variable}")
    return xml_content(root)


def add_binding(element: Element, values: str, names: str | None = None) -> None:
    """Add a parameter binding to a component or system.

    :param values: file of the parameter set; ``names``: file of its mapping.
    """
    binding = SubElement(SubElement(element, tag("ssd:ParameterBindings")), tag("ssd:ParameterBinding"), source=values)
    if names is not None:
        SubElement(binding, tag("ssd:ParameterMapping"), source=names)


def value_text(value: Value) -> str:
    """Text of a start value in XML."""
    if isinstance(value, tuple):
        return " ".join(map(value_text, value))
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)
