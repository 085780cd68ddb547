"""XML names in SSP files; SSP 2.0 has the namespaces of 1.0."""

from __future__ import annotations

import re
from collections.abc import Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from liaisons.base.unit_definitions import UnitDefinition

STRUCTURE = "SystemStructure.ssd"

_NAMESPACES = {
    # Some importers expect these prefixes.
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
    "ssb": "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}

for _prefix, _uri in _NAMESPACES.items():
    ElementTree.register_namespace(_prefix, _uri)


def tag(name: str) -> str:
    """Name of an element with its namespace, in ElementTree's form, from ``"ssd:System"``."""
    prefix, _, local = name.partition(":")
    return f"{{{_NAMESPACES[prefix]}}}{local}"


def child_path(*names: str) -> str:
    """Path of nested child elements for ElementTree's ``find`` methods, from ``"ssd:Elements", "ssd:System"``."""
    return "/".join(map(tag, names))


def xml_content(root: Element) -> bytes:
    """Content of an XML file with a root element."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def unit_definitions(root: Element, group: str) -> Mapping[str, UnitDefinition]:
    """Unit definitions in a root element, by name.

    :param group: the element that lists them.
    """
    return {
        name: UnitDefinition.from_attributes(name, base.attrib)
        for unit in root.iterfind(child_path(group, "ssc:Unit"))
        for name, base in [(unit.get("name", ""), unit.find(tag("ssc:BaseUnit")))]
        if base is not None
    }


def with_declared_prefixes(text: bytes) -> tuple[bytes, list[str]]:
    """XML text with declarations added for its undeclared prefixes, and these prefixes."""
    used = {*re.findall(rb"</?([A-Za-z_][\w.-]*):", text), *re.findall(rb"\s([A-Za-z_][\w.-]*):[\w.-]+\s*=", text)}
    missing = sorted(used - {b"xml", b"xmlns", *re.findall(rb"xmlns:([\w.-]+)\s*=", text)})
    names = [prefix.decode() for prefix in missing]
    added = "".join(f' xmlns:{name}="{_NAMESPACES.get(name, f"undeclared:{name}")}"' for name in names).encode()
    return re.sub(rb"<[A-Za-z_][^\s/>]*", lambda root: root[0] + added, text, count=1), names
