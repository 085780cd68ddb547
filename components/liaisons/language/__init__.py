"""Declaration of components: parameters, coordinates, energies, points, constraints and closed forms.

:mod:`liaisons.mechanics` derives equations from them, :mod:`liaisons.fmu` builds FMUs.
"""

from typing import Any

from liaisons.language.checks import (
    Formulas,
    call,
    checked_scalar,
    declarations_of,
    reject_clashes,
    reject_contacts,
    shapes_of,
)
from liaisons.language.component import Component, DeclarationsOf, SignalComponent, elements_of
from liaisons.language.declarations import (
    ActiveCoordinate,
    ContactFormula,
    Coordinate,
    Declaration,
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
    Symbol,
    assertion,
    calculated,
    constraint,
    declare,
    non_holonomic,
    output,
    point,
    rheonomic_constraint,
    unchecked,
)
from liaisons.language.layout import Layout
from liaisons.language.mechanical import MechanicalComponent
from liaisons.language.mechanism import Mechanism, is_positive_definite
from liaisons.language.operator import Operator
from liaisons.language.sampled import LATE, Sampled, SampledStates
from liaisons.language.shapes import (
    Ball,
    Box,
    Flash,
    Floor,
    Named,
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
from liaisons.language.variables import (
    NEXT_EVENT_TIME,
    ActiveInput,
    Dimension,
    Experiment,
    State,
    Terminal,
    TerminalMember,
    Variable,
    element,
)

__all__ = [
    "LATE",
    "NEXT_EVENT_TIME",
    "ActiveCoordinate",
    "ActiveInput",
    "Ball",
    "Box",
    "Component",
    "ContactFormula",
    "Coordinate",
    "Declaration",
    "DeclarationsOf",
    "Dimension",
    "DiscreteOutput",
    "DiscreteState",
    "Experiment",
    "Flash",
    "Floor",
    "Formulas",
    "Friction",
    "Gravity",
    "Input",
    "InternalState",
    "Joint",
    "Layout",
    "MechanicalComponent",
    "Mechanism",
    "Named",
    "Operator",
    "Orientation",
    "Parameter",
    "ParameterArray",
    "Rod",
    "Rope",
    "Sampled",
    "SampledStates",
    "Shape",
    "Shapes",
    "SignalComponent",
    "Size",
    "Spring",
    "State",
    "Symbol",
    "Terminal",
    "TerminalMember",
    "Trail",
    "Variable",
    "Wire",
    "assertion",
    "calculated",
    "call",
    "checked_scalar",
    "circle",
    "constraint",
    "declarations_of",
    "declare",
    "element",
    "elements_of",
    "is_positive_definite",
    "non_holonomic",
    "output",
    "point",
    "reject_clashes",
    "reject_contacts",
    "rheonomic_constraint",
    "shapes_of",
    "turned",
    "unchecked",
]

_PUBLIC_ELSEWHERE = {
    "Values",
    "closed_form",
    "dry_friction",
    "unilateral",
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
