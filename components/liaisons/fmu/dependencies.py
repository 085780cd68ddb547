"""Dependencies of outputs and derivatives: by numbers, or by variables where arrays are large."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, hstack

from liaisons.base.array_names import array_and_index
from liaisons.fmu.layout import TIME, index_ranges, scalar_count
from liaisons.language import Variable
from liaisons.mechanics import Model

Pattern = NDArray[np.bool_]

_LINKS = 12
"""Number of links with which the variables of a chain have all the dependencies that they have in longer ones."""


def running_dependencies(model: Model) -> Pattern:
    """Which outputs (rows) depend on which of time, states, inputs and parameters (columns), by variables."""
    m = _shortened_chain(model)
    groups = {0: (TIME,), 1: state_outputs(m), 2: m.inputs, 3: m.parameters}
    return _variable_pattern(_with_projection(m, running_outputs(m)), m.outputs, groups)


def _with_projection(model: Model, function: ca.Function) -> ca.Function:
    """Function of (t, y, u, k, ...) on redundant constraints next to y, as Model Exchange calculates it."""
    if not model.redundant or model.project is None:
        return function
    t, y, u, k, *m = function.mx_in()
    kept = model.project.call([t, y, u, k])
    return ca.Function("kept", [t, y, u, k, *m], function.call([t, *kept, u, k, *m]))


def initial_dependencies(model: Model) -> Pattern:
    """Which outputs (rows) depend on which of time, inputs and parameters at initialization, by variables."""
    m = _shortened_chain(model)
    return _variable_pattern(initial_outputs(m), m.outputs, {0: (TIME,), 1: m.inputs, 2: m.parameters})


@lru_cache(maxsize=4)  # the FMUs of one component are built one after the other
def _shortened_chain(model: Model) -> Model:
    """Model of a chain with few links, which has the same dependencies; any other model as it is."""
    if not (model.loops and any(variable.dimension for variable in model.outputs)):
        return model

    def shortened(variables: Iterable[Variable]) -> tuple[Variable, ...]:
        return tuple(
            replace(v, start=None, dimension=replace(v.dimension, count=_LINKS)) if v.dimension else v
            for v in variables
        )

    groups = {name: shortened(getattr(model, name)) for name in ("parameters", "inputs", "outputs")}
    return replace(model, **model.loops.functions(_LINKS), **groups)


def initial_outputs(model: Model) -> ca.Function:
    """Function (t, u, k) → outputs at initialization, where states and memory follow from its arguments."""
    t, u, k = (ca.MX.sym(name, model.start.numel_in(i)) for i, name in enumerate("tuk"))
    y, m = _inlined_call(model.start, t, u, k)
    return ca.Function("initial", [t, u, k], _inlined_call(model.outputs_function, t, y, u, k, m))


def running_outputs(model: Model) -> ca.Function:
    """Function (t, y, u, k, m) → z, after the sample that may be due."""
    if model.sample is None:
        return model.outputs_function
    arguments = model.sample.sx_in()
    memory = model.sample.call(arguments, True, False)
    return ca.Function("running", arguments, model.outputs_function.call([*arguments[:4], *memory], True, False))


def energy_accounts(model: Model) -> list[tuple[int, int, int]]:
    """For each mechanism the index of T + V among the outputs, of work and dissipated energy among the states.

    None where nothing is prescribed, so that all work is done by forces.
    """
    outputs, states = index_ranges(model.outputs), index_ranges(state_outputs(model))
    parts = [name.removesuffix("work") for name in states if model.active and name.split(".")[-1] == "work"]
    return [
        (outputs[energy].start, states[f"{part}work"].start, states[f"{part}dissipated"].start)
        for part in parts
        if (energy := f"{part}energy") in outputs
    ]


def jacobian_sparsity(function: ca.Function, arguments: Sequence[int]) -> csr_array:
    """Pattern of the Jacobians of the first result by some arguments, side by side."""
    patterns = []
    for sparsity in (function.jac_sparsity(0, argument) for argument in arguments):
        rows, columns = np.array(sparsity.get_triplet(), dtype=int)
        patterns.append(csr_array((np.ones(rows.size, dtype=bool), (rows, columns)), shape=sparsity.shape))
    return csr_array(hstack(patterns, format="csr"))


def _variable_pattern(
    function: ca.Function, results: Sequence[Variable], arguments: Mapping[int, Sequence[Variable]]
) -> Pattern:
    """Which variables of a function's first result depend on which variables of its arguments.

    :returns: shape (results, all variables of the arguments, side by side).
    """

    def variable_indices(variables: Iterable[Variable]) -> NDArray:
        """For each number the index of its variable."""
        counts = [variable.count for variable in variables]
        return np.repeat(np.arange(len(counts)), counts)

    knowns = list(chain.from_iterable(arguments.values()))
    rows, columns = jacobian_sparsity(function, list(arguments)).nonzero()
    pattern = np.zeros((len(results), len(knowns)), dtype=bool)
    pattern[variable_indices(results)[rows], variable_indices(knowns)[columns]] = True
    return pattern


def coupled_state_count(model: Model) -> int:
    """Number of coupled states, which stand first: rates depend on them, not on the states behind."""
    m, states = _shortened_chain(model), state_outputs(model)
    columns = _variable_pattern(m.derivatives, state_outputs(m), {1: state_outputs(m)}).nonzero()[1]
    return scalar_count(states[: columns.max(initial=-1) + 1])


def state_outputs(model: Model) -> tuple[Variable, ...]:
    """Output variables of the states, in the order of y."""
    named = {variable.name: variable for variable in model.outputs}
    return tuple(named[state.name] for state in model.states)


def states_that_jump(model: Model) -> set[str]:
    """Names of the states that an impact or a jump of the inputs changes, such as the work."""
    if model.contacts:  # momenta and work by impacts, coordinates by rounding
        return {state.name for state in model.states if state.name.rpartition(".")[2] != "dissipated"}
    m = _shortened_chain(model)
    states = state_outputs(m)
    pattern = _variable_pattern(m.jump, states, {1: states, 2: m.inputs})
    pattern[np.diag_indices(len(states))] = False
    return {state.name for state, row in zip(states, pattern, strict=True) if row.any()}


def event_outputs(model: Model) -> tuple[set[str], set[str]]:
    """Names of the outputs that change at events only, and those of all outputs that depend on them.

    Contacts decide them from everything, at an event and at the start.
    """
    if not model.contacts:
        return set(), set()
    own = tuple(f"{array_and_index(contact.name)[0]}_" for contact in model.contacts)
    modes = [i for i, name in enumerate(model.memory) if name.startswith(own)]
    rows = jacobian_sparsity(model.outputs_function, [4])[:, modes].nonzero()[0]
    outputs = [variable.name for variable in model.outputs for _ in range(variable.count)]
    changing = {v.name for v in model.outputs if v.variability == "discrete" and v.causality == "output"}
    return changing, changing | {outputs[row] for row in rows}


def _inlined_call(function: ca.Function, *arguments: ca.MX) -> list[Any]:
    """Results of a call, inlined if the function is of MX type."""
    return list(function.call(list(arguments), function.is_a("MXFunction"), False))
