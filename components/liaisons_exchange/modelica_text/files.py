"""Modelica text of components by their names, and of systems."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from liaisons.base.identifiers import identifier
from liaisons.base.unit_definitions import SAME
from liaisons.cosim import System
from liaisons.errors import SimulationError
from liaisons.language import Experiment, Mechanism
from liaisons.library import Target, components, is_named
from liaisons_exchange.modelica_text.classes import component_text, library_text, system_text
from liaisons_exchange.modelica_text.standard_library import with_standard_library
from liaisons_exchange.modelica_text.systems import Composition

if TYPE_CHECKING:
    from liaisons.language import Component

_MOTOR = {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 6.26}
_EXAMPLES = {
    "PumpedSwing": (
        {"swing": ("Pendulum", {"theta_0": 0.05}), "motor": ("Sinusoid", _MOTOR)},
        {"swing.length": "motor.y"},
    ),
    "CoupledPendulums": (
        {"upper": ("Pendulum", {"theta_0": 0.5}), "lower": ("Pendulum", {"theta_0": -0.3})},
        {"lower.pivot_x": "upper.bob_x", "lower.pivot_z": "upper.bob_z"},
    ),
    "ClosedLoopSwing": (
        {"swing": ("Pendulum", {}), "pump": ("SwingPump", {})},
        {"swing.length": "pump.y", "pump.theta": "swing.theta", "pump.theta_dot": "swing.theta_dot"},
    ),
}


def modelica(subject: Target | System, /, *, standard_library: bool = False) -> str:
    """Return the Modelica text of a component, of all components, or of a system, as a package without dependencies.

    A component is a package of its name.  ``Motion`` has the equations; ``Signals`` takes value, rate and acceleration
    of each active coordinate ``s`` as the input ``u_s[3]``; ``Flanges`` has connectors like those of the Modelica
    Standard Library.  A system is a model of its components with ``connect``.

    :param subject: name, file or class of a component; ``"all"`` for the package ``Liaisons`` with all of them that
        have no unilateral liaisons, and ``Examples``; or a system of components of the catalogue.
    :param standard_library: with flanges and types of units of the Modelica Standard Library, instead of alone.
    :raises ProjectError: if it names no component.
    :raises ComponentError: if a component cannot be derived, or a connection cannot be said in Modelica.
    :raises SimulationError: if a part of a system is no component of the catalogue, or reads a file.
    """
    if isinstance(subject, System):
        text = system_text(_composition(subject))
    else:
        chosen = components(subject)
        text = component_text(chosen[0]) if len(chosen) == 1 else modelica_library(chosen)
    return with_standard_library(text) if standard_library else text


def _composition(subject: System) -> Composition:
    """Return components, start values and connections of a system, for its Modelica text."""
    parts = subject.filled()
    for part in parts.values():
        if not is_named(part.fmu.model_name) or part.fmu.has_table:
            raise SimulationError(
                f"{part.name}: {part.fmu.path.name} is a {part.fmu.model_name!r}; a system in Modelica is made of the "
                "catalogue's components, with their motion in parameters"
            )
    for connection in subject.connections:
        if connection.conversion != SAME:
            raise SimulationError(f"{subject.name}: {connection} converts values; use one unit in Modelica")
    chosen = {name: (components(part.fmu.model_name)[0], part.starts) for name, part in parts.items()}
    connections = {str(connection.target): str(connection.source) for connection in subject.connections}
    longest = max((component.experiment for component, _ in chosen.values()), key=lambda e: e.stop_time)
    return Composition(identifier(subject.name), chosen, connections, longest)


def modelica_library(chosen: Collection[type[Component]], *, standard_library: bool = False) -> str:
    """Return the Modelica package ``Liaisons``: components, and ``Examples``, default experiments and some systems.

    Mechanisms with arrays, and components that read samples, are left out.
    """
    chosen = [c for c in chosen if not (c.is_sampled() or (issubclass(c, Mechanism) and c().layout().dimensions))]
    classes = {component.__name__: component for component in chosen}
    systems = [
        Composition(name, {n: (classes[c], starts) for n, (c, starts) in parts.items()}, joined, Experiment(5.0))
        for name, (parts, joined) in _EXAMPLES.items()
        if {component for component, _ in parts.values()} <= classes.keys()
    ]
    text = library_text(chosen, systems)
    return with_standard_library(text) if standard_library else text
