"""Where the numbers of a model are, and the references by which an importer asks for them.

The *place* of a number is its index in the flat vectors (k, u, z).

Value references count from 1 in the order of ModelVariables, since some importers take them for positions there: the
structural sizes, since some importers look for them before the arrays that use them; numbers in FMI 2.0, by their
places; in FMI 3.0 variables, by their index in :attr:`Model.variables`, and the time; the settings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from liaisons import units
from liaisons.language import Variable
from liaisons.mechanics.model import ActiveInput, Model

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


def mismatch_place(model: Model, prescribed: ActiveInput) -> int | None:
    """Where the memory has what is found of a prescribed coordinate; None: nothing is kept of it."""
    names = (f"{prescribed.value}_mismatch", f"{prescribed.value}_mismatch[1]")
    return next((i for i, name in enumerate(model.memory) if name in names), None)


def scalars(model: Model) -> int:
    """How many places there are."""
    return sum(variable.count for variable in model.variables)


def size_references(model: Model) -> dict[str, int]:
    """Value references of the structural sizes, by name."""
    return {size.name: 1 + i for i, size in enumerate(model.dimensions)}


def first_reference(model: Model) -> int:
    """Value reference of the first number in FMI 2.0, of the first variable in FMI 3.0."""
    return 1 + len(model.dimensions)


def settings(model: Model, fmi: Fmi) -> dict[int, Setting]:
    """The settings that a native FMU of a model has, by value reference."""
    has = {RECONSTRUCTION: bool(model.inputs), SYMPLECTIC_STEPS: bool(model.states)}
    first = first_reference(model) + (scalars(model) if fmi == "2" else len(model.variables) + 1)
    return dict(enumerate((setting for setting in has if has[setting]), first))
