"""Packages: one component, a system with its components, or a library."""

from collections.abc import Collection, Iterable

from liaisons import Chain
from liaisons.language import Component, Mechanism, Operator
from liaisons_exchange.modelica_text.annotations import annotation
from liaisons_exchange.modelica_text.chains import chain_motion_model
from liaisons_exchange.modelica_text.faces import interface_models, used_interfaces
from liaisons_exchange.modelica_text.mechanisms import motion_model
from liaisons_exchange.modelica_text.operators import operator_classes
from liaisons_exchange.modelica_text.systems import Composition, experiment_model, system_model
from liaisons_exchange.modelica_text.text import indented_lines, string_literal

_ORIGIN = "Written from Lagrangians"


def component_text(component: type[Component]) -> str:
    """Return a package of the component's name, with the models ``Motion``, ``Signals`` and ``Flanges``."""
    return _standalone_text(_component(component))


def system_text(system: Composition) -> str:
    """Return a package with the components of a system, and the model of the system."""
    components = dict.fromkeys(component for component, _ in system.parts.values())
    lines = [line for component in components for line in _component(component)]
    return _standalone_text(_package(f"{system.name}System", _ORIGIN, [*lines, *system_model(system)]))


def library_text(components: Collection[type[Component]], systems: Iterable[Composition] = ()) -> str:
    """Return the package ``Liaisons`` of components, with default experiments and systems as ``Examples``."""
    examples = [line for component in components for line in experiment_model(component, "Liaisons.")]
    examples += [line for system in systems for line in system_model(system, "Liaisons.")]
    lines = [line for component in components for line in _component(component)]
    lines += _package("Examples", "Default experiments, and systems", examples)
    return _standalone_text(_package("Liaisons", _ORIGIN, lines))


def _standalone_text(package: list[str]) -> str:
    """Return the text of a package, to which the connectors that it uses are added."""
    head, *body = package
    return "\n".join([head, *indented_lines(used_interfaces(str(body))), *body, ""])


def _component(component: type[Component]) -> list[str]:
    """Return the lines of the package of a component."""
    component.refuse_samples("Modelica text", "import its FMU")
    if issubclass(component, Operator):
        classes = operator_classes(component)
    else:
        assert issubclass(component, Chain | Mechanism)
        moving = chain_motion_model(component) if issubclass(component, Chain) else motion_model(component)
        classes = [*moving, *interface_models(component())]
    return _package(component.__name__, component.summary(), [*classes, annotation(component)])


def _package(name: str, text: str, lines: Iterable[str]) -> list[str]:
    """Return the lines of a package."""
    return [f"package {name} {string_literal(text)}", *indented_lines(lines), f"end {name};"]
