"""Names in the files of an archive; SSP 2.0 kept the namespaces of 1.0."""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element

STRUCTURE = "SystemStructure.ssd"

_NAMESPACES = {
    # Some readers look for these very prefixes.
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}

for _prefix, _uri in _NAMESPACES.items():
    ElementTree.register_namespace(_prefix, _uri)


def tag(name: str) -> str:
    """``"ssd:System"`` as ElementTree writes it."""
    prefix, _, local = name.partition(":")
    return f"{{{_NAMESPACES[prefix]}}}{local}"


def path(*names: str) -> str:
    """A way down from an element, for its ``find`` methods."""
    return "/".join(map(tag, names))


def document(root: Element) -> bytes:
    """The file."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
