"""modelDescription.xml of FMI 3.0: arrays are variables, structural sizes are structural parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain

from scipy.sparse import csr_array

from liaisons.fmu.dependencies import initial_dependencies, running_dependencies, shown_states, states_that_jump
from liaisons.fmu.description import (
    default_experiment,
    general_attributes,
    integer_attributes,
    log_categories,
    model_structure_groups,
    nominals,
    real_attributes,
    root_attributes,
    size_attributes,
    start_attribute,
    unit_definitions,
)
from liaisons.fmu.jumps import states_moved_along
from liaisons.fmu.layout import TIME, first_reference, settings, size_references
from liaisons.fmu.markup import document, element
from liaisons.language.variables import Dimension, NumberType
from liaisons.mechanics.model import Model

_STATES = ("canGetAndSetFMUState", "canSerializeFMUState")
_BOTH = dict.fromkeys((*_STATES, "providesDirectionalDerivatives", "providesAdjointDerivatives"), "true")
_CO_SIMULATION = {
    "canHandleVariableCommunicationStepSize": "true",
    "maxOutputDerivativeOrder": "1",
    **dict.fromkeys(("providesIntermediateUpdate", "canReturnEarlyAfterIntermediateUpdate", "hasEventMode"), "true"),
    **_BOTH,
}
_TYPES: dict[NumberType, str] = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}


def model_description3(model: Model, *, token: str, arrays: bool = True) -> bytes:
    """Return modelDescription.xml of FMI 3.0 of a native FMU.

    :param token: that of the binary, ``"{...}"``.
    :param arrays: False: the elements of arrays are variables, and structural sizes constants.
    """
    attributes = root_attributes(model, "3.0", instantiationToken=token)
    model = model if arrays else replace(model.flat(), programs=())
    return document(element("fmiModelDescription", attributes, _root_children(model)))


def _root_children(model: Model) -> Iterator[str]:
    """Yield the lines of the root's children."""
    identifier = {"modelIdentifier": model.name}
    instants = {"mightReturnEarlyFromDoStep": "true"} if model.events.numel_out(0) or model.indicators else {}
    completes = {"needsCompletedIntegratorStep": "true"} if model.indicators else {}
    yield from element("ModelExchange", identifier | completes | _BOTH)
    yield from element("CoSimulation", identifier | _CO_SIMULATION | instants)
    yield from unit_definitions((*model.variables, TIME))
    yield from log_categories()
    yield from default_experiment(model)
    yield from element("ModelVariables", {}, _model_variables(model))
    yield from element("ModelStructure", {}, _model_structure(model))


# ---- variables -------------------------------------------------------------------------------------------------


def _model_variables(model: Model) -> Iterator[str]:
    """Yield the structural sizes, the variables, the time and the settings."""
    reference = _value_references(model)
    sizes = nominals(model)
    jumping = states_that_jump(model) | states_moved_along(model)
    reference_of_size = size_references(model)
    for size in model.dimensions:
        sizes_arrays = any(variable.dimension == size for variable in model.variables)
        kind = ("structuralParameter", "fixed") if sizes_arrays else ("local", "constant")
        attributes = size_attributes(size, reference_of_size[size.name], *kind)
        yield from element("UInt64", attributes | dict.fromkeys(("min", "max", "start"), str(size.count)))
    for variable in model.variables:
        attributes = general_attributes(variable, reference[variable.name])
        attributes |= real_attributes(variable, max(sizes.get(variable.name, (1.0,)))) | start_attribute(variable)
        if variable.derivative_of:
            attributes["derivative"] = str(reference[variable.derivative_of])
        if variable.name in jumping:
            attributes["reinit"] = "true"
        if variable.variability == "continuous":
            attributes["intermediateUpdate"] = "true"
        size = variable.dimension
        shape = element("Dimension", _dimension_attributes(size, reference_of_size)) if size else ()
        yield from element(_TYPES[variable.type], attributes, shape)
    attributes = general_attributes(TIME, reference[TIME.name]) | real_attributes(TIME, 1.0)
    del attributes["initial"]
    yield from element("Float64", attributes | {"causality": "independent"})
    for reference_of_setting, setting in settings(model, "3").items():
        attributes = general_attributes(setting.variable, reference_of_setting)
        yield from element("Int32", attributes | integer_attributes(setting))


def _dimension_attributes(size: Dimension, references: Mapping[str, int]) -> dict[str, str]:
    """Return the reference of a structural size, or a fixed number."""
    return {"valueReference": str(references[size.name])} if size.name in references else {"start": str(size.count)}


def _value_references(model: Model) -> dict[str, int]:
    """Return the value reference of each variable."""
    return {variable.name: i for i, variable in enumerate((*model.variables, TIME), first_reference(model))}


# ---- model structure -------------------------------------------------------------------------------------------


def _model_structure(model: Model) -> Iterator[str]:
    """Yield the unknowns in ModelStructure."""
    running = (TIME, *shown_states(model), *model.inputs, *model.parameters), csr_array(running_dependencies(model))
    starting = (TIME, *model.inputs, *model.parameters), csr_array(initial_dependencies(model))
    titles = ("Output", "ContinuousStateDerivative", "InitialUnknown", "EventIndicator")
    references = {name: [reference] for name, reference in _value_references(model).items()}
    groups = model_structure_groups(model, titles, "valueReference", references, running=running, starting=starting)
    yield from chain.from_iterable(groups)
