"""The faces of a motion: signals, and flanges; and the connectors of flanges."""

import re

from liaisons.language import MechanicalComponent
from liaisons_exchange.modelica_text.text import (
    component_clause,
    filled_lines,
    identifier,
    model_lines,
    number_literal,
    units_of,
)

ROLES = {"m": ("Translation", "s", "f"), "rad": ("Rotation", "phi", "tau")}
_INTERFACES = """\
connector Translation Real s(unit="m"); flow Real f(unit="N"); end Translation;
connector Rotation Real phi(unit="rad"); flow Real tau(unit="N.m"); end Rotation;
connector Generalised Real q; flow Real Q; end Generalised;
model FixedTranslation parameter Real s_0(unit="m") = 0; Translation flange(s=s_0); end FixedTranslation;
model FixedRotation parameter Real phi_0(unit="rad") = 0; Rotation flange(phi=phi_0); end FixedRotation;
"""


def used_interfaces(text: str) -> list[str]:
    """Return lines of the connectors and models that a text uses."""
    return [line for line in _INTERFACES.splitlines() if re.search(rf"\b{line.split()[1]} ", text)]


def interface_models(m: MechanicalComponent) -> list[str]:
    """Return lines of the models ``Signals``, whose inputs prescribe coordinates, and ``Flanges``."""
    unit, size, zero = units_of(m), *(("[n]", "zeros(n)") if m.dimension else ("", "0"))
    points = [port.name for port in m.layout().ports if port.kind == "point"]
    inputs = [f"u_{s.name}[3]{f'(start={{{number_literal(s.start)}, 0, 0}})' * bool(s.start)}" for s in m.actives]
    inputs += [f"{q.name}{end}{size}\0=\0{zero}" for q in m.coordinates for end in ("_force", "_load")]
    inputs += [f"{name}_load{size}\0=\0{zero}" for name in points]
    outer = [f"Q_{q.name}={q.name}_force - {q.name}_load" for q in m.coordinates]
    outer += [f"Q_{name}=-{name}_load" for name in points]
    ports = [(s.name, "", f"{s.name}_force") for s in m.actives]
    ports += [(name, size, f"Q_{name}") for name in (*(q.name for q in m.coordinates), *points)]
    kinds: dict[str, list[str]] = {}
    for name, count, force in ports:
        kind, position, effort = ROLES.get(unit[name], ("Generalised", "q", "Q"))
        kinds.setdefault(kind, []).append(f"flange_{name}{count}({position}={identifier(name)}, {effort}={force})")
    rates = (f"{s.name}_{d}dot = der({identifier(s.name + '_dot' * bool(d))});" for s in m.actives for d in ("", "d"))
    return [
        *model_lines(
            'model Signals "Inputs u_s prescribe value, rate and acceleration of a coordinate s"',
            [f"extends Motion({', '.join(outer)});", *component_clause("input Real", inputs)],
            filled_lines(f"{{{identifier(s.name)}, {s.name}_dot, {s.name}_ddot}} = u_{s.name};" for s in m.actives),
            experiment=m.experiment,
        ),
        *model_lines(
            'model Flanges "Coordinates and points as connectors" extends Motion;',
            [line for kind, names in kinds.items() for line in component_clause(kind, names)],
            filled_lines(rates),
        ),
    ]
