"""Terminals of an FMU, groups of variables that are connected together, from ``terminalsAndIcons.xml`` or from names.

A *port* is a terminal with a value, its rate and its acceleration, all inputs or all outputs, and in most cases a
force in the opposite direction.  Member names are those of the Modelica Standard Library: s, v, a, f of a translation,
and phi, w, a, tau of a rotation, which are read as s, v, a, f.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple, final
from xml.etree.ElementTree import Element

from liaisons.base.archive import Archive
from liaisons.base.port_names import PortNames, impulse_name, port_names
from liaisons.base.xml_documents import read_tree
from liaisons.fmu_files.variables import Variables

logger = logging.getLogger(__name__)

TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
"""File of the terminals in an FMU of FMI 3.0, or of FMI 2.0 made by liaisons."""

_MOTION = ("s", "v", "a")
_FORCE, _IMPULSE = "f", "impulse"
_ROTATION_ROLES = {"phi": "s", "w": "v", "tau": "f"}
_FLOWS = {"inflow", "outflow"}


@final
@dataclass(frozen=True, slots=True)
class MemberVariable:
    """A variable of a terminal; ``kind`` is its ``variableKind``: ``signal``, ``inflow``, ``outflow``, ..."""

    variable: str
    kind: str = "signal"

    def sums_to_zero_with(self, other: MemberVariable) -> bool:
        """Whether the two are flows whose sum is zero when they are connected: both inflow, or both outflow."""
        return self.kind == other.kind and self.kind in _FLOWS


class PointComponent(NamedTuple):
    """Names of a point and of one of its components."""

    point: str
    axis: str


@final
@dataclass(frozen=True, slots=True)
class TerminalDescription:
    """A terminal.

    :param kind: ``terminalKind``; empty if the FMU gives none.
    :param rule: ``matchingRule``: ``plug``, ``bus``, ``sequence``, ...
    :param members: variables by member name.
    :param nested: terminals inside this one, by name: of a point, its components.
    :param point: name of the enclosing terminal and of this one in it; None at the top.
    :ivar motion: names of the variables of value, rate and acceleration; None unless the terminal has all three.
    :ivar force: that of the force, opposite to the motion in causality; None if there is none.
    :ivar impulse: that of the sum of impulses, of the same causality as the force; None if there is none.
    """

    name: str
    kind: str = ""
    rule: str = "bus"
    members: Mapping[str, MemberVariable] = field(default_factory=dict)
    nested: Mapping[str, TerminalDescription] = field(default_factory=dict)
    point: PointComponent | None = None
    motion: tuple[str, str, str] | None = field(init=False, repr=False, default=None)
    force: str | None = field(init=False, repr=False, default=None)
    impulse: str | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        names = {name: member.variable for name, member in self.members.items()}
        if names.keys() >= {*_MOTION}:
            object.__setattr__(self, "motion", tuple(names[name] for name in _MOTION))
        object.__setattr__(self, "force", names.get(_FORCE))
        object.__setattr__(self, "impulse", names.get(_IMPULSE))

    def element(self, index: str) -> TerminalDescription:
        """Terminal whose members are one element of each array; ``index`` is for example ``"[3]"``."""
        return replace(
            self,
            name=f"{self.name}{index}",
            members={name: replace(m, variable=f"{m.variable}{index}") for name, m in self.members.items()},
            nested={name: terminal.element(index) for name, terminal in self.nested.items()},
            point=self.point and self.point._replace(point=f"{self.point.point}{index}"),
        )


@final
class Terminals:
    """The terminals of an FMU, and those of them that are ports, by variable.

    :ivar named: terminals that are not nested, by name.
    :ivar renamed: name of the value -> names of the members, of ports that :func:`port_names` does not describe.
    :ivar get: name of a terminal, or of an element of one -> the terminal; None if there is none.
    :ivar port: name of a variable, an array or an element of one -> the port to which it belongs; None without one.
    """

    def __init__(self, variables: Variables, declared: Sequence[TerminalDescription] = ()) -> None:
        self.named: dict[str, TerminalDescription] = {}
        self.renamed: dict[str, PortNames] = {}
        self._ports: dict[str, TerminalDescription] = {}  # by variable
        self._points: dict[str, dict[str, TerminalDescription]] = {}  # by the names of variables
        for terminal in declared:
            self._add(terminal, variables)
        for name in variables.entries:
            names = port_names(name)
            if name not in self._ports and {names.rate, names.acceleration} <= variables.entries.keys():
                self._add(_terminal_by_names(names, variables), variables)
        for name, nested in self._points.items():
            self.named.setdefault(name, TerminalDescription(name, nested=nested))
        self.get, self.port = partial(_terminal_or_element, self.named), partial(_terminal_or_element, self._ports)

    def _add(self, terminal: TerminalDescription, variables: Variables) -> None:
        """Add a terminal and those nested in it."""
        if terminal.point is None:
            self.named.setdefault(terminal.name, terminal)
        for nested in terminal.nested.values():
            self._add(nested, variables)
        motion = terminal.motion
        if motion is None:
            return
        entries = [variables.entry(name) for name in motion]
        kinds = {(entry.prototype.type, entry.prototype.causality, entry.shape) for entry in entries}
        kind, causality, _ = kinds.pop()
        if not kinds and kind == "Real" and causality in {"input", "output"}:
            usual, force = port_names(motion[0]), terminal.force or ""
            if motion != usual[:3] or force not in {"", usual.force, usual.load}:
                self.renamed[motion[0]] = PortNames(*motion, force, "", "", "")
            if terminal.point is None and usual.axis:
                terminal = replace(terminal, point=PointComponent(usual.point, usual.axis))
                self._points.setdefault(usual.point, {})[usual.axis] = terminal
            for member in terminal.members.values():  # of two terminals with the same variables, the first
                self._ports.setdefault(member.variable, terminal)


def _terminal_or_element(terminals: Mapping[str, TerminalDescription], name: str) -> TerminalDescription | None:
    if name in terminals or not name.endswith("]"):
        return terminals.get(name)
    base = name.partition("[")[0]
    whole = terminals.get(base)
    return whole and whole.element(name[len(base) :])


def _terminal_by_names(names: PortNames, variables: Variables) -> TerminalDescription:
    """Terminal of variables with conventional names, of an FMU that declares none for them."""
    entry = variables.entries[names.value].prototype
    force, flow = (names.force, "inflow") if entry.causality == "input" else (names.load, "outflow")
    motion = names.value, names.rate, names.acceleration
    members = {member: MemberVariable(name) for member, name in zip(_MOTION, motion, strict=True)}
    for member, name in ((_FORCE, force), (_IMPULSE, impulse_name(force))):
        if name in variables.entries:
            members[member] = MemberVariable(name, flow)
    return TerminalDescription(names.value, members=members)


def read_terminals(archive: Archive, variables: Variables) -> Terminals:
    """Terminals of an FMU; derived from names of variables, with a warning, if their file is unusable."""
    if TERMINALS not in archive.names:
        return Terminals(variables)
    try:
        with archive.open(TERMINALS) as file:
            root = read_tree(file)
        if root.tag != "fmiTerminalsAndIcons":
            raise ValueError("its root is not fmiTerminalsAndIcons")
        return Terminals(
            variables, [_read_terminal(element, variables) for element in root.iterfind("Terminals/Terminal")]
        )
    except ValueError as error:
        reason = " ".join(str(error).split())
        logger.warning("%s: its %s is not used, ports follow from variable names: %s", archive.path, TERMINALS, reason)
        return Terminals(variables)


def _read_terminal(element: Element, variables: Variables, enclosing: str = "") -> TerminalDescription:
    """Terminal of an XML element; ``enclosing`` is the name of the terminal in which it is nested."""
    name = _required_attribute(element, "name")
    members = {
        _ROTATION_ROLES.get(role, role): MemberVariable(
            _required_attribute(member, "variableName"), member.get("variableKind", "signal")
        )
        for member in element.iterfind("TerminalMemberVariable")
        for role in [member.get("memberName", member.get("variableName", ""))]
    }
    for member in members.values():
        if member.variable not in variables.entries and member.variable not in variables:
            raise ValueError(f"the terminal {name!r} has a variable {member.variable!r} that does not exist")
    nested = {n.name: n for n in (_read_terminal(e, variables, name) for e in element.iterfind("Terminal"))}
    kind, rule = element.get("terminalKind", ""), element.get("matchingRule", "bus")
    return TerminalDescription(
        name, kind, rule, members, nested, PointComponent(enclosing, name) if enclosing else None
    )


def _required_attribute(element: Element, name: str) -> str:
    if name not in element.attrib:
        raise ValueError(f"a {element.tag} has no attribute {name!r}")
    return element.attrib[name]
