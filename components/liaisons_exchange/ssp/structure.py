"""System structures with flattened nested systems and signal dictionaries: FMUs, connections, bindings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, final
from xml.etree.ElementTree import Element

from liaisons.base.array_names import Shape
from liaisons.base.logs import logger
from liaisons.base.unit_definitions import SAME, Conversion, UnitDefinition
from liaisons.errors import ConnectError, SimulationError, suggestion
from liaisons_exchange.ssp.xml import child_path, tag, unit_definitions

ElementPath = tuple[str, ...]
"""Names of nested elements; () is the root system."""
Connector = tuple[ElementPath, str]
"""Element and name of its connector, or of its parameter or variable."""

_IMPLEMENTATIONS = ("any", "CoSimulation", "ModelExchange")
_FMU = "application/x-fmu-sharedlibrary"
_MOST_COMPONENTS, _LONGEST_WAY = 10_000, 1000  # beyond that reading would take minutes


class Pin(NamedTuple):
    """A connector of an element, or one element of it if it is an array."""

    element: ElementPath
    connector: str
    indices: Shape = ()

    def __str__(self) -> str:
        return ".".join((*self.element, self.connector))


class Edge(NamedTuple):
    """A connection of the file, in the direction of signal flow.

    :param conversion: its linear transformation, after the conversion of units.
    :param as_is: ``suppressUnitConversion``.
    """

    start: Pin
    end: Pin
    conversion: Conversion = SAME
    as_is: bool = False

    def __str__(self) -> str:
        return f"the connection from {self.start} to {self.end}"


@final
@dataclass(frozen=True)
class Structure:
    """A flattened system.

    :param sources: component -> path of its FMU in the archive.
    :param bindings: parameter bindings of components and systems, in ascending priority.
    :param shown: connectors of systems and entries of signal dictionaries, with their units if specified.
    :param declared: units of connectors of components by name, with their definitions in the structure, if any.
    """

    name: str
    sources: dict[ElementPath, str] = field(default_factory=dict)
    bindings: list[tuple[ElementPath, Element]] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    shown: dict[Connector, UnitDefinition | None] = field(default_factory=dict)
    declared: dict[Connector, tuple[str, UnitDefinition | None]] = field(default_factory=dict)

    def connection_chains(self) -> Iterator[list[Edge]]:
        """Yield chains of edges from component to component through connectors of systems.

        :raises SimulationError: if an input has several sources, or connections form a cycle without a component.
        """
        for edge in self.edges:
            if edge.end.element in self.sources and (chain := self._chain_to(edge)):
                yield chain

    def _chain_to(self, last: Edge) -> list[Edge] | None:
        """Chain of edges from an output of a component to the end of the last edge; None if no output leads there."""
        chain, node = [last], last.start
        seen = {node}
        while node.element not in self.sources:
            edges = self._edges_into.get((node.element, node.connector), ())
            edges = [edge for edge in edges if edge.end.indices in {(), node.indices}]
            if not edges:
                return None
            if len(edges) > 1:
                raise SimulationError(f"{node} has several sources: {', '.join(str(e.start) for e in edges)}")
            (edge,) = edges
            if not edge.end.indices and not edge.start.indices:
                edge = edge._replace(start=edge.start._replace(indices=node.indices))
            if edge.start in seen:
                raise SimulationError(f"{edge} goes round in a circle without a component")
            if len(seen) > _LONGEST_WAY:
                raise SimulationError(f"the connections to {node} lead through more than {_LONGEST_WAY} connectors")
            node = edge.start
            seen.add(node)
            chain.append(edge)
        return chain[::-1]

    def conversion(self, chain: list[Edge], unit: UnitDefinition | None, last: UnitDefinition | None) -> Conversion:
        """Conversion from the output at the start of a chain to the input at its end.

        :param unit: of the output; ``last`` of the input; None if undefined.
        :raises ConnectError: if units in the chain have different dimensions.
        """
        total = SAME
        for edge in chain:
            next_unit = last if edge is chain[-1] else self.shown.get((edge.end.element, edge.end.connector))
            if not edge.as_is and unit is not None and next_unit is not None:
                if unit.exponents != next_unit.exponents:
                    raise ConnectError(f"{edge} joins units of different kinds")
                total = total.then(unit.conversion_to(next_unit))
            total = total.then(edge.conversion)
            unit = unit if next_unit is None and not edge.as_is and edge.conversion == SAME else next_unit
        return total

    def parameter_targets(self, system: ElementPath, name: str) -> list[Connector]:
        """Components and variables to which a parameter of a system or component leads."""
        variables: dict[Connector, None] = {}
        seen: set[Connector] = set()
        waiting = [(system, name)]
        while waiting:
            connector = waiting.pop()
            if connector in seen:
                continue
            seen.add(connector)
            if connector[0] in self.sources:
                variables[connector] = None
            elif connector in self.shown:
                edges = self._edges_from.get(connector, [])
                if converting := [edge for edge in edges if edge.conversion != SAME]:
                    end = converting[0].end
                    raise SimulationError(f"{converting[0]} converts a parameter, which is not done here: give {end}")
                waiting += [(edge.end.element, edge.end.connector) for edge in reversed(edges)]
            else:
                waiting += self._split_parameter_name(*connector)
        return list(variables)

    def _split_parameter_name(self, system: ElementPath, name: str) -> list[Connector]:
        """Element with whose name the dotted name of a parameter begins, and the rest; none if there is no such one."""
        dot = len(name)
        while (dot := name.rfind(".", 0, dot)) > 0:  # the longest name of an element wins
            child = (*system, name[:dot])
            if child in self._paths:
                return [(child, name[dot + 1 :])]
        return []

    @cached_property
    def _edges_into(self) -> Mapping[Connector, list[Edge]]:
        """Edges by the connector at their end."""
        return _by_connector((edge.end, edge) for edge in self.edges)

    @cached_property
    def _edges_from(self) -> Mapping[Connector, list[Edge]]:
        """Edges by the connector at their start."""
        return _by_connector((edge.start, edge) for edge in self.edges)

    @cached_property
    def _paths(self) -> set[ElementPath]:
        """Paths of all components, and of the systems that contain them."""
        return {component[:depth] for component in self.sources for depth in range(1, len(component) + 1)}


def _by_connector(ends: Iterable[tuple[Pin, Edge]]) -> dict[Connector, list[Edge]]:
    """Edges grouped by the connector of their pin."""
    grouped: dict[Connector, list[Edge]] = {}
    for pin, edge in ends:
        grouped.setdefault(pin[:2], []).append(edge)
    return grouped


def read_structure(root: Element, dictionary_root: Callable[[str, str], Element | None]) -> Structure:
    """Flattened system in a system structure description.

    :param dictionary_root: takes the source of a signal dictionary and a label, and returns its root, None if the file
        is missing.
    :raises SimulationError: for elements that cannot be simulated here.
    """
    system = root.find(tag("ssd:System"))
    if system is None:
        raise SimulationError("its structure has no System")
    structure = Structure(root.get("name") or system.get("name") or "system")
    reader = _Reader(structure, unit_definitions(root, "ssd:Units"), dictionary_root)
    reader.read_system(system, (), {})
    structure.bindings.sort(key=lambda binding: -len(binding[0]))  # outer bindings have priority
    return structure


@final
@dataclass(frozen=True)
class _Reader:
    """Collects nested systems in a structure.

    :param kinds: of connectors, if specified.
    """

    structure: Structure
    units: Mapping[str, UnitDefinition]
    dictionary_root: Callable[[str, str], Element | None]
    kinds: dict[Connector, str] = field(default_factory=dict)

    def read_system(self, system: Element, parent: ElementPath, dictionaries: dict[str, ElementPath]) -> None:
        """Add a system and its nested systems to the structure."""
        structure = self.structure
        structure.bindings.extend((parent, binding) for binding in system.iterfind(_BINDINGS))
        structure.shown.update(
            {(parent, name): self._unit(parent, name, unit) for name, unit in self._store_connectors(system, parent)}
        )
        for dictionary in system.iterfind(_DICTIONARIES):
            self._store_entries(dictionary, parent)
        own = {d.get("name", ""): (*parent, f"[{d.get('name')}]") for d in system.iterfind(_DICTIONARIES)}
        dictionaries = dictionaries | own
        inside: dict[str, ElementPath] = {}
        for element in system.iterfind(child_path("ssd:Elements") + "/*"):
            name = _required(element, "name")
            if name in inside:
                raise SimulationError(f"two elements are called {'.'.join(inside[name])}; a name stands for one")
            inside[name] = (*parent, name)
            if element.tag == tag("ssd:Component"):
                structure.sources[inside[name]] = _fmu_path(element, inside[name])
                if len(structure.sources) > _MOST_COMPONENTS:
                    raise SimulationError(f"its structure has more than {_MOST_COMPONENTS} components; divide it")
                structure.bindings.extend((inside[name], binding) for binding in element.iterfind(_BINDINGS))
                units = dict(self._store_connectors(element, inside[name])).items()
                structure.declared.update(
                    {(inside[name], c): (unit, self.units.get(unit)) for c, unit in units if unit}
                )
            elif element.tag == tag("ssd:System"):
                self.read_system(element, inside[name], dictionaries)
            elif element.tag == tag("ssd:SignalDictionaryReference"):  # all references of a dictionary are one element
                dictionary = element.get("dictionary", "")
                if dictionary not in dictionaries:
                    raise SimulationError(f"{name} refers to a signal dictionary {dictionary!r}, which is not there")
                inside[name] = dictionaries[dictionary]
                self._store_reference(element, inside[name])
        for connection in system.iterfind(child_path("ssd:Connections", "ssd:Connection")):
            structure.edges.append(self._edge(connection, parent, inside))

    def _unit(
        self, owner: ElementPath, name: str, unit: str, units: Mapping[str, UnitDefinition] | None = None
    ) -> UnitDefinition | None:
        """Definition of the unit of a connector, None without one; a SimulationError where it has no definition."""
        defined = self.units if units is None else units
        if unit and unit not in defined:
            label = ".".join((*owner, name))
            raise SimulationError(f"{label} has the unit {unit!r}, which has no definition; add it to Units")
        return defined.get(unit)

    def _store_entries(self, dictionary: Element, parent: ElementPath) -> None:
        """Store the entries of a signal dictionary with their units."""
        label, source = dictionary.get("name", ""), dictionary.get("source")
        root = dictionary.find(tag("ssb:SignalDictionary"))
        if source is not None:
            root = self.dictionary_root(source, f"the signal dictionary {label}")
        if root is None:
            return
        owner, units = (*parent, f"[{label}]"), unit_definitions(root, "ssb:Units")
        for entry in root.iter(tag("ssb:DictionaryEntry")):  # some tools write Signals around them
            unit = next((unit for child in entry if (unit := child.get("unit"))), "")
            name = _required(entry, "name")
            self._store_unit(owner, name, self._unit(owner, name, unit, units))

    def _store_reference(self, reference: Element, owner: ElementPath) -> None:
        """Store the units of the connectors of a reference to a signal dictionary."""
        if reference.find(_BINDINGS) is not None:
            words = "the ParameterBinding of the SignalDictionaryReference %s is left out; bind to a component"
            logger.warning(words, reference.get("name"))
        for connector in reference.iterfind(child_path("ssd:Connectors", "ssd:Connector")):
            unit = next((unit for child in connector if (unit := child.get("unit"))), "")
            name = _required(connector, "name")
            self._store_unit(owner, name, self._unit(owner, name, unit))

    def _store_unit(self, owner: ElementPath, name: str, unit: UnitDefinition | None) -> None:
        """Store the unit of an entry of a signal dictionary; a SimulationError for two different ones."""
        known = self.structure.shown.get((owner, name))
        if known is not None and unit is not None and known != unit:
            raise SimulationError(f"{'.'.join((*owner, name))} has two different units; give it one")
        self.structure.shown[owner, name] = unit or known

    def _store_connectors(self, element: Element, element_path: ElementPath) -> list[tuple[str, str]]:
        """Store the kinds of an element's connectors; return their names and units."""
        units_by_name = []
        for connector in element.iterfind(child_path("ssd:Connectors", "ssd:Connector")):
            name = _required(connector, "name")
            self.kinds[element_path, name] = connector.get("kind", "")
            units_by_name.append((name, next((unit for child in connector if (unit := child.get("unit"))), "")))
        return units_by_name

    def _edge(self, connection: Element, parent: ElementPath, inside: dict[str, ElementPath]) -> Edge:
        """Edge of a connection's XML element, in the direction of signal flow."""
        start, end = (_connection_end(connection, role, parent, inside) for role in ("start", "end"))
        kinds = self._is_source(start, parent), self._is_source(end, parent)
        if kinds in {(False, True), (False, None), (None, True)}:
            start, end = end, start  # either end may be called the start
        conversion = SAME
        for child in connection:
            kind = child.tag.rpartition("}")[2]
            if kind == "LinearTransformation":
                conversion = Conversion(float(child.get("factor", 1)), float(child.get("offset", 0)))
            elif kind.endswith("Transformation"):
                raise SimulationError(f"{Edge(start, end)} has a {kind}, which is not done here: let an FMU convert")
        if not all(map(math.isfinite, conversion)):
            raise SimulationError(f"{Edge(start, end)} has a factor or an offset that is no finite number")
        return Edge(start, end, conversion, connection.get("suppressUnitConversion") in {"true", "1"})

    def _is_source(self, pin: Pin, parent: ElementPath) -> bool | None:
        """Whether signals come from a connector, seen from inside the system; None if its kind is unspecified."""
        kind = self.kinds.get((pin.element, pin.connector))
        if kind not in {*_INWARDS, *_OUTWARDS}:
            return None
        return (kind in _INWARDS) == (pin.element == parent)


_INWARDS = ("input", "parameter", "structuralParameter")
_OUTWARDS = ("output", "calculatedParameter")
_BINDINGS = child_path("ssd:ParameterBindings", "ssd:ParameterBinding")
_DICTIONARIES = child_path("ssd:SignalDictionaries", "ssd:SignalDictionary")


def _fmu_path(part: Element, component: ElementPath) -> str:
    """Path of a component's FMU in the archive; a SimulationError for what is no FMU."""
    name, kind, source = ".".join(component), part.get("type", _FMU), part.get("source")
    if kind != _FMU:
        raise SimulationError(f"component {name} is of type {kind!r}; only FMUs ({_FMU}) can be simulated")
    if (implementation := part.get("implementation", "any")) not in _IMPLEMENTATIONS:
        raise SimulationError(
            f"component {name} asks for {implementation}; what is there is {', '.join(_IMPLEMENTATIONS)}"
        )
    if not source:
        raise SimulationError(f"component {name} has no source: a sketch without an FMU cannot be simulated")
    return source


def _connection_end(connection: Element, role: str, parent: ElementPath, inside: dict[str, ElementPath]) -> Pin:
    """Pin at the ``"start"`` or the ``"end"`` of a connection's XML element."""
    element, connector = connection.get(f"{role}Element"), _required(connection, f"{role}Connector")
    index = tuple(map(int, connection.get(f"{role}Indices", "").split()))
    if not element:  # some tools write an empty name for the system itself
        return Pin(parent, connector, index)
    if element not in inside:
        ends = (".".join(filter(None, map(connection.get, (f"{r}Element", f"{r}Connector")))) for r in ("start", "end"))
        words = suggestion(element, inside) or f"; there are {', '.join(inside) or 'none'}"
        raise SimulationError(f"the connection from {' to '.join(ends)}: there is no element {element!r}{words}")
    return Pin(inside[element], connector, index)


def _required(element: Element, attribute: str) -> str:
    """Value of an attribute; a SimulationError if the element has none."""
    value = element.get(attribute)
    if not value:
        raise SimulationError(f"its structure has a {element.tag.rpartition('}')[2]} without {attribute}")
    return value
