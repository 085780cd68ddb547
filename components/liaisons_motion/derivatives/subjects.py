"""From a component, an FMU or a system to its motion as a function of values."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from liaisons import fmu_path
from liaisons.base.arguments import check_finite, check_positive, float_array, name_dictionary, name_list
from liaisons.base.array_names import array_and_index
from liaisons.base.arrays import Floats
from liaisons.errors import ComponentError, SimulationError, suggestion
from liaisons.language import Variable
from liaisons.library import Target, component
from liaisons.mechanics import Model
from liaisons_motion.derivatives.functions import motion_functions
from liaisons_motion.derivatives.motion import ROUNDING_OF_INPUTS, DifferentiableMotion, check_domain, recorded_times
from liaisons_motion.right_hand_sides import DEGREE, ContinuousModel, continuous_model

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

    from liaisons import System
    from liaisons_motion.derivatives.contact_motion import ContactMotion
    from liaisons_motion.derivatives.fmus import FmuMotion

Subject: TypeAlias = "Target | Model | System"
Motion: TypeAlias = "DifferentiableMotion | ContactMotion | FmuMotion"


def motion_of(
    subject: Subject,
    by: str | Iterable[str],
    times: ArrayLike,
    *,
    start_time: float = 0.0,
    record: str | Iterable[str] | None = None,
    operators: Mapping[str, Target] | None = None,
    inputs: Mapping[str, PPoly] | None = None,
    start_values: Mapping[str, ArrayLike] | None = None,
    tolerance: float = 1e-10,
) -> Motion:
    """A motion as a function of some of its values.

    :param subject: a component by its name, file or class; a model; an FMU; a system, with names such as
        ``"swing.theta"``.
    :param by: values that it is a function of: start values, parameters, inputs at rest, and parameters of operators,
        ``"length.amplitude"``; an array under its own name or element by element.
    :param times: recorded [s], ascending.
    :param start_time: of the motion [s].
    :param record: outputs; coordinates and momenta if None.
    :param operators: active coordinate -> operator that moves it, by its name, file or class.
    :param inputs: input or active coordinate -> piecewise polynomial of time, of degree five at most; an active
        coordinate takes its rate and acceleration from it, too.
    :param start_values: of these and further values, where they differ from the declared ones.
    :param tolerance: of a step, relative to the size of each state; kept with a margin.
    :raises ComponentError: for an unknown name, with the nearest one.
    :raises SimulationError: for a bad number, or a system that cannot be flattened.
    """
    found = _continuous_model_or_runs(subject)
    if not isinstance(found, ContinuousModel):
        options = {"start_time": start_time, "record": record, "inputs": inputs, "start_values": start_values}
        return _motion_of_runs(found, by, recorded_times(times, start_time), operators, tolerance=tolerance, **options)
    moved = found.moved_by(operators)
    driven = name_dictionary("inputs", inputs or {})
    check_finite("start_time", start_time)
    check_positive("tolerance", tolerance)
    _refuse_inputs(moved.model, driven, moved.moving)
    variables = _variables_at_rest(moved, driven)
    given = {**moved.starts, **name_dictionary("start_values", start_values or {})}
    values = _values_by_element(moved.model, given, variables)
    names = (element for name in name_list("by", by) for element in _variable_names(moved.model, name, variables))
    own = {name: variables[name] for name in names}
    times = recorded_times(times, start_time)
    options = {"times": times, "start_time": float(start_time), "tolerance": tolerance}
    return _motion_of_equations(moved, own, values, driven, record, **options)


def _continuous_model_or_runs(subject: Subject) -> ContinuousModel | System | Path:
    """Model whose equations are differentiated, or the system or FMU whose runs are, for lack of these."""
    task, remedy = "a motion with exact derivatives", "give its class or .fmu file, whose runs are differentiated"
    try:
        return continuous_model(subject, task, remedy, allow_contacts=True, allow_fmus=True)
    except (SimulationError, ComponentError):
        runs = _subject_of_runs(subject)
        if runs is None:
            raise
        return runs


def _variables_at_rest(moved: ContinuousModel, driven: Collection[str]) -> dict[str, Variable]:
    """Variables that can be set, by name, without inputs that are driven and the rates of active coordinates."""
    moving = {x for a in moved.model.active if a.value in driven for x in (a.value, a.rate, a.acceleration)}
    return {name: variable for name, variable in moved.variables.items() if name not in moving | {*driven}}


def _recorded_signals(moved: ContinuousModel, record: str | Iterable[str] | None) -> list[str]:
    """Names of the scalar outputs to be recorded; coordinates and momenta if None."""
    if record is None:
        return moved.coordinates_and_momenta
    outputs = [variable.name for variable in moved.model.outputs]
    return [element for name in name_list("record", record) for element in _element_names(name, outputs)]


def _motion_of_equations(
    moved: ContinuousModel,
    own: Mapping[str, Variable],
    values: Mapping[str, float],
    driven: Mapping[str, PPoly],
    record: str | Iterable[str] | None,
    **options: Any,
) -> DifferentiableMotion | ContactMotion:
    """Motion of a model as a function of its own variables.

    :param values: of these and others, where they differ from the declared ones.
    :param options: times, start time and tolerance.
    """
    model, signals = moved.model, _recorded_signals(moved, record)
    shared = {name: value for name, value in values.items() if name not in own}
    functions = motion_functions(
        model,
        moving=tuple(moved.moving.items()),
        names=tuple(own),
        shared=tuple(shared),
        record=tuple(signals),
        driven=tuple(driven),
    )
    breaks, table, jumps = _table([*shared.values()], driven, options["start_time"])
    outputs = {variable.name: variable for variable in model.outputs}
    described = {**own, **{name: outputs[name] for name in signals}}
    motion = DifferentiableMotion(
        model.name,
        functions,
        own,
        np.array([values.get(name, variable.starts[0]) for name, variable in own.items()]),
        table=table,
        breaks=breaks,
        jumps=jumps,
        signals=tuple(signals),
        units={name: variable.unit for name, variable in described.items()},
        **options,
    )
    if functions.contacts is None:
        return motion
    from liaisons_motion.derivatives.contact_motion import with_contacts

    return with_contacts(motion, tuple(shared), tuple(driven))


def _motion_of_runs(
    subject: System | Path,
    by: str | Iterable[str],
    times: Floats,
    operators: object,
    **options: Any,
) -> FmuMotion:
    """Motion of FMUs whose runs are differentiated.

    :raises SimulationError: if operators are given, too.
    """
    if operators:
        raise SimulationError("operators: add an operator that moves an FMU to a System with it") from None
    from liaisons_motion.derivatives.fmus import fmu_motion

    return fmu_motion(subject, by, times, **options)


def _values_by_element(
    model: Model, given: Mapping[str, ArrayLike], variables: Mapping[str, Variable]
) -> dict[str, float]:
    """Values by the names of scalars, each in its domain."""
    values: dict[str, float] = {}
    for name, value in given.items():
        elements = _variable_names(model, name, variables)
        _refuse_operator(name, value)
        array = float_array(name, value)
        if array.shape not in ((), (len(elements),)):
            raise SimulationError(f"{model.name}: {name} has shape {array.shape}; it has {len(elements)} elements")
        values |= dict(zip(elements, np.broadcast_to(array, len(elements)).tolist(), strict=True))
    for name, value in values.items():
        check_domain(model.name, name, variables[name], value)
    return values


def _table(shared: Sequence[float], driven: Mapping[str, PPoly], start_time: float) -> tuple[Floats, Floats, Floats]:
    """What the motion reads of its inputs.

    :param shared: values that do not change.
    :returns: breaks [s]; a row for each of values, start time, break and coefficients of the polynomials behind it; and
        those breaks [s] at which an input or its rate jumps.
    """
    breaks = np.unique([x for polynomial in driven.values() for x in polynomial.x] or [start_time])
    columns = [np.full(len(breaks), number) for number in (*shared, start_time)]
    columns += [breaks, *(_interval_coefficients(polynomial, breaks) for polynomial in driven.values())]
    table = np.ascontiguousarray(np.column_stack(columns))
    sides = (
        [_interval_coefficients(p, np.nextafter(breaks, end))[:, :2] for end in (-np.inf, np.inf)]
        for p in driven.values()
    )
    jumped = [np.abs(after - before) > ROUNDING_OF_INPUTS * (1 + np.abs(before)) for before, after in sides]
    jumps = breaks[1:-1][np.any(np.hstack(jumped), axis=1)[1:-1]] if driven else breaks[:0]
    return breaks, table, jumps


def _subject_of_runs(subject: Subject) -> System | Path | None:
    """System or FMU whose runs are to be differentiated, for lack of equations or because it samples; else None."""
    from liaisons import System

    if isinstance(subject, (System, Model)):
        return subject if isinstance(subject, System) else None
    if isinstance(subject, (str, Path)) and Path(subject).suffix == ".fmu":
        return Path(subject)
    return fmu_path(subject) if component(subject).is_sampled() else None


def _refuse_operator(name: str, value: object) -> None:
    """Raise a SimulationError for an operator in place of a number."""
    if isinstance(value, (int, float, str, list, tuple, np.ndarray)):
        return
    from liaisons import OperatorFmu

    if isinstance(value, OperatorFmu):
        raise SimulationError(f"{name}: name its operator in operators={{{name!r}: {value.fmu.stem!r}}}")


def _element_names(name: str, names: Iterable[str]) -> list[str]:
    """Names of the elements of an array; of another variable its own name."""
    return [element for element in names if element != name and array_and_index(element)[0] == name] or [name]


def _variable_names(model: Model, name: str, variables: Mapping[str, Variable]) -> list[str]:
    """Names of the scalar variables that a name stands for.

    :raises ComponentError: if there are none.
    """
    elements = _element_names(name, variables)
    if elements[0] not in variables:
        raise ComponentError(f"{model.name} has no value {name!r} to set{suggestion(name, variables)}")
    return elements


def _refuse_inputs(model: Model, driven: Mapping[str, Any], moving: Mapping[str, Model]) -> None:
    """Raise an error for an unknown input, one that an operator moves, or one that is no polynomial.

    :raises ComponentError: and :class:`SimulationError` for the last one.
    """
    names = [v.name for v in model.inputs]
    for name, polynomial in driven.items():
        if name not in names:
            raise ComponentError(f"inputs: {model.name} has no input {name!r}{suggestion(name, names)}")
        if name in moving:
            raise ComponentError(f"inputs: {name} is moved by an operator, too; leave one out")
        shape = np.shape(getattr(polynomial, "c", ()))
        if len(shape) != 2 or shape[0] > DEGREE + 1:
            raise SimulationError(f"inputs: {name} = {polynomial!r}: give a PPoly of degree {DEGREE} at most")


def _interval_coefficients(polynomial: PPoly, breaks: Floats) -> Floats:
    """Coefficients of a polynomial in the time since each break, (breaks, DEGREE + 1), constant term first."""
    factors = np.cumprod([1.0, *range(1, DEGREE + 1)])
    rows = [polynomial(breaks, order) if order < len(polynomial.c) else 0 * breaks for order in range(DEGREE + 1)]
    return np.transpose(rows) / factors
