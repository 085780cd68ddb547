"""A system of our own FMUs as one FMU, compiled from the equations of motion of the whole: no coupling error.

It is what a co-simulation of the same system is measured against::

    system = System("double pendulum")
    ...
    whole = simulate(system.flatten(), stop_time=10.0)
    whole["lower.theta"]
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from liaisons.base.arguments import shown
from liaisons.base.compiler import Backend, Fmi, Platforms
from liaisons.base.folders import fmus_directory
from liaisons.base.identifiers import identifier
from liaisons.base.unit_definitions import SAME
from liaisons.composition.models import compose
from liaisons.cosim import System, SystemComponent, SystemDocument
from liaisons.errors import SimulationError
from liaisons.library import Target, component, has_size, is_named, model

if TYPE_CHECKING:
    from liaisons.language import Component
    from liaisons.mechanics import Model


def flatten(
    system: System,
    output: Path | str | None = None,
    *,
    components: Mapping[str, type[Component]] | None = None,
    backend: Backend = "auto",
    platforms: Platforms = "host",
    fmi: Fmi = "2",
    arrays: bool = True,
) -> Path:
    """Build the FMU of a whole system from the equations of motion of our components: no coupling error.

    Its variables have the names of the system's result, ``"swing.theta"``; start values are those of the system.

    :param system: of FMUs of ours.
    :param output: folder; None: ``fmus/flat/``.  The file has the name of the system.
    :param components: components that are not in the catalogue, by the model name of their FMU.
    :param backend: this and the further parameters are those of :func:`liaisons.build`.
    :returns: path of the FMU.
    :raises SimulationError: if an FMU is none of these components.
    :raises ComponentError: if inputs depend on each other in a way that is not linear.
    :raises BuildError: if the FMU cannot be built.
    """
    from liaisons.fmu import build

    return build(
        composed_model(system, components),
        fmus_directory() / "flat" if output is None else output,
        backend=backend,
        platforms=platforms,
        fmi=fmi,
        arrays=arrays,
    )


def composed_model(system: System, components: Mapping[str, type[Component]] | None = None) -> Model:
    """Model of a whole system, with the equations of motion of all parts; errors are those of :func:`flatten`."""
    if not isinstance(system, System):
        raise SimulationError(f"{shown(system)} is not a system; give a System")
    document = system.document.filled()
    parts, connections = document.parts, document.connections
    if converted := [connection for connection in connections if connection.conversion != SAME]:
        raise SimulationError(f"{system.name}: {converted[0]} converts values, which is not flattened; use one unit")
    models = {name: _model_of_part(part, components or {}) for name, part in parts.items()}
    starts = {
        f"{name}.{variable}": value
        for name, part in parts.items()
        for variable, value in _start_values(part, models[name]).items()
    }
    return compose(
        identifier(system.name),
        models,
        {str(c.target): str(c.source) for c in connections if not c.is_impulse},  # contacts give forces
        starts=starts,
    )


def model_of(subject: Target | System, **sizes: object) -> tuple[Model, dict[str, float]]:
    """Model of a component, of a whole system, or of an FMU of ours, with the start values in the FMU.

    :param subject: an FMU by its path.
    :param sizes: structural sizes of a component, where they differ from those declared.
    :raises ProjectError: as :func:`liaisons.derive` does.
    :raises ComponentError: if it cannot be derived.
    :raises SimulationError: as :func:`flatten` does, or if the catalogue does not have the component of an FMU.
    """
    if isinstance(subject, System):
        return composed_model(subject), {}
    if isinstance(subject, type) or Path(subject).suffix != ".fmu":
        return model(component(subject), **sizes), {}
    (part,) = SystemDocument.of_fmu(subject).parts.values()
    derived = _model_of_part(part, {})
    return derived, _start_values(part, derived)


def _model_of_part(part: SystemComponent, components: Mapping[str, type[Component]]) -> Model:
    """Model that a part's FMU was built from; its class is one of ``components``, or has a name."""
    fmu = part.fmu
    if fmu.has_table:
        raise SimulationError(
            f"{part.name}: {fmu.path.name} has its motion in a file, which no other FMU can take over"
        )
    if fmu.model_name not in components and not is_named(fmu.model_name):
        raise SimulationError(
            f"{part.name}: {fmu.path.name} is a {fmu.model_name!r}, which the catalogue does not have; "
            f"flatten(components={{{fmu.model_name!r}: ...}}) takes the class that it was built from"
        )
    class_ = components.get(fmu.model_name) or component(fmu.model_name)
    if class_.is_sampled():
        raise SimulationError(
            f"{part.name}: a {fmu.model_name} reads at communication points, of which equations of a whole system have "
            "none; simulate the system"
        )
    size = fmu.variables.get("n") if has_size(class_) else None
    derived = model(class_, **({"n": int(size.start)} if size and size.start else {})).flat()
    missing = [v.name for v in derived.variables if v.name not in fmu.variables]
    if missing:
        raise SimulationError(
            f"{part.name}: {fmu.path.name} has no variable {missing[0]!r}, which {fmu.model_name} has; "
            "it was built from another component of this name: give that one in flatten(components=...)"
        )
    return derived


def _start_values(part: SystemComponent, derived: Model) -> dict[str, float]:
    """Start values of parameters and inputs by name: those of the system, else those in the FMU."""
    own = part.element_starts
    names = [variable.name for variable in (*derived.parameters, *derived.inputs)]
    starts: dict[str, Any] = {name: own.get(name, part.fmu.variables[name].start) for name in names}
    return {name: float(start) for name, start in starts.items() if start is not None}
