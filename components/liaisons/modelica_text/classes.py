"""Packages: one component, a system with its components, or a library."""

from collections.abc import Collection, Iterable

from liaisons.language import Chain, Mechanism, Operator
from liaisons.language.component import Component
from liaisons.mechanics.model import refuse_samples
from liaisons.modelica_text.annotations import annotation
from liaisons.modelica_text.chains import chain_motion
from liaisons.modelica_text.faces import interface_models, interfaces
from liaisons.modelica_text.mechanisms import motion
from liaisons.modelica_text.operators import operator_classes
from liaisons.modelica_text.systems import Composition, composition, default_experiment
from liaisons.modelica_text.text import indented, quoted


def component_text(component: type[Component]) -> str:
    """Return a package of the component's name, with the models ``Motion``, ``Signals`` and ``Flanges``."""
    return "\n".join(_component(component, alone=True))


def system_text(whole: Composition) -> str:
    """Return a package with the components of a system, and the model of the system."""
    components = dict.fromkeys(component for component, _ in whole.parts.values())
    return _library(f"{whole.name}System", components, composition(whole))


def library_text(components: Collection[type[Component]], systems: Iterable[Composition] = ()) -> str:
    """Return the package ``Liaisons``: components, and as ``Examples`` default experiments and some systems."""
    examples = [line for component in components for line in default_experiment(component, "Liaisons.")]
    examples += [line for whole in systems for line in composition(whole, "Liaisons.")]
    return _library("Liaisons", components, _package("Examples", "Default experiments, and systems", examples))


def _library(name: str, components: Iterable[type[Component]], lines: list[str]) -> str:
    """Return a package that stands alone, with components and further lines."""
    inside = [*(line for component in components for line in _component(component)), *lines]
    return "\n".join(_package(name, "Written from Lagrangians", inside, alone=True))


def _component(component: type[Component], *, alone: bool = False) -> list[str]:
    """Return the lines of the package of a component."""
    refuse_samples(component, "Modelica text", "import its FMU")
    if issubclass(component, Operator):
        classes = operator_classes(component)
    else:
        assert issubclass(component, Chain | Mechanism)
        moving = chain_motion(component) if issubclass(component, Chain) else motion(component)
        classes = [*moving, *interface_models(component())]
    return _package(component.__name__, component.summary(), [*classes, annotation(component)], alone=alone)


def _package(name: str, text: str, lines: list[str], *, alone: bool = False) -> list[str]:
    """Return the lines of a package; one that stands alone has its connectors, and a line end."""
    lines = [*interfaces(str(lines)), *lines] if alone else lines
    return [f"package {name} {quoted(text)}", *indented(lines), f"end {name};", *[""] * alone]
