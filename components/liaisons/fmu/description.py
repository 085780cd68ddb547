"""modelDescription.xml of FMI 2.0, and the elements that FMI 3.0 shares with it.

Arrays are shown number by number.  A variable's value reference is its index in ModelStructure, see
:mod:`liaisons.fmu.layout`.  Dependencies are the sparsity patterns of the Jacobians, so they are complete by
construction; of very many numbers they are left out, which FMI defines as "all".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, repeat
from typing import Literal

import casadi as ca
import numpy as np
from scipy.sparse import csr_array

from liaisons.base import units
from liaisons.base.version import __version__
from liaisons.fmu.dependencies import (
    decided_at_events,
    initial_outputs,
    jacobian_sparsity,
    running_outputs,
    shown_states,
    states_that_jump,
)
from liaisons.fmu.jumps import states_moved_along
from liaisons.fmu.layout import (
    RECONSTRUCTION,
    Fmi,
    Setting,
    first_reference,
    index_ranges,
    scalar_count,
    settings,
    size_references,
    start_vectors,
)
from liaisons.fmu.markup import document, element
from liaisons.language.variables import Dimension, Variable
from liaisons.mechanics.model import Model

Backend = Literal["native", "python"]
Knowns = tuple[Sequence[Variable], csr_array | None]
"""Variables, and which unknowns depend on which of them; None: dependencies are not written."""

MOST_DEPENDENCIES = 5000  # scalars: beyond, their dependencies on each other are not written
_SOURCES = (
    *("model.c", "instance.c", "variables.c", "derivatives.c", "inputs.c", "prescribed.c", "step.c", "solver.c"),
    *("symplectic.c", "stiff.c", "events.c", "unilateral.c", "impulses.c", "exchange.c", "states.c", "starts.c"),
    *("messages.c", "complementarity.c", "fmi_common.c"),
)

# Capabilities of the back ends; others are false or 0.
_BOTH = ("canNotUseMemoryManagementFunctions", "canGetAndSetFMUstate", "canSerializeFMUstate")
_NATIVE = (*_BOTH, "providesDirectionalDerivative")
_MODEL_EXCHANGE: dict[str, str] = dict.fromkeys(_NATIVE, "true")
_CO_SIMULATION: dict[str, str] = {
    **dict.fromkeys(("canHandleVariableCommunicationStepSize", "canInterpolateInputs"), "true"),
    "maxOutputDerivativeOrder": "1",
    **dict.fromkeys(_NATIVE, "true"),
}
_CO_SIMULATION_IN_PYTHON: dict[str, str] = dict.fromkeys(
    ("needsExecutionTool", "canHandleVariableCommunicationStepSize", *_BOTH), "true"
)
LOG_CATEGORIES = {
    "logStatusWarning": "what works differently from what was asked for",
    "logStatusDiscard": "values and steps that were refused, and why",
    "logStatusError": "calls that were refused, and why",
}


def source_names(fmi: Fmi) -> tuple[str, ...]:
    """Return the names of the C files that make up a binary."""
    return (*_SOURCES, f"fmi{fmi}.c")


def model_description(model: Model, *, guid: str, backend: Backend) -> bytes:
    """Return modelDescription.xml of FMI 2.0, the same bytes for the same arguments.

    :param guid: that of the binary, ``"{...}"``.
    :param backend: ``"native"``: model exchange and co-simulation; ``"python"``: what pythonfmu supports.
    """
    attributes = {**root_attributes(model, "2.0", guid=guid), "numberOfEventIndicators": str(len(model.contacts))}
    return document(element("fmiModelDescription", attributes, _root_children(model, backend)))


def _root_children(model: Model, backend: Backend) -> Iterator[str]:
    """Yield the lines of the root's children."""
    if backend == "native":
        no_step_events = {} if model.indicators else {"completedIntegratorStepNotNeeded": "true"}
        kinds = {"ModelExchange": no_step_events | _MODEL_EXCHANGE, "CoSimulation": _CO_SIMULATION}
        for kind, capabilities in kinds.items():
            files = chain.from_iterable(element("File", {"name": name}) for name in source_names("2"))
            yield from element(kind, {"modelIdentifier": model.name, **capabilities}, element("SourceFiles", {}, files))
    else:
        yield from element("CoSimulation", {"modelIdentifier": model.name, **_CO_SIMULATION_IN_PYTHON})
    yield from unit_definitions(model.variables)
    if backend == "native":  # pythonfmu's wrapper gives what is fatal no category: who asks for categories misses it
        yield from log_categories()
    yield from default_experiment(model)
    yield from element("ModelVariables", {}, _model_variables(model, backend))
    yield from element("ModelStructure", {}, _model_structure(model))


# ---- elements of both versions of FMI --------------------------------------------------------------------------


def root_attributes(model: Model, version: str, **token: str) -> dict[str, str]:
    """Return the attributes of the root: name, description and origin of a model.

    :param token: ``guid`` in FMI 2.0, ``instantiationToken`` in FMI 3.0.
    """
    return {
        "fmiVersion": version,
        "modelName": model.name,
        **token,
        "description": model.description,
        "generationTool": f"liaisons {__version__}",
        "variableNamingConvention": "structured",
    }


def unit_definitions(variables: Sequence[Variable]) -> Iterator[str]:
    """Yield the units of variables, with base units and display units."""
    names = sorted({variable.unit for variable in variables} - {units.ANY})
    if names:
        yield from element("UnitDefinitions", {}, chain.from_iterable(map(_unit_definition, names)))


def _unit_definition(name: str) -> Iterator[str]:
    """Yield the definition of a unit."""
    unit = units.parse(name)
    base = element("BaseUnit", {base: str(exponent) for base, exponent in unit.exponents})
    display = (element("DisplayUnit", {"name": name, "factor": repr(factor)}) for name, factor in unit.display)
    yield from element("Unit", {"name": name}, chain(base, *display))


def log_categories() -> Iterator[str]:
    """Yield the categories of log messages."""
    lines = (element("Category", {"name": name, "description": text}) for name, text in LOG_CATEGORIES.items())
    yield from element("LogCategories", {}, chain.from_iterable(lines))


def default_experiment(model: Model) -> Iterator[str]:
    """Yield times, step size and tolerance of the default experiment."""
    e = model.experiment
    values = {"startTime": 0.0, "stopTime": e.stop_time, "tolerance": e.tolerance, "stepSize": e.step_size}
    yield from element("DefaultExperiment", {name: repr(float(value)) for name, value in values.items()})


def integer_attributes(setting: Setting) -> dict[str, str]:
    """Return range and start value of a setting."""
    return {"min": "0", "max": str(setting.most), "start": str(setting.start)}


def size_attributes(size: Dimension, reference: int, causality: str, variability: str) -> dict[str, str]:
    """Return the general attributes of a structural size."""
    return {
        "name": size.name,
        "valueReference": str(reference),
        "description": size.description,
        "causality": causality,
        "variability": variability,
        "initial": "exact",
    }


def general_attributes(variable: Variable, reference: int) -> dict[str, str]:
    """Return the attributes that variables of all types have."""
    # min and max include the bounds; a bound that is excluded can only be described.
    domain = f" ({variable.domain()})" if variable.strict else ""
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description + domain,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality != "input":
        attributes["initial"] = "exact" if variable.causality == "parameter" else "calculated"
    return attributes


def real_attributes(variable: Variable, nominal: float) -> dict[str, str]:
    """Return unit, range and nominal value of a variable; none of integers and Booleans.

    :param nominal: where it declares none; 1 is FMI's default.
    """
    attributes = {}
    if variable.type != "Real":
        return attributes
    if variable.unit != units.ANY:
        unit = units.parse(variable.unit)
        attributes["unit"] = variable.unit
        if unit.display and "rad" in dict(unit.exponents):  # angles are shown in degrees, lengths in metres
            attributes["displayUnit"] = unit.display[0][0]
    nominal = variable.nominal or nominal
    numbers = {"min": variable.minimum, "max": variable.maximum, "nominal": None if nominal == 1 else nominal}
    return attributes | {name: repr(float(value)) for name, value in numbers.items() if value is not None}


def start_attribute(variable: Variable) -> dict[str, str]:
    """Return the attribute of the start value; of an array one number stands for all elements."""
    if variable.start is None:
        return {}
    values = variable.starts if isinstance(variable.start, tuple) else (variable.start,)
    return {"start": " ".join(repr(float(value)) for value in values)}


def nominals(model: Model) -> dict[str, list[float]]:
    """Return nominal values of the states at the default start, by name; 1 where there is none."""
    u, k = start_vectors(model)
    y, _ = model.start.call([ca.DM(0), u, k])
    sizes = np.asarray(model.nominals.call([ca.DM(0), y, u, k])[0]).ravel()
    usable = iter(float(f"{size:.6g}") if 0 < size < np.inf else 1.0 for size in sizes)
    return {state.name: [next(usable) for _ in range(state.count)] for state in shown_states(model)}


def model_structure_groups(
    model: Model,
    titles: Sequence[str],
    attribute: str,
    references: Mapping[str, Iterable[int]],
    *,
    running: Knowns,
    starting: Knowns,
) -> Iterator[list[str]]:
    """Yield, group by group, the elements of outputs, derivatives, initial unknowns and event indicators.

    :param titles: names of the elements of each group.
    :param attribute: holds the reference of an unknown.
    :param references: of the numbers of each variable.
    :param running: what the groups but the third may depend on; ``starting`` is that of the third.
    """
    outputs = [variable.name for variable in model.outputs if variable.causality == "output"]
    rates = [state.derivative for state in model.states]
    at_start = {*outputs, *rates, *(state.name for state in model.states)}
    initial = [v.name for v in model.outputs if v.name in at_start or v.causality == "calculatedParameter"]
    at_events, initially = decided_at_events(model)
    groups = (
        (outputs, running, at_events),
        (rates, running, at_events),
        (initial, starting, initially),
        (model.indicators, running, at_events),
    )

    def numbers(names: Iterable[str]) -> list[int]:
        return [reference for name in names for reference in references[name]]

    first = min(numbers(variable.name for variable in model.outputs), default=0)
    for title, (names, (variables, pattern), decided) in zip(titles, groups, strict=False):
        columns, from_all = np.array(numbers(variable.name for variable in variables)), {*numbers(decided)}
        lines: list[str] = []
        for unknown in numbers(names):
            attributes = {attribute: str(unknown)}
            if pattern is not None:
                start, end = pattern.indptr[unknown - first : unknown - first + 2]
                some = columns if unknown in from_all else columns[pattern.indices[start:end]]
                attributes["dependencies"] = " ".join(map(str, sorted(some)))
            lines += element(title, attributes)
        yield lines


# ---- variables -------------------------------------------------------------------------------------------------


def _model_variables(model: Model, backend: Backend) -> Iterator[str]:
    """Yield the variables, arrays element by element."""
    references_of = _value_references(model)
    sizes = nominals(model)
    jumping = states_that_jump(model) | states_moved_along(model) if backend == "native" else set()
    references = size_references(model)
    for dimension in model.dimensions:
        attributes = size_attributes(dimension, references[dimension.name], "local", "constant")
        yield from _scalar_variable(attributes, "Integer", {"start": str(dimension.count)})
    for variable in model.variables:
        reinit = {"reinit": "true"} if variable.name in jumping else {}
        common = real_attributes(variable, 1.0)
        columns = references_of[variable.name], variable.elements(), sizes.get(variable.name, repeat(1.0))
        for i, (reference, scalar, size) in enumerate(zip(*columns, strict=False)):
            real = common if size == 1 else real_attributes(variable, size)
            real = real | start_attribute(scalar) | reinit
            if variable.derivative_of:
                real["derivative"] = str(references_of[variable.derivative_of][i])
            yield from _scalar_variable(general_attributes(scalar, reference), variable.type, real)
    for reference, setting in settings(model, "2").items():
        if backend == "native" or setting is RECONSTRUCTION:
            yield from _scalar_variable(
                general_attributes(setting.variable, reference), "Integer", integer_attributes(setting)
            )


def _value_references(model: Model) -> dict[str, range]:
    """Return the value references of each variable's elements."""
    first = first_reference(model)
    ranges = index_ranges(model.variables)
    return {name: range(first + indices.start, first + indices.stop) for name, indices in ranges.items()}


def _scalar_variable(attributes: Mapping[str, str], kind: str, of_kind: Mapping[str, str]) -> Iterator[str]:
    """Yield a ScalarVariable with the element of its type."""
    yield from element("ScalarVariable", attributes, element(kind, of_kind))


# ---- model structure -------------------------------------------------------------------------------------------


def _model_structure(model: Model) -> Iterator[str]:
    """Yield the groups of unknowns in ModelStructure."""
    sparse = scalar_count(model.variables) <= MOST_DEPENDENCIES
    states, parameters, inputs = shown_states(model), model.parameters, model.inputs
    running = (*states, *inputs), jacobian_sparsity(running_outputs(model), (1, 2)) if sparse else None
    starting = (*parameters, *inputs), jacobian_sparsity(initial_outputs(model), (2, 1)) if sparse else None
    groups = model_structure_groups(
        model, ["Unknown"] * 3, "index", _value_references(model), running=running, starting=starting
    )
    for title, lines in zip(("Outputs", "Derivatives", "InitialUnknowns"), groups, strict=True):
        if lines:
            yield from element(title, {}, lines)
