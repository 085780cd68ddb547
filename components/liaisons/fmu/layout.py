"""Indices of a model's numbers, and value references.

The *index* of a number is that in the vector (k, u, z).

Value references count from 1 in the order of ModelVariables, since some importers take them for positions there: the
structural sizes, since some importers look for them before the arrays that use them; in FMI 2.0 numbers, by their
index; in FMI 3.0 variables, by their index in :attr:`Model.variables`, and the time; the settings.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from liaisons.base import units
from liaisons.base.compiler import Fmi
from liaisons.language import Variable
from liaisons.mechanics import Model

TIME = Variable("time", "s", "time since the start of the simulation", "local", "continuous")


@dataclass(frozen=True, slots=True)
class Setting:
    """An integer parameter of every FMU, which the component does not declare."""

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
STIFF_SOLVER = Setting(
    Variable(
        "stiff_solver",
        units.ANY,
        "co-simulation of stiff motions: 1 an implicit solver of order 5 (Radau IIA), which controls its error by the "
        "tolerance; 0 an explicit one of order 8",
        "parameter",
        "fixed",
    ),
    most=1,
    start=0,
)


def scalar_count(variables: Iterable[Variable]) -> int:
    """Number of elements of all variables."""
    return sum(variable.count for variable in variables)


def index_ranges(variables: Iterable[Variable]) -> dict[str, range]:
    """Indices of each variable's elements in a vector of all of them, by name."""
    counts = {variable.name: variable.count for variable in variables}
    ends = accumulate(counts.values())
    return {name: range(end - count, end) for (name, count), end in zip(counts.items(), ends, strict=True)}


def start_vectors(model: Model) -> tuple[NDArray, NDArray]:
    """Start values of the inputs, (u,), and of the parameters, (k,)."""
    u, k = (np.array([x for v in variables for x in v.starts]) for variables in (model.inputs, model.parameters))
    return u, k


def start_rates(model: Model) -> list[tuple[int, int]]:
    """Indices of the start values of rates that constraints may change, each with that of its rate."""
    if not any("the rate of " in text for text in model.condition_texts):
        return []
    indices = index_ranges(model.variables)
    own = {name for state in model.states for name in (state.name, f"{state.name}_0")}
    pairs = []
    for parameter in model.parameters:
        array, bracket, index = parameter.name.partition("[")
        rate = f"{array.removesuffix('_0')}{bracket}{index}"
        if array.endswith("_0") and rate in indices and rate not in own:
            pairs += zip(indices[parameter.name], indices[rate], strict=True)
    return pairs


def memory_index(model: Model, name: str) -> int:
    """Memory index of a variable, of an array that of its first element; -1 if it has none."""
    return next((i for i, slot in enumerate(model.memory) if slot in (name, f"{name}[1]")), -1)


def size_references(model: Model) -> dict[str, int]:
    """Value references of the structural sizes, by name."""
    return {size.name: 1 + i for i, size in enumerate(model.dimensions)}


def first_reference(model: Model) -> int:
    """Value reference of the first number in FMI 2.0, of the first variable in FMI 3.0."""
    return 1 + len(model.dimensions)


def settings_by_reference(model: Model, fmi: Fmi) -> dict[int, Setting]:
    """Settings of a native FMU, such as ``stiff_solver``, by value reference."""
    first = first_reference(model) + (scalar_count(model.variables) if fmi == "2" else len(model.variables) + 1)
    solvers = [SYMPLECTIC_STEPS, STIFF_SOLVER] * bool(model.states)
    return dict(enumerate([RECONSTRUCTION] * bool(model.inputs) + solvers, first))
