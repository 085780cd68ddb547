"""Packages: one component, a system with its components, or a library."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from liaisons.language import Chain, Mechanism, Operator
from liaisons.language.component import Component
from liaisons.mechanics import assemble
from liaisons.modelica_text.annotations import annotation
from liaisons.modelica_text.chains import chain_motion
from liaisons.modelica_text.faces import flanges, interfaces, signals
from liaisons.modelica_text.mechanisms import motion
from liaisons.modelica_text.operators import operator_classes
from liaisons.modelica_text.systems import Composition, composition_lines, default_experiment
from liaisons.modelica_text.text import indented, quoted

LIBRARY = "Liaisons"


def component_text(component: type[Component]) -> str:
    """A package of the component's name, with the models ``Motion``, ``Signals`` and ``Flanges``."""
    head, *lines = _package(component)
    return _text([head, *indented(interfaces("\n".join(lines))), *lines])


def system_text(whole: Composition) -> str:
    """A package with the components of a system, and the model of the system."""
    components = {component.__name__: component for component, _ in whole.parts.values()}
    lines = composition_lines(whole)
    return _text(_library(f"{whole.name}System", whole.name, components.values(), lines))


def library_text(components: Iterable[type[Component]], systems: Sequence[Composition] = ()) -> str:
    """The package ``Liaisons`` with components, and their default experiments and some systems as ``Examples``."""
    chosen = list(components)
    examples = [line for c in chosen for line in default_experiment(c, f"{LIBRARY}.")]
    examples += [line for whole in systems for line in composition_lines(whole, f"{LIBRARY}.")]
    inner = ['package Examples "Default experiments, and systems"', *indented(examples), "end Examples;"]
    return _text(_library(LIBRARY, "Components that were written from their Lagrangians", chosen, inner))


def _library(name: str, summary: str, components: Iterable[type[Component]], lines: list[str]) -> list[str]:
    inside = [line for component in components for line in _package(component)] + lines
    return [
        f"package {name} {quoted(summary)}",
        *indented([*interfaces("\n".join(inside)), *inside]),
        f"end {name};",
    ]


def _text(lines: Iterable[str]) -> str:
    return "\n".join([*lines, ""])


def _package(component: type[Component]) -> list[str]:
    name = component.__name__
    classes = operator_classes(component) if issubclass(component, Operator) else _mechanical(component)
    return [
        f"package {name} {quoted(component.summary())}",
        *indented([*classes, *annotation(component)]),
        f"end {name};",
    ]


def _mechanical(component: type[Component]) -> list[str]:
    assert issubclass(component, Chain | Mechanism)
    model, m = assemble(component), component()
    unit_of = {v.name: v.unit for v in model.variables}
    points = {port.name: unit_of[port.name] for port in model.ports if port.kind == "point"}
    moving = chain_motion(component) if issubclass(component, Chain) else motion(component)
    return [*moving, *signals(m, list(points)), *flanges(m, points)]
