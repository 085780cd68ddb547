"""Declaration of components: parameters, coordinates, energies, points, constraints and closed forms.

:mod:`liaisons.mechanics` derives equations from them, :mod:`liaisons.fmu` builds FMUs.
"""

from typing import Any

from liaisons.language.checks import declarations_of
from liaisons.language.closed_forms import Values, closed_form
from liaisons.language.component import Component
from liaisons.language.declarations import (
    ActiveCoordinate,
    Coordinate,
    DiscreteOutput,
    DiscreteState,
    Friction,
    Gravity,
    Input,
    InternalState,
    Joint,
    Orientation,
    Parameter,
    ParameterArray,
    Size,
    assertion,
    calculated,
    constraint,
    dry_friction,
    non_holonomic,
    output,
    point,
    rheonomic_constraint,
    unchecked,
    unilateral,
)
from liaisons.language.mechanical import MechanicalComponent
from liaisons.language.mechanism import Mechanism
from liaisons.language.operator import Operator
from liaisons.language.sampled import Sampled
from liaisons.language.shapes import (
    Ball,
    Box,
    Flash,
    Floor,
    Rod,
    Rope,
    Shape,
    Shapes,
    Spring,
    Trail,
    Wire,
    circle,
    turned,
)
from liaisons.language.variables import Dimension, Experiment, Terminal, Variable

__all__ = [
    "ActiveCoordinate",
    "Ball",
    "Box",
    "Component",
    "Coordinate",
    "Dimension",
    "DiscreteOutput",
    "DiscreteState",
    "Experiment",
    "Flash",
    "Floor",
    "Friction",
    "Gravity",
    "Input",
    "InternalState",
    "Joint",
    "MechanicalComponent",
    "Mechanism",
    "Operator",
    "Orientation",
    "Parameter",
    "ParameterArray",
    "Rod",
    "Rope",
    "Sampled",
    "Shape",
    "Shapes",
    "Size",
    "Spring",
    "Terminal",
    "Trail",
    "Values",
    "Variable",
    "Wire",
    "assertion",
    "calculated",
    "circle",
    "closed_form",
    "constraint",
    "declarations_of",
    "dry_friction",
    "non_holonomic",
    "output",
    "point",
    "rheonomic_constraint",
    "turned",
    "unchecked",
    "unilateral",
]

_PUBLIC_ELSEWHERE = {
    "Body",
    "BodyPoint",
    "Chain",
    "Cylindrical",
    "Free",
    "Linkage",
    "Planar",
    "Prismatic",
    "Revolute",
    "Screw",
    "Spherical",
    "SpringDamper",
    "Universal",
    "Weld",
    "ground",
}


def __getattr__(name: str) -> Any:
    """Declarations with packages of their own, which may be imported from here, too."""
    if name not in _PUBLIC_ELSEWHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import liaisons

    return getattr(liaisons, name)
