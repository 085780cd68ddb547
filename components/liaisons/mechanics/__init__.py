"""What a mechanism is, and how its equations of motion follow from its energies."""

from liaisons.mechanics.component import Component
from liaisons.mechanics.declarations import (
    ActiveCoordinate,
    Coordinate,
    Parameter,
    calculated,
    condition,
    output,
    point,
)
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.mechanism import Mechanism
from liaisons.mechanics.model import ActiveInput, Experiment, Model, Port, PortMember, State, Variable
from liaisons.mechanics.operator import Operator

__all__ = [
    "ActiveCoordinate",
    "ActiveInput",
    "Component",
    "Coordinate",
    "Equations",
    "Experiment",
    "Mechanism",
    "Model",
    "Operator",
    "Parameter",
    "Port",
    "PortMember",
    "State",
    "Variable",
    "calculated",
    "condition",
    "derive",
    "output",
    "point",
]
