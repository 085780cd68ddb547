"""Systems: components, and flanges that are connected."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import final

from liaisons.errors import ComponentError
from liaisons.language import Experiment, Operator
from liaisons.language.component import Component
from liaisons.language.mechanical import MechanicalComponent
from liaisons.modelica_text.faces import experiment
from liaisons.modelica_text.text import indented, number, quoted

Starts = Mapping[str, float | tuple[float, ...]]
Variable = tuple[str, str]  # part, name


@final
@dataclass(frozen=True)
class Composition:
    """Components with start values, and the inputs that are connected.

    :param parts: component and start values by the name of the part.
    :param connections: (part, input) by (part, output).
    """

    name: str
    parts: Mapping[str, tuple[type[Component], Starts]]
    connections: Mapping[Variable, Variable]
    experiment: Experiment


def composition_lines(whole: Composition, prefix: str = "") -> list[str]:
    """Lines of a model of the parts.

    :param prefix: of the names of their classes.
    :raises ComponentError: if a connection is none of coordinates, points, signals and inputs of operators.
    """
    feeding = dict(whole.connections)
    joined: list[str] = []
    held: list[str] = []
    kinds: dict[str, str] = {}
    for part, (component, starts) in whole.parts.items():
        if not issubclass(component, MechanicalComponent):
            continue
        for s in component.actives:
            feeding.pop((part, f"{s.name}_dot"), None)
            feeding.pop((part, f"{s.name}_ddot"), None)
            source = feeding.pop((part, s.name), None)
            kind = "Rotational" if s.unit == "rad" else "Translational"
            if source is None:
                at = starts.get(s.name, s.start)
                assert isinstance(at, float | int)
                fixed, at_start = ("FixedRotation", "phi_0") if s.unit == "rad" else ("FixedTranslation", "s_0")
                held.append(f"{prefix}{fixed} {part}_{s.name}({at_start}={number(at)});")
                joined.append(f"connect({part}_{s.name}.flange, {part}.flange_{s.name});")
                continue
            other, name = source
            feeding.pop((other, f"{name}_load"), None)
            if issubclass(whole.parts[other][0], Operator):
                if kinds.setdefault(other, kind) != kind:
                    raise ComponentError(f"{whole.name}: {other} moves coordinates of two kinds; use one operator each")
                joined.append(f"connect({other}.flange, {part}.flange_{s.name});")
            else:
                joined.append(f"connect({other}.flange_{name}, {part}.flange_{s.name});")
    lines = [*_parts(whole, feeding, kinds, prefix), *held]
    if feeding:
        (part, name), source = next(iter(feeding.items()))
        raise ComponentError(f"{whole.name}: {'.'.join(source)} -> {part}.{name} cannot be said in Modelica")
    return [
        f"model {whole.name} {quoted(', '.join(f'{p}: {c.__name__}' for p, (c, _) in whole.parts.items()))}",
        *indented(lines),
        "equation",
        *indented(joined),
        f"  {experiment(whole.experiment)}",
        f"end {whole.name};",
    ]


def _parts(
    whole: Composition, feeding: dict[Variable, Variable], kinds: Mapping[str, str], prefix: str
) -> Iterator[str]:
    for part, (component, starts) in whole.parts.items():
        actives = [s.name for s in component.actives] if issubclass(component, MechanicalComponent) else []
        prescribed = {f"{s}{end}" for s in actives for end in ("", "_dot", "_ddot")}
        modified = {name: _literal(value) for name, value in starts.items() if name not in prescribed}
        for item in component.inputs if issubclass(component, Operator) else ():
            if source := feeding.pop((part, item.name), None):
                modified[item.name] = ".".join(source)
        face = kinds.get(part, "Signals") if issubclass(component, Operator) else "Flanges"
        values = ", ".join(f"{name}={value}" for name, value in modified.items())
        yield f"{prefix}{component.__name__}.{face} {part}{f'({values})' if values else ''};"


def _literal(value: float | tuple[float, ...]) -> str:
    return f"{{{', '.join(map(number, value))}}}" if isinstance(value, tuple) else number(value)


def default_experiment(component: type[Component], prefix: str = "") -> list[str]:
    """Lines of a model of the default experiment: a prescribed coordinate moves by its start, rate and acceleration."""
    e, m = component.experiment, component()
    modified = {}
    layout = m.layout()
    starts = {v.name: v.start for v in (*layout.parameters, *layout.inputs) if isinstance(v.start, float | int)}
    starts |= e.reference
    for triple in layout.active:
        s, v, a = (number(starts.get(name) or 0.0) for name in (triple.value, triple.rate, triple.acceleration))
        s, v, a = (f"({x})" if x.startswith("-") else x for x in (s, v, a))
        modified[f"u_{triple.value}"] = f"{{{s} + {v}*time + {a}/2*time^2, {v} + {a}*time, {a}}}"
    prescribed = {name for t in layout.active for name in (t.value, t.rate, t.acceleration)}
    modified |= {name: number(value) for name, value in e.reference.items() if name not in prescribed}
    values = ", ".join(f"{name}={value}" for name, value in modified.items())
    name = component.__name__
    return [
        f'model {name} "Default experiment"',
        f"  {prefix}{name}.Signals signals{f'({values})' if values else ''};",
        f"  {experiment(e)}",
        f"end {name};",
    ]
