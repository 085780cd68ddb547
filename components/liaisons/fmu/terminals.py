"""terminalsAndIcons.xml: the ports of a component as FMI 3.0 terminals, which FMI 2.0 takes over as they are.

A port has the member names of the Modelica Standard Library: s, v, a, f of a translation, phi, w, a, tau of a rotation.
Positions and rates of two connected terminals are equal (``signal``).  Forces obey Kirchhoff's law: that of an active
port flows into its mechanism, the load of a free port or of a point out of its own, so that ``s_force`` is connected to
``q_load`` without a sign, and sums of impulses likewise (member ``impulse``, ours).  Components of one point
(``bob_x``, ``bob_z``) are nested in a terminal, so that one connection hangs a pendulum on another.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from liaisons.fmu.layout import Fmi
from liaisons.fmu.markup import document, element
from liaisons.language import Terminal, TerminalMember
from liaisons.mechanics import Model

MOST_ELEMENTS = 100
"""Size of the largest array whose elements have terminals in FMI 2.0, which has no arrays."""

_ROTATION = {"s": "phi", "v": "w", "a": "a"}
_COMPONENT = re.compile(r"(?P<point>.+)_(?P<axis>[xyz])(?P<index>\[\d+\])?")
_FORCES = ("f", "tau", "impulse")
_TEXTS = {
    "free": "free coordinate: gives its motion, takes the force of what is attached",
    "active": "active coordinate: takes its motion from an operator or a free coordinate, gives the force for it",
    "point": "place to attach another mechanism: gives its motion, takes the force of what is attached",
    "signal": "signal with its two derivatives, for an active coordinate",
}


def terminals_and_icons(model: Model, fmi: Fmi) -> bytes:
    """Text of terminalsAndIcons.xml, the same bytes for the same arguments."""
    ports = model.ports if fmi == "3" else tuple(_scalar_ports(model))
    return document(element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"}, _root_children(ports)))


def _root_children(ports: tuple[Terminal, ...]) -> Iterator[str]:
    """Yield the lines of the root's children: the place of the icon, and the terminals."""
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    graphics = [
        *element("CoordinateSystem", {**corners, "suggestedScalingFactorTo_mm": "0.1"}),
        *element("Icon", corners),
    ]
    yield from element("GraphicalRepresentation", {}, graphics)
    if ports:
        yield from element("Terminals", {}, _terminals(ports))


def _terminals(ports: tuple[Terminal, ...]) -> Iterator[str]:
    """Yield the lines of the terminals of ports; components of one point are nested."""
    points: dict[tuple[str, str], dict[str, Terminal]] = {}  # (kind, point) -> components by axis
    for port in ports:
        if match := _COMPONENT.fullmatch(port.name):
            point = match["point"] + (match["index"] or "")
            points.setdefault((port.kind, point), {})[match["axis"]] = port
    names = {port.name for port in ports}
    nested = {p.name: point for point, axes in points.items() if len(axes) > 1 for p in axes.values()}
    for port in ports:
        point = nested.get(port.name)
        if point is None or point[1] in names:
            yield from _terminal(port, port.name)
        elif components := points.pop(point, None):
            inner = (line for axis, component in components.items() for line in _terminal(component, axis))
            text = f"{_TEXTS[port.kind]}; by components"
            yield from element("Terminal", {"name": point[1], "matchingRule": "bus", "description": text}, inner)


def _terminal(port: Terminal, name: str) -> Iterator[str]:
    """Yield the lines of the terminal of a port; a signal has one for translations and one for rotations."""
    yield from _member_terminal(port, name, port.members)
    if port.kind == "signal":  # fits translations and rotations
        members = tuple(TerminalMember(_ROTATION[member.role], member.variable) for member in port.members)
        yield from _member_terminal(port, f"{name}_rotation", members)


def _member_terminal(port: Terminal, name: str, members: tuple[TerminalMember, ...]) -> Iterator[str]:
    """Yield the lines of a terminal with its members."""
    attributes = {
        "name": name,
        # Force and impulses may stay unconnected.
        "matchingRule": "plug" if port.kind == "signal" else "bus",
        "terminalKind": "_liaisons_rotation" if members[0].role == "phi" else "_liaisons_translation",
        "description": _TEXTS[port.kind],
    }
    flow = "inflow" if port.kind == "active" else "outflow"
    inner = (
        {"variableName": m.variable, "memberName": m.role, "variableKind": flow if m.role in _FORCES else "signal"}
        for m in members
    )
    yield from element(
        "Terminal", attributes, (line for member in inner for line in element("TerminalMemberVariable", member))
    )


def _scalar_ports(model: Model) -> Iterator[Terminal]:
    """Yield ports of scalars and of elements of arrays, as FMI 2.0 names them."""
    variables = {variable.name: variable for variable in model.variables}
    for port in model.ports:
        variable = variables[port.members[0].variable]
        if variable.dimension is None:
            yield port
        elif variable.count <= MOST_ELEMENTS:
            for i in range(1, variable.count + 1):
                members = (TerminalMember(member.role, f"{member.variable}[{i}]") for member in port.members)
                yield Terminal(f"{port.name}[{i}]", port.kind, tuple(members))
