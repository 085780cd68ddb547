"""The faces of a motion: signals, and flanges."""

from __future__ import annotations

import re

from liaisons.language import Experiment
from liaisons.language.mechanical import MechanicalComponent
from liaisons.modelica_text.text import declared, filled, indented, number, packed

_ROLES = {"m": ("Translation", "s", "f"), "rad": ("Rotation", "phi", "tau")}
_INTERFACES = """\
connector Translation Real s(unit="m"); flow Real f(unit="N"); end Translation;
connector Rotation Real phi(unit="rad"); flow Real tau(unit="N.m"); end Rotation;
connector Generalised Real q; flow Real Q; end Generalised;
model FixedTranslation parameter Real s_0(unit="m") = 0; Translation flange(s=s_0); end FixedTranslation;
model FixedRotation parameter Real phi_0(unit="rad") = 0; Rotation flange(phi=phi_0); end FixedRotation;
"""


def interfaces(text: str) -> list[str]:
    """Connectors that a text uses."""
    return [line for line in _INTERFACES.splitlines() if re.search(rf"\b{line.split()[1]} ", text)]


def experiment(e: Experiment) -> str:
    """Annotation of a default experiment."""
    values = f"StopTime={number(e.stop_time)}, Interval={number(e.step_size)}, Tolerance={number(e.tolerance)}"
    return f"annotation(experiment({values}));"


def signals(m: MechanicalComponent, points: list[str]) -> list[str]:
    """Lines of the model ``Signals``: coordinates are prescribed by inputs."""
    size = "[n]" if m.dimension else ""
    inputs = [f"u_{s.name}[3]{f'(start={{{number(s.start)}, 0, 0}})' if s.start else ''}" for s in m.actives]
    zero = " = zeros(n)" if m.dimension else " = 0"
    inputs += [f"{q.name}{end}{size}{zero}" for q in m.coordinates for end in ("_force", "_load")]
    inputs += [f"{name}_load{size}{zero}" for name in points]
    outer = [f"Q_{q.name}={q.name}_force - {q.name}_load" for q in m.coordinates]
    outer += [f"Q_{name}=-{name}_load" for name in points]
    prescribed = filled(f"{{{s.name}, {s.name}_dot, {s.name}_ddot}} = u_{s.name};" for s in m.actives)
    return [
        'model Signals "Inputs u_s prescribe value, rate and acceleration of a coordinate s"',
        *indented(packed([f"extends Motion({outer[0]}", *outer[1:]], ", ", ");") if outer else ["extends Motion;"]),
        *indented(declared(*inputs, head="input Real")),
        *(["equation", *indented(prescribed)] if prescribed else []),
        f"  {experiment(m.experiment)}",
        "end Signals;",
    ]


def flanges(m: MechanicalComponent, points: dict[str, str]) -> list[str]:
    """Lines of the model ``Flanges``: coordinates are connectors.

    :param points: units of the components of points.
    """
    ports = [(s.name, s.unit, f"{s.name}_force") for s in m.actives]
    ports += [(q.name, q.unit, f"Q_{q.name}") for q in m.coordinates]
    ports += [(name, unit, f"Q_{name}") for name, unit in points.items()]
    kinds: dict[str, list[str]] = {}
    for name, unit, force in ports:
        kind, position, effort = _ROLES.get(unit, ("Generalised", "q", "Q"))
        size = "[n]" if m.dimension and force == f"Q_{name}" else ""
        kinds.setdefault(kind, []).append(f"flange_{name}{size}({position}={name}, {effort}={force})")
    rates = (f"{s.name}_{d}dot = der({s.name}{'_dot' if d else ''});" for s in m.actives for d in ("", "d"))
    return [
        'model Flanges "Coordinates and points as connectors" extends Motion;',
        *(line for kind, names in kinds.items() for line in indented(declared(*names, head=kind))),
        *(["equation", *indented(filled(rates))] if m.actives else []),
        "end Flanges;",
    ]
