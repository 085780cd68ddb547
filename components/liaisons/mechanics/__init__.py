"""What a mechanism is, and how its equations of motion follow from its energies."""

from liaisons.mechanics import analysis
from liaisons.mechanics.chains import Chain
from liaisons.mechanics.closed_forms import Values, closed_form
from liaisons.mechanics.component import Component
from liaisons.mechanics.constraints import gauss
from liaisons.mechanics.declarations import (
    ActiveCoordinate,
    Coordinate,
    Friction,
    Gravity,
    Input,
    InternalState,
    Joint,
    Orientation,
    Parameter,
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
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.mechanism import Mechanism
from liaisons.mechanics.model import ActiveInput, Experiment, Model, Port, PortMember, State, Variable
from liaisons.mechanics.operator import Operator

__all__ = [
    "ActiveCoordinate",
    "ActiveInput",
    "Chain",
    "Component",
    "Coordinate",
    "Equations",
    "Experiment",
    "Friction",
    "Gravity",
    "Input",
    "InternalState",
    "Joint",
    "Mechanism",
    "Model",
    "Operator",
    "Orientation",
    "Parameter",
    "Port",
    "PortMember",
    "Size",
    "State",
    "Values",
    "Variable",
    "analysis",
    "calculated",
    "closed_form",
    "condition",
    "constraint",
    "derive",
    "gauss",
    "non_holonomic",
    "output",
    "point",
    "submersion",
    "unchecked",
]
