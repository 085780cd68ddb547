"""What one writes: a component's parameters, coordinates, energies, points, constraints and closed forms.

A declaration does not know what becomes of it: :mod:`liaisons.mechanics` derives equations, :mod:`liaisons.fmu` builds.
"""

from liaisons.language.chain import Chain
from liaisons.language.closed_forms import Values, closed_form
from liaisons.language.component import Component
from liaisons.language.declarations import (
    ActiveCoordinate,
    Coordinate,
    Friction,
    Gravity,
    Input,
    InternalState,
    Joint,
    Orientation,
    Parameter,
    ParameterArray,
    Size,
    calculated,
    condition,
    constraint,
    non_holonomic,
    output,
    point,
    submersion,
    unchecked,
)
from liaisons.language.mechanism import Mechanism
from liaisons.language.operator import Operator
from liaisons.language.shapes import Ball, Box, Rod, Shape, Shapes, Spring, Trail, Wire, circle, turned
from liaisons.language.variables import Dimension, Experiment, Terminal, Variable

__all__ = [
    "ActiveCoordinate",
    "Ball",
    "Box",
    "Chain",
    "Component",
    "Coordinate",
    "Dimension",
    "Experiment",
    "Friction",
    "Gravity",
    "Input",
    "InternalState",
    "Joint",
    "Mechanism",
    "Operator",
    "Orientation",
    "Parameter",
    "ParameterArray",
    "Rod",
    "Shape",
    "Shapes",
    "Size",
    "Spring",
    "Terminal",
    "Trail",
    "Values",
    "Variable",
    "Wire",
    "calculated",
    "circle",
    "closed_form",
    "condition",
    "constraint",
    "non_holonomic",
    "output",
    "point",
    "submersion",
    "turned",
    "unchecked",
]
