"""Derivation of equations of motion from declarations, and their layout for an FMU."""

from liaisons.language.variables import ActiveInput, State
from liaisons.mechanics.assembly import assemble, assemble_by
from liaisons.mechanics.constraints import accelerations_by_gauss
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.model import Equation, Model

__all__ = [
    "ActiveInput",
    "Equation",
    "Equations",
    "Model",
    "State",
    "accelerations_by_gauss",
    "assemble",
    "assemble_by",
    "derive",
]
