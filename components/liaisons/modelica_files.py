"""Modelica text of components by their names, and of systems."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from liaisons.cosim import System
from liaisons.cosim.description.model_description import SAME
from liaisons.errors import SimulationError
from liaisons.flattening import identifier
from liaisons.library import Target, catalogue, components
from liaisons.ssp import has_table

if TYPE_CHECKING:
    from liaisons.cosim import SystemComponent
    from liaisons.language import Component
    from liaisons.modelica_text import Composition


def modelica(subject: Target | System, /) -> str:
    """Modelica text of a component, of several, or of a system: a package that stands alone.

    A component is a package of its name.  ``Motion`` has the equations; ``Signals`` takes value, rate and acceleration
    of each active coordinate ``s`` as the input ``u_s[3]``; ``Flanges`` has connectors like those of the Modelica
    Standard Library.  A system is a model of its components with ``connect``.

    :param subject: name, file or class of a component; ``"all"`` for the package ``Liaisons`` with all of them and
        ``Examples``; or a system of components of the catalogue.
    :raises ProjectError: if it names no component.
    :raises ComponentError: if a component cannot be derived, or a connection cannot be said in Modelica.
    :raises SimulationError: if a part of a system is no component of the catalogue, or reads a file.
    """
    from liaisons.modelica_text import component_text, system_text

    if isinstance(subject, System):
        return system_text(_composition(subject))
    chosen = components(subject)
    return component_text(chosen[0]) if len(chosen) == 1 else modelica_library(chosen)


def modelica_library(chosen: Iterable[type[Component]]) -> str:
    """Text of the package ``Liaisons``: components, and as ``Examples`` their default experiments and some systems."""
    from liaisons.modelica_text import library_text

    chosen = list(chosen)
    return library_text(chosen, [e for e in _examples() if all(c in chosen for c, _ in e.parts.values())])


def _examples() -> list[Composition]:
    from liaisons.language import Experiment
    from liaisons.modelica_text import Composition

    classes = catalogue()
    swing = (classes["Pendulum"], {"theta_0": 0.05})
    motor = (classes["Sinusoid"], {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 6.26})
    pumped = {("swing", f"length{end}"): ("motor", f"y{end}") for end in ("", "_dot", "_ddot")}
    hung = {("lower", f"pivot_{a}{end}"): ("upper", f"bob_{a}{end}") for a in "xz" for end in ("", "_dot", "_ddot")}
    watched = {("swing", f"length{end}"): ("pump", f"y{end}") for end in ("", "_dot", "_ddot")}
    watched |= {("pump", name): ("swing", name) for name in ("theta", "theta_dot")}
    pair = {"upper": (classes["Pendulum"], {"theta_0": 0.5}), "lower": (classes["Pendulum"], {"theta_0": -0.3})}
    return [
        Composition("PumpedSwing", {"swing": swing, "motor": motor}, pumped, Experiment(20.0, 0.02)),
        Composition("CoupledPendulums", pair, hung, Experiment(5.0, 0.01)),
        Composition("ClosedLoopSwing", {"swing": swing, "pump": (classes["SwingPump"], {})}, watched, Experiment()),
    ]


def _composition(system: System) -> Composition:
    from liaisons.language import Experiment
    from liaisons.modelica_text import Composition

    if converted := [connection for connection in system.connections if connection.conversion != SAME]:
        raise SimulationError(f"{system.name}: {converted[0]} converts values, which is not said in Modelica")
    parts = {name: _part(part) for name, part in system.filled().items()}
    connections = {(c.target.part.name, c.target.name): (c.source.part.name, c.source.name) for c in system.connections}
    stop, step = system.experiment.stop_time, system.experiment.step_size
    lasting = max((component.experiment for component, _ in parts.values()), key=lambda e: e.stop_time)
    experiment = Experiment(stop, step) if stop and step else lasting
    return Composition(identifier(system.name), parts, connections, experiment)


def _part(part: SystemComponent) -> tuple[type[Component], Mapping[str, Any]]:
    """Component and start values of a part."""
    classes = catalogue()
    if part.fmu.model_name not in classes or has_table(part.fmu.path):
        raise SimulationError(
            f"{part.name}: {part.fmu.path.name} is a {part.fmu.model_name!r}; a system in Modelica is made of the "
            "catalogue's components, with their motion in parameters"
        )
    return classes[part.fmu.model_name], part.starts
