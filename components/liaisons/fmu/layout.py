"""Where the numbers of a model are, and the references by which an importer asks for them.

The *place* of a number is its index in the flat vectors (k, u, z).  FMI 2.0 refers to numbers, by their places; FMI 3.0
to variables, by their index in :attr:`Model.variables`, and behind them to the time.  Behind these come, in both,
``input_reconstruction`` and the structural sizes.
"""

from __future__ import annotations

from typing import Literal

from liaisons import units
from liaisons.mechanics.model import Model, Variable

Fmi = Literal["2", "3"]

TIME = Variable("time", "s", "time since the start of the simulation", "local", "continuous")
RECONSTRUCTION = Variable(
    "input_reconstruction",
    units.ANY,
    "motion of the inputs inside a communication step: 0 hold, 1 extrapolate, 2 interpolate",
    "parameter",
    "fixed",
)


def places(model: Model) -> dict[str, range]:
    """The places of each variable, by its name."""
    found: dict[str, range] = {}
    first = 0
    for variable in model.variables:
        found[variable.name] = range(first, first + variable.count)
        first += variable.count
    return found


def scalars(model: Model) -> int:
    """How many places there are."""
    return sum(variable.count for variable in model.variables)


def reconstruction_reference(model: Model, fmi: Fmi) -> int:
    """Value reference of ``input_reconstruction``; those of the structural sizes follow it."""
    return scalars(model) if fmi == "2" else len(model.variables) + 1
