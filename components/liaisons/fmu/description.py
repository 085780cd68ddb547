"""modelDescription.xml of FMI 2.0: what an importer learns about a component before it loads any code.

A variable's value reference is its place in :attr:`Model.variables`; its index, which ModelStructure counts in, is
that plus one.  Dependencies are the sparsity patterns of the Jacobians, so they are complete by construction.
"""

from __future__ import annotations

from typing import Literal
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import __version__, units
from liaisons.mechanics.model import Model, Variable

Backend = Literal["native", "python"]
Pattern = NDArray[np.bool_]

RECONSTRUCTION = "input_reconstruction"
SOURCES = ("model.c", "core.c", "solver.c", "fmi2.c")

# What the back ends can do; attributes that are not named are false or 0.
_BOTH = {
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
_MODEL_EXCHANGE = {"completedIntegratorStepNotNeeded": "true", **_BOTH, "providesDirectionalDerivative": "true"}
_CO_SIMULATION = {
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "true",
    "maxOutputDerivativeOrder": "1",
    **_BOTH,
    "providesDirectionalDerivative": "true",
}
_CO_SIMULATION_IN_PYTHON = {
    "needsExecutionTool": "true",
    "canHandleVariableCommunicationStepSize": "true",
    **_BOTH,
}
LOG_CATEGORIES = {
    "logStatusWarning": "what works differently from what was asked for",
    "logStatusDiscard": "values and steps that were refused, and why",
    "logStatusError": "calls that were refused, and why",
}


def model_description(model: Model, *, guid: str, backend: Backend) -> bytes:
    """The model description, the same bytes for the same arguments.

    :param model: the component.
    :param guid: what the binary will compare with, ``"{...}"``.
    :param backend: ``"native"``: model exchange and co-simulation; ``"python"``: what pythonfmu can do.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model.name,
        guid=guid,
        description=model.description,
        generationTool=f"liaisons {__version__}",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    if backend == "native":
        for kind, capabilities in (("ModelExchange", _MODEL_EXCHANGE), ("CoSimulation", _CO_SIMULATION)):
            interface = SubElement(root, kind, {"modelIdentifier": model.name, **capabilities})
            files = SubElement(interface, "SourceFiles")
            for name in SOURCES:
                SubElement(files, "File", name=name)
    else:
        SubElement(root, "CoSimulation", {"modelIdentifier": model.name, **_CO_SIMULATION_IN_PYTHON})
    _unit_definitions(root, model)
    categories = SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=text)
    experiment = {
        "startTime": 0.0,
        "stopTime": model.experiment.stop_time,
        "tolerance": model.experiment.tolerance,
        "stepSize": model.experiment.step_size,
    }
    SubElement(root, "DefaultExperiment", {name: repr(float(value)) for name, value in experiment.items()})
    _model_variables(root, model, backend)
    _model_structure(root, model)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


# ---- units and variables ---------------------------------------------------------------------------------------


def _unit_definitions(root: Element, model: Model) -> None:
    names = sorted({variable.unit for variable in model.variables} - {units.ANY})
    definitions = SubElement(root, "UnitDefinitions") if names else root
    for name in names:
        unit = units.parse(name)
        element = SubElement(definitions, "Unit", name=name)
        SubElement(element, "BaseUnit", {base: str(exponent) for base, exponent in unit.exponents})
        for display, factor in unit.display:
            SubElement(element, "DisplayUnit", name=display, factor=repr(factor))


def _model_variables(root: Element, model: Model, backend: Backend) -> None:
    index = _indices(model)
    nominals = _nominals(model)
    reset = _states_that_jump(model) if backend == "native" else set()
    element = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(model.variables):
        scalar = _scalar_variable(element, reference, variable)
        real = SubElement(scalar, "Real", _real_attributes(variable, nominals.get(variable.name)))
        if variable.derivative_of is not None:
            real.set("derivative", str(index[variable.derivative_of]))
        if variable.name in reset:
            real.set("reinit", "true")
    if model.inputs:
        text = "motion of the inputs inside a communication step: 0 hold, 1 extrapolate, 2 interpolate"
        variable = Variable(RECONSTRUCTION, units.ANY, text, "parameter", "fixed")
        scalar = _scalar_variable(element, len(model.variables), variable)
        SubElement(scalar, "Integer", min="0", max="2", start="1")


def _scalar_variable(parent: Element, reference: int, variable: Variable) -> Element:
    # min and max include the bounds; that a bound itself is forbidden can only be said in words.
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
    return SubElement(parent, "ScalarVariable", attributes)


def _real_attributes(variable: Variable, nominal: float | None) -> dict[str, str]:
    attributes = {}
    if variable.unit != units.ANY:
        unit = units.parse(variable.unit)
        attributes["unit"] = variable.unit
        if unit.display and "rad" in dict(unit.exponents):  # angles are shown in degrees, lengths in metres
            attributes["displayUnit"] = unit.display[0][0]
    numbers = {
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.nominal or nominal,
        "start": variable.start,
    }
    return attributes | {name: repr(float(value)) for name, value in numbers.items() if value is not None}


def _nominals(model: Model) -> dict[str, float]:
    """Sizes of the states at the default start, where they say more than FMI's own default 1."""
    u, k = (ca.DM([v.start or 0.0 for v in variables]) for variables in (model.inputs, model.parameters))
    y, _ = model.start.call([ca.DM(0), u, k])
    sizes = np.asarray(model.nominals.call([ca.DM(0), y, u, k])[0]).ravel()
    named = {state.name: float(f"{size:.6g}") for state, size in zip(model.states, sizes, strict=True)}
    return {name: size for name, size in named.items() if 0 < size < np.inf and size != 1}


def _states_that_jump(model: Model) -> set[str]:
    """States that a jump of the inputs changes, e.g. the work that an impulse brings in."""
    mixed = _pattern(model.jump, 0, 1) != np.eye(len(model.states), dtype=bool)
    jumps = mixed.any(axis=1) | _pattern(model.jump, 0, 2).any(axis=1)
    return {state.name for state, jump in zip(model.states, jumps, strict=True) if jump}


# ---- model structure -------------------------------------------------------------------------------------------


def _model_structure(root: Element, model: Model) -> None:
    index = _indices(model)
    states = [index[state.name] for state in model.states]
    derivatives = [index[state.derivative] for state in model.states]
    outputs = [index[variable.name] for variable in model.outputs if variable.causality == "output"]
    first = len(model.parameters) + len(model.inputs) + 1  # index of the first of model.outputs
    parameters = list(range(1, len(model.parameters) + 1))
    inputs = list(range(len(parameters) + 1, first))

    # While the model runs, and at initialization, where the states follow from parameters and inputs.
    z = model.outputs_function
    running = np.hstack([_pattern(z, 0, 1), _pattern(z, 0, 2)])
    starting = np.hstack([_at_start(model, 2), _at_start(model, 1)])
    calculated = [index[v.name] for v in model.outputs if v.causality == "calculatedParameter"]
    initial = sorted({*outputs, *states, *derivatives, *calculated})

    structure = SubElement(root, "ModelStructure")
    for title, unknowns, knowns, pattern in (
        ("Outputs", outputs, states + inputs, running),
        ("Derivatives", derivatives, states + inputs, running),
        ("InitialUnknowns", initial, parameters + inputs, starting),
    ):
        if unknowns:
            _unknowns(SubElement(structure, title), unknowns, np.array(knowns), pattern[np.array(unknowns) - first])


def _unknowns(parent: Element, unknowns: list[int], knowns: NDArray[np.int_], rows: Pattern) -> None:
    for unknown, row in zip(unknowns, rows, strict=True):
        dependencies = " ".join(str(known) for known in sorted(knowns[row]))
        SubElement(parent, "Unknown", index=str(unknown), dependencies=dependencies)


def _at_start(model: Model, argument: int) -> Pattern:
    """Pattern of ∂z/∂(argument of ``start``) at initialization: 1 for u, 2 for k; the chain rule through y and m."""
    z, start = model.outputs_function, model.start
    direct = _pattern(z, 0, argument + 1)
    through_states = _pattern(z, 0, 1) @ _pattern(start, 0, argument)
    return direct | through_states | (_pattern(z, 0, 4) @ _pattern(start, 1, argument))


def _pattern(function: ca.Function, result: int, argument: int) -> Pattern:
    """Where the Jacobian of a result with respect to an argument can be non-zero; shape (result, argument)."""
    sparsity = function.jac_sparsity(result, argument)
    pattern = np.zeros(sparsity.shape, dtype=bool)
    pattern[tuple(np.array(sparsity.get_triplet(), dtype=int))] = True
    return pattern


def _indices(model: Model) -> dict[str, int]:
    return {variable.name: i for i, variable in enumerate(model.variables, start=1)}
