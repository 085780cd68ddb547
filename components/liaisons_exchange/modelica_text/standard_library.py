"""Text that uses the Modelica Standard Library: its flanges, and its types in the place of units."""

import re

from liaisons_exchange.modelica_text.text import STRING, filled_lines

TYPES = {
    "m": "Position",
    "m/s": "Velocity",
    "m/s2": "Acceleration",
    "rad": "Angle",
    "rad/s": "AngularVelocity",
    "rad/s2": "AngularAcceleration",
    "m2": "Area",
    "s": "Time",
    "kg": "Mass",
    "kg.m2": "MomentOfInertia",
    "kg.m/s": "Momentum",
    "kg.m2/s": "AngularMomentum",
    "N": "Force",
    "N.m": "Torque",
    "N/m": "TranslationalSpringConstant",
    "J": "Energy",
    "C": "ElectricCharge",
    "T": "MagneticFluxDensity",
    "V/m": "ElectricFieldStrength",
}
_OWN = re.compile(r"^ *connector (?:Translation|Rotation) .*\n", re.MULTILINE)
_FLANGE = re.compile(r"\b(Translation|Rotation)(?= flange)")
_DECLARATION = re.compile(rf'^( *)((?:parameter |input )?)(Real|Modelica\S+) ((?:{STRING}|[^";])*);', re.MULTILINE)
_TOKEN = re.compile(rf"{STRING}|\n *|.")
_UNIT = re.compile(r'([^("]+)\(unit="([^"]+)"(?:, )?(.*)')


def with_standard_library(text: str) -> str:
    """Return the text of a package with the connectors and types of the Modelica Standard Library 4."""
    head, body = _FLANGE.sub(r"Modelica.Mechanics.\1al.Interfaces.Flange_a", _OWN.sub("", text)).split("\n", 1)
    return f"{head}\n  import Modelica.Units.SI;\n{_DECLARATION.sub(_typed_declarations, body)}"


def _typed_declarations(declaration: re.Match[str]) -> str:
    """Split a declaration of variables with units into one declaration for each type of the library."""
    indentation, prefix, kind, listed = declaration.groups()
    variables, depth = [""], 0
    for token in _TOKEN.findall(listed):
        depth += (token in "({[") - (token in ")}]")
        if token == "," and not depth:
            variables.append("")
        else:
            variables[-1] += re.sub(r"\n *", " ", token)
    groups: dict[str, list[str]] = {}
    for variable in map(str.strip, variables):
        match = _UNIT.fullmatch(variable)
        if match and match[2] in TYPES:
            name = "Length" if prefix == "parameter " and match[2] == "m" else TYPES[match[2]]
            groups.setdefault(f"SI.{name}", []).append(f"{match[1]}({match[3]}".replace("()", "", 1))
        else:
            groups.setdefault(kind, []).append(variable)
    lines = filled_lines(f"{prefix}{name} {', '.join(group)};" for name, group in groups.items())
    return "\n".join(indentation + line for line in lines)
