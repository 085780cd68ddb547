"""Dependencies of outputs and derivatives: by numbers, or by variables where arrays are large."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, hstack

from liaisons.base.array_names import split
from liaisons.expressions.rows import RowProgram, dependencies
from liaisons.fmu.layout import TIME
from liaisons.language import Variable
from liaisons.mechanics.model import Model

Pattern = NDArray[np.bool_]


def while_running(model: Model) -> Pattern:
    """Which outputs depend on which of time, states, inputs and parameters."""
    programs = _programs(model)
    if programs:
        return _between_entries(programs["outputs"], 0, range(4))
    groups = {0: (TIME,), 1: shown_states(model), 2: model.inputs, 3: model.parameters}
    return _between_variables(model.outputs_function, model.outputs, groups)


def at_start(model: Model) -> Pattern:
    """Which outputs depend on which of time, inputs and parameters at initialization."""
    programs = _programs(model)
    if not programs:
        return _between_variables(initial(model), model.outputs, {0: (TIME,), 1: model.inputs, 2: model.parameters})
    on_motion = _between_entries(programs["outputs"], 0, (1, 4))
    of_motion = np.vstack([_between_entries(programs["start"], result, range(3)) for result in range(2)])
    return _between_entries(programs["outputs"], 0, (0, 2, 3)) | (on_motion @ of_motion)


def initial(model: Model) -> ca.Function:
    """z of (t, u, k) at initialization, where states and memory follow from them."""
    t, u, k = (ca.MX.sym(name, model.start.numel_in(i)) for i, name in enumerate("tuk"))
    y, m = _call(model.start, t, u, k)
    return ca.Function("initial", [t, u, k], _call(model.outputs_function, t, y, u, k, m))


def between_numbers(function: ca.Function, arguments: Sequence[int]) -> csr_array:
    """Where the Jacobian of a function's result with respect to some arguments, side by side, can be non-zero."""
    return csr_array(hstack([_pattern(function, argument) for argument in arguments], format="csr"))


def _between_variables(
    function: ca.Function, results: Sequence[Variable], arguments: Mapping[int, Sequence[Variable]]
) -> Pattern:
    """Which variables of a function's result depend on which variables of some arguments, by their numbers.

    :returns: shape (results, all variables of the arguments, side by side).
    """

    def owners(variables: Iterable[Variable]) -> NDArray:
        """Of each number the index of its variable."""
        counts = [variable.count for variable in variables]
        return np.repeat(np.arange(len(counts)), counts)

    knowns = list(chain.from_iterable(arguments.values()))
    rows, columns = between_numbers(function, list(arguments)).nonzero()
    pattern = np.zeros((len(results), len(knowns)), dtype=bool)
    pattern[owners(results)[rows], owners(knowns)[columns]] = True
    return pattern


def coupled(model: Model) -> int:
    """How many of the first numbers of y any of dy/dt depends on; behind them are integrals along the motion."""
    if model.programs:
        rates = _programs(model)["derivatives"]
        rows = np.flatnonzero(_between_entries(rates, 0, [1]).any(axis=0))
        return rates.arguments[1].offsets(rates.n)[rows.max(initial=-1) + 1]
    columns = between_numbers(model.derivatives, [1]).nonzero()[1]
    return int(columns.max(initial=-1)) + 1


def shown_states(model: Model) -> tuple[Variable, ...]:
    """The variables that show the states, in the order of y."""
    named = {variable.name: variable for variable in model.outputs}
    return tuple(named[state.name] for state in model.states)


def states_that_jump(model: Model) -> set[str]:
    """States that an impact or a jump of the inputs changes, e.g. the work of an impulse."""
    states = shown_states(model)
    programs = _programs(model)
    if model.contacts:  # momenta and work by impacts, coordinates by rounding
        return {state.name for state in states if state.name.rpartition(".")[2] != "dissipated"}
    if programs:
        pattern = _between_entries(programs["jump"], 0, (1, 2))
    else:
        pattern = _between_variables(model.jump, states, {1: states, 2: model.inputs})
    pattern[np.diag_indices(len(states))] = False
    return {state.name for state, row in zip(states, pattern, strict=True) if row.any()}


def decided_at_events(model: Model) -> tuple[set[str], set[str]]:
    """Outputs that change at events alone, and those that depend on them.

    Contacts decide them from everything, at an event and at the start.
    """
    if not model.contacts:
        return set(), set()
    own = tuple(f"{split(contact.name)[0]}_" for contact in model.contacts)
    modes = [i for i, name in enumerate(model.memory) if name.startswith(own)]
    rows = _pattern(model.outputs_function, 4)[:, modes].nonzero()[0]
    outputs = [variable.name for variable in model.outputs for _ in range(variable.count)]
    changing = {v.name for v in model.outputs if v.variability == "discrete" and v.causality == "output"}
    return changing, changing | {outputs[row] for row in rows}


def _programs(model: Model) -> dict[str, RowProgram]:
    return {program.name: program for program in model.programs}


def _between_entries(program: RowProgram, result: int, arguments: Iterable[int]) -> Pattern:
    """Which variables of a result depend on which variables of some arguments, side by side."""
    pieces = []
    for argument in arguments:
        piece = np.zeros((program.results[result].entries.numel(), program.arguments[argument].entries.numel()), bool)
        for row, entries in enumerate(dependencies(program, result, argument)):
            piece[row, list(entries)] = True
        pieces.append(piece)
    return np.hstack(pieces)


def _call(function: ca.Function, *arguments: ca.MX) -> list[Any]:
    """Results of a function, its expressions in place of a call where that can be."""
    return list(function.call(list(arguments), function.is_a("MXFunction"), False))


def _pattern(function: ca.Function, argument: int) -> csr_array:
    sparsity = function.jac_sparsity(0, argument)
    rows, columns = np.array(sparsity.get_triplet(), dtype=int)
    return csr_array((np.ones(rows.size, dtype=bool), (rows, columns)), shape=sparsity.shape)
