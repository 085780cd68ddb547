"""What a system structure says, nested systems and signal dictionaries dissolved: FMUs, links, bindings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, final
from xml.etree.ElementTree import Element

from liaisons.array_names import Shape
from liaisons.errors import SimulationError
from liaisons.ssp.xml import path, tag

Path = tuple[str, ...]
"""Names of elements from the outermost system, which is (), inwards."""

_FMU = "application/x-fmu-sharedlibrary"
_MOST_COMPONENTS, _LONGEST_WAY = 10_000, 1000  # beyond that reading would take minutes


class Pin(NamedTuple):
    """A connector of an element; indices pick one element of an array."""

    element: Path
    connector: str
    indices: Shape = ()

    def __str__(self) -> str:
        return ".".join((*self.element, self.connector))


@final
@dataclass(frozen=True)
class Structure:
    """A system without its nesting.

    :param sources: component -> where its FMU lies in the archive.
    :param bindings: parameter bindings of components and systems, those that count more behind the others.
    :param edges: connections as they are written.
    :param shown: connectors of systems.
    """

    name: str
    sources: dict[Path, str] = field(default_factory=dict)
    bindings: list[tuple[Path, Element]] = field(default_factory=list)
    edges: list[tuple[Pin, Pin]] = field(default_factory=list)
    shown: set[tuple[Path, str]] = field(default_factory=set)

    def connections(self) -> Iterator[tuple[Pin, Pin]]:
        """From component to component, whatever lies between.

        :raises SimulationError: if an input has several sources, or connections go round without a component.
        """
        into: dict[tuple[Path, str], list[tuple[Pin, Pin]]] = {}
        for start, end in self.edges:
            into.setdefault((end.element, end.connector), []).append((start, end))
        for start, end in self.edges:
            if end.element in self.sources:
                source = self._origin(start, into)
                if source is not None:
                    yield source, end

    def _origin(self, node: Pin, into: dict[tuple[Path, str], list[tuple[Pin, Pin]]]) -> Pin | None:
        """The output of a component that a connector shows; None if nothing is connected with it."""
        seen = {node}
        while node.element not in self.sources:
            edges = [e for e in into.get((node.element, node.connector), ()) if e[1].indices in {(), node.indices}]
            if not edges:
                return None
            if len(edges) > 1:
                raise SimulationError(f"{node} has several sources: {', '.join(str(start) for start, _ in edges)}")
            start, end = edges[0]
            node = start if end.indices or start.indices else start._replace(indices=node.indices)
            if node in seen:
                raise SimulationError(f"the connections of {node} go round in a circle without a component")
            if len(seen) > _LONGEST_WAY:
                raise SimulationError(f"the connections to {node} lead through more than {_LONGEST_WAY} connectors")
            seen.add(node)
        return node

    def meant(self, system: Path, name: str) -> list[tuple[Path, str]]:
        """Components and variables that a parameter of an element stands for; none if it fits nothing."""
        found: dict[tuple[Path, str], None] = {}
        seen: set[tuple[Path, str]] = set()
        waiting = [(system, name)]
        while waiting:
            place = waiting.pop()
            if place in seen:
                continue
            seen.add(place)
            if place[0] in self.sources:
                found[place] = None
            elif place in self.shown:
                waiting += [(end.element, end.connector) for end in reversed(self._shows[place])]
            else:
                waiting += self._inside(*place)
        return list(found)

    def _inside(self, system: Path, name: str) -> list[tuple[Path, str]]:
        """The element of a system that a name with a dot begins with, and the rest of the name."""
        dot = len(name)
        while (dot := name.rfind(".", 0, dot)) > 0:  # the longest name of an element counts
            child = (*system, name[:dot])
            if child in self._parents:
                return [(child, name[dot + 1 :])]
        return []

    @cached_property
    def _shows(self) -> Mapping[tuple[Path, str], list[Pin]]:
        """What the connectors of systems are connected with."""
        found: dict[tuple[Path, str], list[Pin]] = {place: [] for place in self.shown}
        for start, end in self.edges:
            found.get((start.element, start.connector), []).append(end)
        return found

    @cached_property
    def _parents(self) -> set[Path]:
        """The components, and the systems around them."""
        return {place[:depth] for place in self.sources for depth in range(1, len(place) + 1)}


def read_structure(root: Element) -> Structure:
    """Read a system structure description.

    :raises SimulationError: for what cannot be simulated here, by its name.
    """
    system = root.find(tag("ssd:System"))
    if system is None:
        raise SimulationError("its structure has no System")
    structure = Structure(root.get("name") or system.get("name") or "system")
    _read_system(system, (), structure, {})
    structure.bindings.sort(key=lambda binding: -len(binding[0]))  # what is bound further out counts more
    return structure


def _read_system(system: Element, here: Path, structure: Structure, dictionaries: dict[str, Path]) -> None:
    structure.bindings.extend((here, binding) for binding in _bindings(system))
    structure.shown.update((here, name) for name in _connectors(system))
    own = {d.get("name", ""): (*here, f"[{d.get('name')}]") for d in system.iterfind(_DICTIONARIES)}
    dictionaries = dictionaries | own
    inside: dict[str, Path] = {}
    for element in system.iterfind(path("ssd:Elements") + "/*"):
        name = _required(element, "name")
        if name in inside:
            raise SimulationError(f"two elements are called {'.'.join(inside[name])}; a name stands for one")
        inside[name] = (*here, name)
        if element.tag == tag("ssd:Component"):
            structure.sources[inside[name]] = _source(element, inside[name])
            if len(structure.sources) > _MOST_COMPONENTS:
                raise SimulationError(f"its structure has more than {_MOST_COMPONENTS} components; divide it")
            structure.bindings.extend((inside[name], binding) for binding in _bindings(element))
        elif element.tag == tag("ssd:System"):
            _read_system(element, inside[name], structure, dictionaries)
        elif element.tag == tag("ssd:SignalDictionaryReference"):  # all references of a dictionary are one element
            wanted = element.get("dictionary", "")
            if wanted not in dictionaries:
                raise SimulationError(f"{name} refers to a signal dictionary {wanted!r}, which is not there")
            inside[name] = dictionaries[wanted]
    for connection in system.iterfind(path("ssd:Connections", "ssd:Connection")):
        start, end = (_end(connection, role, here, inside) for role in ("start", "end"))
        _check_plain(connection, start, end)
        structure.edges.append((start, end))


_DICTIONARIES = path("ssd:SignalDictionaries", "ssd:SignalDictionary")


def _source(part: Element, here: Path) -> str:
    name, kind, source = ".".join(here), part.get("type", _FMU), part.get("source")
    if kind != _FMU:
        raise SimulationError(f"component {name} is of type {kind!r}; only FMUs ({_FMU}) can be simulated")
    if part.get("implementation", "any") not in {"any", "CoSimulation"}:
        wanted = part.get("implementation")
        raise SimulationError(f"component {name} asks for {wanted}; only co-simulation is there: export it for that")
    if not source:
        raise SimulationError(f"component {name} has no source: a sketch without an FMU cannot be simulated")
    return source


def _end(connection: Element, role: str, here: Path, inside: dict[str, Path]) -> Pin:
    element, connector = connection.get(f"{role}Element"), _required(connection, f"{role}Connector")
    index = tuple(map(int, connection.get(f"{role}Indices", "").split()))
    if not element:  # some tools write an empty name for the system itself
        return Pin(here, connector, index)
    if element not in inside:
        raise SimulationError(f"a connection names {element}.{connector}, but there is no element {element!r}")
    return Pin(inside[element], connector, index)


def _check_plain(connection: Element, start: Pin, end: Pin) -> None:
    for child in connection:
        kind = child.tag.rpartition("}")[2]
        identity = float(child.get("factor", 1)) == 1.0 and float(child.get("offset", 0)) == 0.0
        if kind.endswith("Transformation") and not (kind == "LinearTransformation" and identity):
            raise SimulationError(
                f"the connection from {start} to {end} has a {kind}, which is not done here: let an FMU convert"
            )


def _bindings(element: Element) -> list[Element]:
    return element.findall(path("ssd:ParameterBindings", "ssd:ParameterBinding"))


def _connectors(element: Element) -> list[str]:
    return [_required(c, "name") for c in element.iterfind(path("ssd:Connectors", "ssd:Connector"))]


def _required(element: Element, attribute: str) -> str:
    value = element.get(attribute)
    if not value:
        raise SimulationError(f"its structure has a {element.tag.rpartition('}')[2]} without {attribute}")
    return value
