"""Packages: one component, a system with its components, or a library."""

from collections.abc import Collection, Iterable

from liaisons.language import Chain, Mechanism, Operator
from liaisons.language.component import Component
from liaisons.mechanics.model import refuse_samples
from liaisons.modelica_text.annotations import annotation
from liaisons.modelica_text.chains import chain_motion_model
from liaisons.modelica_text.faces import interface_models, used_interfaces
from liaisons.modelica_text.mechanisms import motion_model
from liaisons.modelica_text.operators import operator_classes
from liaisons.modelica_text.systems import Composition, experiment_model, system_model
from liaisons.modelica_text.text import indented_lines, string_literal


def component_text(component: type[Component]) -> str:
    """Return a package of the component's name, with the models ``Motion``, ``Signals`` and ``Flanges``."""
    return "\n".join(_component(component, alone=True))


def system_text(system: Composition) -> str:
    """Return a package with the components of a system, and the model of the system."""
    components = dict.fromkeys(component for component, _ in system.parts.values())
    return _standalone_package(f"{system.name}System", components, system_model(system))


def library_text(components: Collection[type[Component]], systems: Iterable[Composition] = ()) -> str:
    """Return the package ``Liaisons`` of components, with default experiments and systems as ``Examples``."""
    examples = [line for component in components for line in experiment_model(component, "Liaisons.")]
    examples += [line for system in systems for line in system_model(system, "Liaisons.")]
    return _standalone_package(
        "Liaisons", components, _package("Examples", "Default experiments, and systems", examples)
    )


def _standalone_package(name: str, components: Iterable[type[Component]], lines: list[str]) -> str:
    """Return the text of a package with components, further lines, and the connectors that they use."""
    inside = [*(line for component in components for line in _component(component)), *lines]
    return "\n".join(_package(name, "Written from Lagrangians", inside, alone=True))


def _component(component: type[Component], *, alone: bool = False) -> list[str]:
    """Return the lines of the package of a component."""
    refuse_samples(component, "Modelica text", "import its FMU")
    if issubclass(component, Operator):
        classes = operator_classes(component)
    else:
        assert issubclass(component, Chain | Mechanism)
        moving = chain_motion_model(component) if issubclass(component, Chain) else motion_model(component)
        classes = [*moving, *interface_models(component())]
    return _package(component.__name__, component.summary(), [*classes, annotation(component)], alone=alone)


def _package(name: str, text: str, lines: list[str], *, alone: bool = False) -> list[str]:
    """Return the lines of a package.

    :param alone: whether it contains the connectors that it uses, and ends with a line end.
    """
    lines = [*used_interfaces(str(lines)), *lines] if alone else lines
    return [f"package {name} {string_literal(text)}", *indented_lines(lines), f"end {name};", *[""] * alone]
