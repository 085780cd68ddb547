"""Systems: components whose flanges are connected."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

from liaisons.errors import ComponentError
from liaisons.language import Component, Experiment, Operator
from liaisons_exchange.modelica_text.text import model_lines, modification, number_literal

Starts = Mapping[str, Any]


@final
@dataclass(frozen=True)
class Composition:
    """Components with start values by the names of parts, and connections: ``{"swing.length": "motor.y"}``."""

    name: str
    parts: Mapping[str, tuple[type[Component], Starts]]
    connections: Mapping[str, str]
    experiment: Experiment


def system_model(system: Composition, prefix: str = "") -> list[str]:
    """Return lines of the model of a system.

    :param prefix: of the names of their classes.
    :raises ComponentError: if a connection is none of coordinates, points, signals and inputs of operators.
    """
    sources, faces = dict(system.connections), dict[str, str]()
    fixed, joined, parts = list[str](), list[str](), list[str]()
    for part, (component, starts) in system.parts.items():
        for s in getattr(component, "actives", ()):
            kind, at = ("Rotation", "phi_0") if s.unit == "rad" else ("Translation", "s_0")
            own = f"{part}.{s.name}"
            source, *_ = (sources.pop(f"{own}{end}", "") for end in ("", "_dot", "_ddot"))
            other, _, name = source.partition(".")
            sources.pop(f"{source}_load", "")
            if not source:
                fixed.append(
                    f"{prefix}Fixed{kind} {part}_{s.name}({at}={number_literal(starts.get(s.name, s.start))});"
                )
                flange = f"{part}_{s.name}.flange"
            elif not issubclass(system.parts[other][0], Operator):
                flange = f"{other}.flange_{name}"
            elif faces.setdefault(other, f"{kind}al") == f"{kind}al":
                flange = f"{other}.flange"
            else:
                raise ComponentError(f"{system.name}: {other} moves coordinates of two kinds; use an operator for each")
            joined.append(f"connect({flange}, {part}.flange_{s.name});")
    for part, (component, starts) in system.parts.items():
        values = {p.name: number_literal(starts[p.name]) for p in component().layout().parameters if p.name in starts}
        inputs = (item.name for item in getattr(component, "inputs", ()))
        values |= {name: sources.pop(f"{part}.{name}") for name in inputs if f"{part}.{name}" in sources}
        face = faces.get(part, "Signals") if issubclass(component, Operator) else "Flanges"
        parts.append(f"{prefix}{component.__name__}.{face} {part}({modification(values)});")
    if sources:
        target, source = sources.popitem()
        reason = "connects no flanges, and is not said in Modelica"
        if target.endswith("_impulse"):
            reason = "hands impulses on, which flanges do not; import the FMU that flatten() makes"
        raise ComponentError(f"{system.name}: {source} -> {target} {reason}")
    return model_lines(f"model {system.name}", [*parts, *fixed], joined, experiment=system.experiment)


def experiment_model(component: type[Component], prefix: str = "") -> list[str]:
    """Return lines of a model in which prescribed coordinates move at constant acceleration."""
    e, layout = component.experiment, component().layout()
    starts = {v.name: v.starts[0] for v in layout.inputs} | dict(e.reference)
    values = {name: number_literal(value) for name, value in e.reference.items()}
    for triple in layout.active:
        for name in triple:
            values.pop(name, None)
        s, v, a = (f"({number_literal(starts[name])})" for name in triple)
        values[f"u_{triple.value}"] = f"{{{s} + {v}*time + {a}/2*time^2, {v} + {a}*time, {a}}}"
    name = component.__name__
    part = f"{prefix}{name}.Signals signals({modification(values)});"
    return model_lines(f'model {name} "Default experiment"', [part], [], experiment=e)
