"""modelDescription.xml of FMI 2.0, where arrays are shown number by number, and of FMI 3.0.

A variable's value reference is its index in ModelStructure of FMI 2.0, see :mod:`liaisons.fmu.layout`.  Dependencies
are the sparsity patterns of the Jacobians, so they are complete by construction; of very many numbers they are left
out, which FMI defines as "all".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Literal

import casadi as ca
import numpy as np
from scipy.sparse import csr_array

from liaisons.base import units
from liaisons.base.version import __version__
from liaisons.fmu.dependencies import (
    event_outputs,
    initial_dependencies,
    initial_outputs,
    jacobian_sparsity,
    running_dependencies,
    running_outputs,
    state_outputs,
    states_that_jump,
)
from liaisons.fmu.jumps import states_moved_by_jumps
from liaisons.fmu.layout import (
    RECONSTRUCTION,
    TIME,
    Fmi,
    first_reference,
    index_ranges,
    scalar_count,
    settings_by_reference,
    size_references,
    start_vectors,
)
from liaisons.fmu.markup import document, element
from liaisons.language import Dimension, Variable
from liaisons.mechanics import Model

Backend = Literal["native", "python"]
Knowns = tuple[Sequence[Variable], csr_array | None]
"""Variables, and which unknowns depend on which of them; None: dependencies are not written."""

MOST_DEPENDENCIES = 5000  # scalars: beyond, their dependencies on each other are not written
_SOURCES = (
    *("model.c", "instance.c", "variables.c", "derivatives.c", "inputs.c", "prescribed.c", "missing.c", "jumps.c"),
    *("step.c", "solver.c", "symplectic.c", "stiff.c", "singular.c", "impulses.c", "exchange.c", "states.c"),
    *("starts.c", "messages.c", "fmi_common.c"),
)
SELDOM_RUN = (
    *("instance.c", "variables.c", "missing.c", "jumps.c", "singular.c", "impulses.c", "states.c", "starts.c"),
    *("messages.c", "fmi_common.c", "no_contacts.c", "fmi2.c", "fmi3.c"),
)
"""Files of the runtime in which a step, and what calls for derivatives in model exchange or coupling, spends little."""
_CONTACT_SOURCES = ("event_search.c", "events.c", "unilateral.c", "complementarity.c")

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
_MODEL_EXCHANGE3 = dict.fromkeys(
    ("canGetAndSetFMUState", "canSerializeFMUState", "providesDirectionalDerivatives", "providesAdjointDerivatives"),
    "true",
)
_CO_SIMULATION3: dict[str, str] = {
    "canHandleVariableCommunicationStepSize": "true",
    "maxOutputDerivativeOrder": "1",
    **dict.fromkeys(("providesIntermediateUpdate", "canReturnEarlyAfterIntermediateUpdate", "hasEventMode"), "true"),
    **_MODEL_EXCHANGE3,
}
_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Size": "UInt64"}
LOG_CATEGORIES = {
    "logStatusWarning": "what works differently from what was asked for",
    "logStatusDiscard": "values and steps that were refused, and why",
    "logStatusError": "calls that were refused, and why",
}


def source_names(model: Model, fmi: Fmi) -> tuple[str, ...]:
    """Names of the C files that are compiled, model.c first."""
    return (*_SOURCES, *(_CONTACT_SOURCES if model.contacts else ["no_contacts.c"]), f"fmi{fmi}.c")


def model_description(
    model: Model, fmi: Fmi = "2", *, guid: str, backend: Backend = "native", arrays: bool = True
) -> bytes:
    """Text of modelDescription.xml, the same bytes for the same arguments.

    :param guid: that of the binary, ``"{...}"``.
    :param backend: ``"native"``: model exchange and co-simulation; ``"python"``: what pythonfmu supports of FMI 2.0.
    :param arrays: False: in FMI 3.0, too, elements of arrays are variables, and structural sizes constants.
    """
    attributes = {
        "fmiVersion": f"{fmi}.0",
        "modelName": model.name,
        "guid" if fmi == "2" else "instantiationToken": guid,
        "description": model.description,
        "generationTool": f"liaisons {__version__}",
        "variableNamingConvention": "structured",
        **({"numberOfEventIndicators": str(len(model.contacts))} if fmi == "2" else {}),
    }
    model = model if arrays else replace(model.flat(), loops=None)
    return document(element("fmiModelDescription", attributes, _root_children(model, fmi, backend)))


def _root_children(model: Model, fmi: Fmi, backend: Backend) -> Iterator[str]:
    """Yield the lines of the root's children."""
    for kind, capabilities in _interfaces(model, fmi, backend).items():
        files = chain.from_iterable(element("File", {"name": name}) for name in source_names(model, "2"))
        sources = element("SourceFiles", {}, files) if (fmi, backend) == ("2", "native") else ()
        yield from element(kind, {"modelIdentifier": model.name, **capabilities}, sources)
    yield from _unit_definitions((*model.variables, *[TIME] * (fmi == "3")))
    if backend == "native":  # pythonfmu's wrapper gives what is fatal no category: who asks for categories misses it
        yield from _log_categories()
    yield from _default_experiment(model)
    yield from element("ModelVariables", {}, _model_variables(model, fmi, backend))
    yield from element("ModelStructure", {}, _model_structure(model, fmi))


def _interfaces(model: Model, fmi: Fmi, backend: Backend) -> dict[str, dict[str, str]]:
    """Attributes of ModelExchange and CoSimulation, by name of the element."""
    if backend == "python":
        return {"CoSimulation": _CO_SIMULATION_IN_PYTHON}
    if fmi == "2":
        no_step_events = {} if model.indicators else {"completedIntegratorStepNotNeeded": "true"}
        return {"ModelExchange": no_step_events | _MODEL_EXCHANGE, "CoSimulation": _CO_SIMULATION}
    instants = {"mightReturnEarlyFromDoStep": "true"} if model.events.numel_out(0) or model.indicators else {}
    completes = {"needsCompletedIntegratorStep": "true"} if model.indicators else {}
    return {"ModelExchange": completes | _MODEL_EXCHANGE3, "CoSimulation": _CO_SIMULATION3 | instants}


# ---- elements ----------------------------------------------------------------------------------------------------


def _unit_definitions(variables: Sequence[Variable]) -> Iterator[str]:
    """Yield the lines of UnitDefinitions."""
    names = sorted({variable.unit for variable in variables} - {units.ANY})
    if names:
        yield from element("UnitDefinitions", {}, chain.from_iterable(map(_unit_definition, names)))


def _unit_definition(name: str) -> Iterator[str]:
    """Yield the lines of a Unit, with its base unit and display units."""
    unit = units.parse(name)
    base = element("BaseUnit", {base: str(exponent) for base, exponent in unit.exponents})
    display = (element("DisplayUnit", {"name": name, "factor": repr(factor)}) for name, factor in unit.display)
    yield from element("Unit", {"name": name}, chain(base, *display))


def _log_categories() -> Iterator[str]:
    """Yield the lines of LogCategories."""
    lines = (element("Category", {"name": name, "description": text}) for name, text in LOG_CATEGORIES.items())
    yield from element("LogCategories", {}, chain.from_iterable(lines))


def _default_experiment(model: Model) -> Iterator[str]:
    """Yield the line of DefaultExperiment."""
    e = model.experiment
    values = {"startTime": 0.0, "stopTime": e.stop_time, "tolerance": e.tolerance, "stepSize": e.step_size}
    yield from element("DefaultExperiment", {name: repr(float(value)) for name, value in values.items()})


def _size_attributes(size: Dimension, reference: int, causality: str, variability: str) -> dict[str, str]:
    """Attributes, except start, of the variable of a structural size."""
    return {
        "name": size.name,
        "valueReference": str(reference),
        "description": size.description,
        "causality": causality,
        "variability": variability,
        "initial": "exact",
    }


def _general_attributes(variable: Variable, reference: int) -> dict[str, str]:
    """Attributes that variables of all types have."""
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


def _real_attributes(variable: Variable, nominal: float) -> dict[str, str]:
    """Attributes that only a real variable has: unit, range, nominal value.

    :param nominal: value of a variable that declares none; FMI's default is 1.
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


def _start_attribute(variable: Variable) -> dict[str, str]:
    """Attribute ``start``, if there is a start value; one number stands for all elements of an array."""
    if variable.start is None:
        return {}
    values = variable.starts if isinstance(variable.start, tuple) else (variable.start,)
    return {"start": " ".join(repr(float(value)) for value in values)}


def _state_nominals(model: Model) -> dict[str, list[float]]:
    """Nominal values of the states at the default start, by name; 1 for one that is 0 or not finite."""
    u, k = start_vectors(model)
    y, _ = model.start.call([ca.DM(0), u, k])
    sizes = np.asarray(model.nominals.call([ca.DM(0), y, u, k])[0]).ravel()
    usable = iter(float(f"{size:.6g}") if 0 < size < np.inf else 1.0 for size in sizes)
    return {state.name: [next(usable) for _ in range(state.count)] for state in state_outputs(model)}


def _model_structure_groups(
    model: Model,
    titles: Sequence[str],
    attribute: str,
    references: Mapping[str, Iterable[int]],
    *,
    running: Knowns,
    starting: Knowns,
) -> Iterator[list[str]]:
    """Yield the lines of ModelStructure in groups: outputs, derivatives, initial unknowns, event indicators.

    :param titles: names of the elements of each group.
    :param attribute: holds the reference of an unknown.
    :param references: of the numbers of each variable.
    :param running: what all groups but the third may depend on.
    :param starting: what the third may depend on.
    """
    outputs = [variable.name for variable in model.outputs if variable.causality == "output"]
    rates = [state.derivative for state in model.states]
    at_start = {*outputs, *rates, *(state.name for state in model.states)}
    initial = [v.name for v in model.outputs if v.name in at_start or v.causality == "calculatedParameter"]
    at_events, initially = event_outputs(model)
    groups = (
        (outputs, running, at_events),
        (rates, running, at_events),
        (initial, starting, initially),
        (model.indicators, running, at_events),
    )

    def references_of(names: Iterable[str]) -> list[int]:
        return [reference for name in names for reference in references[name]]

    first = min(references_of(variable.name for variable in model.outputs), default=0)
    for title, (names, (variables, pattern), decided) in zip(titles, groups, strict=False):
        columns, from_all = np.array(references_of(variable.name for variable in variables)), {*references_of(decided)}
        lines: list[str] = []
        for unknown in references_of(names):
            attributes = {attribute: str(unknown)}
            if pattern is not None:
                start, end = pattern.indptr[unknown - first : unknown - first + 2]
                some = columns if unknown in from_all else columns[pattern.indices[start:end]]
                attributes["dependencies"] = " ".join(map(str, sorted(some)))
            lines += element(title, attributes)
        yield lines


# ---- variables -------------------------------------------------------------------------------------------------


def _model_variables(model: Model, fmi: Fmi, backend: Backend) -> Iterator[str]:
    """Yield the lines of ModelVariables: structural sizes, variables, the time in FMI 3.0, settings."""
    sizes = size_references(model)
    sized = {variable.dimension for variable in model.variables} if fmi == "3" else set()
    kind, numbers = ("Integer", ("start",)) if fmi == "2" else ("Size", ("min", "max", "start"))
    for size in model.dimensions:
        causality = ("structuralParameter", "fixed") if size in sized else ("local", "constant")
        attributes = _size_attributes(size, sizes[size.name], *causality)
        yield from _variable_element(fmi, kind, attributes, dict.fromkeys(numbers, str(size.count)))
    references, nominals = _value_references(model, fmi), _state_nominals(model)
    jumping = states_that_jump(model) | states_moved_by_jumps(model) if backend == "native" else set()
    for variable in model.variables:
        more = {"reinit": "true"} if variable.name in jumping else {}
        if fmi == "3" and variable.variability == "continuous":
            more["intermediateUpdate"] = "true"
        own = nominals.get(variable.name, [1.0])
        common, alike = _real_attributes(variable, max(own)) | more, fmi == "3" or len({*own}) == 1
        shape = [*_dimension_element(variable.dimension, sizes)] if fmi == "3" and variable.dimension else []
        scalars = variable.elements() if fmi == "2" else (variable,)
        for i, (reference, scalar) in enumerate(zip(references[variable.name], scalars, strict=True)):
            of_kind = common if alike else _real_attributes(variable, own[i]) | more
            of_kind = of_kind | _start_attribute(scalar)
            if variable.derivative_of:
                of_kind["derivative"] = str(references[variable.derivative_of][i])
            yield from _variable_element(fmi, variable.type, _general_attributes(scalar, reference), of_kind, shape)
    if fmi == "3":
        attributes = _general_attributes(TIME, references[TIME.name].start) | {"causality": "independent"}
        del attributes["initial"]
        yield from _variable_element(fmi, "Real", attributes, _real_attributes(TIME, 1.0))
    for reference, setting in settings_by_reference(model, fmi).items():
        if backend == "native" or setting is RECONSTRUCTION:
            attributes = _general_attributes(setting.variable, reference)
            numbers = {"min": "0", "max": str(setting.most), "start": str(setting.start)}
            yield from _variable_element(fmi, "Integer", attributes, numbers)


def _variable_element(
    fmi: Fmi, kind: str, attributes: Mapping[str, str], of_kind: Mapping[str, str], shape: Iterable[str] = ()
) -> Iterator[str]:
    """Yield the lines of a variable.

    :param of_kind: attributes that FMI 2.0 writes in an element of their own.
    """
    if fmi == "2":
        return element("ScalarVariable", attributes, element(kind, of_kind))
    return element(_TYPES[kind], {**attributes, **of_kind}, shape)


def _dimension_element(size: Dimension, references: Mapping[str, int]) -> Iterator[str]:
    """Yield the line of a Dimension: the reference of a structural size, or a fixed number."""
    known = size.name in references
    number = {"valueReference": str(references[size.name])} if known else {"start": str(size.count)}
    yield from element("Dimension", number)


def _value_references(model: Model, fmi: Fmi) -> dict[str, range]:
    """Value references of each variable by name: of its elements in FMI 2.0, one in FMI 3.0."""
    first = first_reference(model)
    if fmi == "3":
        return {v.name: range(i, i + 1) for i, v in enumerate((*model.variables, TIME), first)}
    ranges = index_ranges(model.variables)
    return {name: range(first + indices.start, first + indices.stop) for name, indices in ranges.items()}


# ---- model structure -------------------------------------------------------------------------------------------


def _model_structure(model: Model, fmi: Fmi) -> Iterator[str]:
    """Yield the lines of ModelStructure."""
    references, states = _value_references(model, fmi), state_outputs(model)
    if fmi == "3":
        running = (TIME, *states, *model.inputs, *model.parameters), csr_array(running_dependencies(model))
        starting = (TIME, *model.inputs, *model.parameters), csr_array(initial_dependencies(model))
        titles = ("Output", "ContinuousStateDerivative", "InitialUnknown", "EventIndicator")
        groups = _model_structure_groups(
            model, titles, "valueReference", references, running=running, starting=starting
        )
        yield from chain.from_iterable(groups)
        return
    sparse = scalar_count(model.variables) <= MOST_DEPENDENCIES
    running = (*states, *model.inputs), jacobian_sparsity(running_outputs(model), (1, 2)) if sparse else None
    starting = (*model.parameters, *model.inputs), jacobian_sparsity(initial_outputs(model), (2, 1)) if sparse else None
    groups = _model_structure_groups(model, ["Unknown"] * 3, "index", references, running=running, starting=starting)
    for title, lines in zip(("Outputs", "Derivatives", "InitialUnknowns"), groups, strict=True):
        if lines:
            yield from element(title, {}, lines)
