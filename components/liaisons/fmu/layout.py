"""Where the numbers of a model are, and the references by which an importer asks for them.

The *place* of a number is its index in the flat vectors (k, u, z).  FMI 2.0 refers to numbers, by their places; FMI 3.0
to variables, by their index in :attr:`Model.variables`, and behind them to the time.  Behind these come, in both, the
settings and the structural sizes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from liaisons import units
from liaisons.mechanics.model import Model, Variable

Fmi = Literal["2", "3"]

TIME = Variable("time", "s", "time since the start of the simulation", "local", "continuous")


@dataclass(frozen=True, slots=True)
class Setting:
    """An integer parameter that is not the component's: how an instance of it is run."""

    variable: Variable
    most: int
    start: int


RECONSTRUCTION = Setting(
    Variable(
        "input_reconstruction",
        units.ANY,
        "motion of the inputs inside a communication step: 0 hold, 1 extrapolate, 2 interpolate",
        "parameter",
        "fixed",
    ),
    most=2,
    start=1,
)
SYMPLECTIC_STEPS = Setting(
    Variable(
        "symplectic_steps",
        units.ANY,
        "co-simulation for long runs: equal steps of a symplectic solver of order 6 (Gauss) in each communication "
        "step, which has to stay the same; 0: a solver that controls its error by the tolerance",
        "parameter",
        "fixed",
    ),
    most=100000,
    start=0,
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


def settings(model: Model, fmi: Fmi) -> dict[int, Setting]:
    """The settings that a native FMU of a model has, by value reference."""
    first = _first_setting(model, fmi)
    has = {RECONSTRUCTION: bool(model.inputs), SYMPLECTIC_STEPS: bool(model.states)}
    return {first + i: setting for i, setting in enumerate(has) if has[setting]}


def size_references(model: Model, fmi: Fmi) -> dict[str, int]:
    """Value references of the structural sizes, by name: they follow the settings."""
    first = _first_setting(model, fmi) + 2
    return {size.name: first + i for i, size in enumerate(model.dimensions)}


def _first_setting(model: Model, fmi: Fmi) -> int:
    return scalars(model) if fmi == "2" else len(model.variables) + 1
