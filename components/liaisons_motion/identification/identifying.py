"""``identify``: parameters from measurements, with their covariance."""

from __future__ import annotations

import inspect
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from liaisons import System
from liaisons.base.arguments import (
    as_path,
    check_choice,
    check_finite,
    check_integer,
    check_positive,
    merged_start_values,
    name_dictionary,
    name_list,
    shown,
)
from liaisons.base.array_names import array_and_index
from liaisons.base.files import file_beside, read_toml_arguments
from liaisons.errors import IdentificationError, suggestion
from liaisons.language import Variable
from liaisons.library import Target
from liaisons.mechanics import Model
from liaisons_motion.identification.fits import Fit
from liaisons_motion.identification.measurements import Measurements, measurements, noise_levels
from liaisons_motion.identification.minimising import LOSSES
from liaisons_motion.identification.problems import TIME_OFFSET, FittingProblem, Floats, Prior, smoothed_values
from liaisons_motion.identification.searching import parameter_estimate
from liaisons_motion.right_hand_sides import continuous_model

Range = tuple[float | None, float | None]
Instants = Mapping[str, tuple[ArrayLike, float]]
Data = Any

_EXAMPLES = {"subject": '"Pendulum"', "data": '"measured.csv"', "unknown": '["length", "theta_0"]'}


def identify(
    subject: Target | Model | System,
    data: Data,
    /,
    unknown: str | Sequence[str],
    noise: float | Mapping[str, float] | None = None,
    *,
    each: str | Sequence[str] = (),
    bounds: Mapping[str, Range] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
    loss: Literal["linear", "soft_l1"] = "linear",
    operators: Mapping[str, Target] | None = None,
    measured: str | Iterable[str] | None = None,
    ignore: str | Iterable[str] = (),
    instants: Instants | Sequence[Instants] = (),
    smoothing: float | None = None,
    start_time: float | None = None,
    segments: int | None = None,
    time_limit: float = 120.0,
    tolerance: float = 1e-10,
    start_values: Mapping[str, Any] | None = None,
    **keywords: Any,
) -> Fit:
    """Estimate parameters and start values from measurements, with standard errors.

    ::

        fit = identify("Pendulum", "measured.csv", unknown=["length", "friction", "theta_0"], noise={"theta": 0.01})
        fit.values, fit.standard_errors, fit.intervals(), fit.correlation
        print(table(fit.verify()))

    Columns named like outputs are fitted; columns named like inputs or active coordinates drive the motion.

    :param subject: name, file or class of a component; a model; or a system, whose names are ``"swing.theta"``.
    :param data: path of a CSV file, :class:`liaisons.Result`, mapping of names to arrays; or a list of these, one an
        experiment.
    :param unknown: parameters, start values, inputs at rest, parameters of operators (``"length.amplitude"``), and
        ``"time_offset"`` [s], by which clocks of the measurements are slow; an array by its name or by elements.
    :param noise: standard deviation of the measurements, one for all or by signal; None: estimated from residuals.
    :param each: unknowns that differ between the experiments.
    :param bounds: (low, high) of unknowns, None for no bound; domains of the variables hold anyway.
    :param prior: (mean, standard deviation) of unknowns before the measurements.
    :param loss: ``"linear"``: least squares; ``"soft_l1"`` is for outliers, see SciPy's ``least_squares``.
    :param operators: active coordinate -> operator that moves it.
    :param measured: outputs that are fitted; None: all that have a column.
    :param ignore: columns that are not read.
    :param instants: ``{"gap_impacts": ([0.45, 1.17, 1.75], 0.002)}``: the instants [s] of the first impacts of ``gap``,
        not-a-number for one that was missed, and their standard deviation; a list of these for several experiments.
        A table needs no more than ``time`` with them.
    :param smoothing: distance [s] between knots of the splines of driving columns; None: one knot a value.
    :param start_time: time of the start values [s]; None: where each table begins.
    :param segments: of multiple shooting, for chaotic motions and poor start values; None: chosen if needed.
    :param time_limit: duration of the search [s]; the error at its end contains the fit that was reached.
    :param tolerance: of the steps, relative.
    :param start_values: known values, and values of unknowns at which the search begins; default: declared values,
        and for start values of measured outputs the first measurements.
    :param keywords: further start values; a name that is also a setting is the setting.
    :returns: the fit; ``fit.verify()`` tests it.
    :raises IdentificationError: for a bad argument or column, and if least squares do not converge; then the error
        has the fit reached so far as ``fit``.
    :raises SimulationError: if the motion cannot start.
    """
    names = name_list("unknown", unknown, IdentificationError)
    values = dict(merged_start_values("identify", start_values, keywords, IdentificationError))
    _check_settings(loss, tolerance, time_limit, start_time, segments)
    deadline = time.monotonic() + time_limit
    continuous = continuous_model(
        subject, "a fit", "compare runs of its FMU by sweep()", IdentificationError, allow_contacts=True
    )
    model = continuous.model
    experiments = measurements(
        data, model, measured=measured, unknown=names, ignore=ignore, smoothing=smoothing, instants=instants
    )
    experiments = tuple(_begun(one, start_time) for one in experiments)
    variables = continuous.moved_by(operators, IdentificationError).variables
    variables[TIME_OFFSET] = Variable(TIME_OFFSET, "s", "delay of the clock", "parameter", "fixed", start=0.0)
    unknowns = _Unknowns(variables, len(experiments), names, name_list("each", each, IdentificationError))
    starts = unknowns.numbers_by_element("start_values", values)
    limits = unknowns.limits(
        {} if bounds is None else bounds, min(float(e.times[0]) - e.start_time for e in experiments)
    )
    started = _started_outputs(model)
    start = np.array([starts.get(name, variables[name].starts[0]) for _, name in unknowns.labels], dtype=float)
    _begin_at_measurements(start, experiments, unknowns, limits, {n: o for n, o in started.items() if n not in starts})
    problem = FittingProblem(
        subject=subject,
        measurements=experiments,
        names=tuple(label for label, _ in unknowns.labels),
        units=tuple(variables[name].unit for _, name in unknowns.labels),
        columns=unknowns.columns,
        start=start,
        limits=limits,
        noise=_noise_levels(noise, experiments),
        priors=tuple(unknowns.priors({} if prior is None else prior)),
        loss=loss,
        starts=started,
        start_values={name: value for name, value in starts.items() if name not in unknowns.names},
        operators=operators or {},
        tolerance=tolerance,
        deadline=deadline,
    )
    return _fit(problem, segments, model.name)


def _fit(problem: FittingProblem, segments: int | None, title: str) -> Fit:
    """Solve a problem.

    :raises IdentificationError: if it has no solution, or least squares do not converge.
    """
    _check_solvable(problem)
    fit = Fit(parameter_estimate(problem, segments))
    if message := fit.estimate.minimum.message:
        words = "give other start values, or segments of multiple shooting"
        raise IdentificationError(f"{title}: {message} {words}", fit)
    return fit


def _check_settings(
    loss: str, tolerance: float, time_limit: float, start_time: float | None, segments: int | None
) -> None:
    """Check the settings that are numbers or a choice.

    :raises IdentificationError: naming one that is not allowed.
    """
    check_choice("loss", loss, tuple(LOSSES), IdentificationError)
    check_positive("tolerance", tolerance, IdentificationError)
    check_positive("time_limit", time_limit, IdentificationError)
    if start_time is not None:
        check_finite("start_time", start_time, IdentificationError)
    if segments is not None:
        check_integer("segments", segments, IdentificationError)


def _begun(experiment: Measurements, start_time: float | None) -> Measurements:
    """An experiment with the time of its start values [s].

    :raises IdentificationError: if the measurements begin before it, or their driving columns after it.
    """
    first = experiment.times[0]
    begin = float(first) if start_time is None else start_time
    if experiment.inputs and first > begin:
        words = f"drives from {first:g} s on, after start_time = {begin:g}; give start_time, or leave it out"
        raise IdentificationError(f"{experiment.title}: {next(iter(experiment.inputs))} {words}")
    if first < begin:
        raise IdentificationError(f"{experiment.title}: time begins at {first:g} s, before start_time = {begin:g}")
    return replace(experiment, start_time=begin)


def _started_outputs(model: Model) -> dict[str, str]:
    """Name of a start value -> the output that begins with it."""
    outputs = {variable.name for variable in model.outputs}
    return {p.name: output for p in model.parameters if (output := _output_of_start_value(p.name)) in outputs}


def _noise_levels(noise: Any, experiments: Sequence[Measurements]) -> Any:
    """Standard deviations of the signals of each experiment; None where they are to be estimated."""
    if noise is None and any(experiment.signals for experiment in experiments):
        return None
    return tuple(noise_levels(noise, experiment) for experiment in experiments)


def _begin_at_measurements(
    start: Floats,
    experiments: Iterable[Measurements],
    unknowns: _Unknowns,
    limits: Floats,
    started: Mapping[str, str],
) -> None:
    """Begin the search of start values at what was measured first.

    :param started: start values -> outputs that begin with them.
    """
    for experiment, columns in zip(experiments, unknowns.columns, strict=True):
        for name, column in columns.items():
            if name in started and experiment.times[0] == experiment.start_time:
                near = smoothed_values(experiment, started[name], [0], start[[column]])
                start[column] = np.clip(near, *limits[:, column])[0]


def identify_from_file(path: Path | str) -> Fit:
    """Run :func:`liaisons.identify` with the arguments of a TOML file.

    ::

        subject = "Pendulum"
        data = "measured.csv"
        unknown = ["length", "friction", "theta_0"]
        noise = { theta = 0.01 }
        start_values = { friction = 0.1 }

    :param path: the file; relative paths in it start from its folder.
    :raises IdentificationError: for invalid TOML, an unknown key, and as :func:`liaisons.identify` does.
    """
    path = as_path("path", path, IdentificationError)
    keys = {*inspect.signature(identify).parameters} - {"keywords"}
    arguments = read_toml_arguments(path, keys, _EXAMPLES, IdentificationError)
    subject = file_beside(path, str(arguments.pop("subject")))
    data = [file_beside(path, name) for name in name_list(f"{path}: data", arguments.pop("data"), IdentificationError)]
    return identify(System.from_ssp(subject) if subject.endswith(".ssp") else subject, data, **arguments)


class _Unknowns:
    """The unknowns element by element, and their indices in the vector of unknowns.

    :ivar labels: of each unknown, its name in the fit and the name of its variable.
    :ivar columns: for each experiment, name of a variable -> index.
    """

    def __init__(
        self, variables: Mapping[str, Variable], experiments: int, names: Sequence[str], each: Sequence[str]
    ) -> None:
        self.variables = variables
        self.names = [element for name in names for element in self._element_names("unknown", name)]
        own = [element for name in each for element in self._element_names("each", name)]
        for name in self.names:
            if self.names.count(name) > 1:
                raise IdentificationError(f"unknown: {name} is given twice; leave one out")
        for name in own:
            if name not in self.names:
                raise IdentificationError(f"each: {name} is not unknown{suggestion(name, self.names)}")
        if experiments == 1:
            own = []
        self.labels = [(name, name) for name in self.names if name not in own]
        shared = {name: i for i, (name, _) in enumerate(self.labels)}
        columns = []
        for number in range(1, experiments + 1):
            columns.append({**shared, **{name: len(self.labels) + i for i, name in enumerate(own)}})
            self.labels += [(f"{name} ({number})", name) for name in own]
        self.columns = tuple(columns)

    def _element_names(self, label: str, name: str) -> list[str]:
        """Names of the elements of an array; of a scalar its own name."""
        elements = [one for one in self.variables if name in {one, array_and_index(one)[0]}]
        if not elements:
            raise IdentificationError(f"{label}: no value is called {name!r}{suggestion(name, self.variables)}")
        return elements

    def numbers_by_element(self, label: str, values: Mapping[str, Any]) -> dict[str, float]:
        """Numbers by element, from a mapping by names of arrays or elements."""
        numbers: dict[str, float] = {}
        for name, value in values.items():
            elements = self._element_names(label, name)
            several = np.ravel(value).tolist()
            if len(several) not in {1, len(elements)}:
                raise IdentificationError(f"{label}: {name} has {len(several)} numbers; give 1 or {len(elements)}")
            for one, number in zip(elements, several * (len(elements) // len(several)), strict=True):
                check_finite(f"{label}: {one}", number, IdentificationError)
                if not self.variables[one].allows(number):
                    domain = self.variables[one].domain()
                    raise IdentificationError(f"{label}: {one} = {number:g}: must be {domain}")
                numbers[one] = number
        return numbers

    def _pairs_of_unknowns(self, label: str, values: Mapping[str, Any]) -> Iterator[tuple[int, str, Any]]:
        """Yield index, name and pair of numbers of each unknown in a mapping by names of arrays or elements."""
        for name, value in name_dictionary(label, values, IdentificationError).items():
            elements = self._element_names(label, name)
            if missing := [element for element in elements if element not in self.names]:
                raise IdentificationError(f"{label}: {missing[0]} is not unknown{suggestion(missing[0], self.names)}")
            if not isinstance(value, (tuple, list)) or len(value) != 2:
                raise IdentificationError(f"{label}: {name} = {shown(value)}: give two numbers")
            for i, (text, variable) in enumerate(self.labels):
                if variable in elements:
                    yield i, text, value

    def limits(self, bounds: Mapping[str, Range], delay: float) -> Floats:
        """Lower and upper bounds, shape (2, unknowns); by default the domains of the variables.

        :param delay: time between the start of the motion and the first measurement [s].
        """
        variables = [self.variables[name] for _, name in self.labels]
        ends = [(-delay if v.name == TIME_OFFSET else v.minimum, v.maximum) for v in variables]
        for i, name, (low, high) in self._pairs_of_unknowns("bounds", bounds):
            for end in (low, high):
                if end is not None:
                    check_finite(f"bounds: {name}", end, IdentificationError)
            if None not in (low, high) and not low < high:
                raise IdentificationError(f"bounds: {name} = {shown((low, high))}: the first must be less")
            least, most = ends[i]
            ends[i] = least if low is None else low, most if high is None else high
        limits = np.array(ends, dtype=float).T  # None becomes not-a-number
        return np.where(np.isnan(limits), [[-np.inf], [np.inf]], limits)

    def priors(self, prior: Mapping[str, tuple[float, float]]) -> Iterator[Prior]:
        """Yield the priors of unknowns."""
        for i, name, (mean, deviation) in self._pairs_of_unknowns("prior", prior):
            check_finite(f"prior: mean of {name}", mean, IdentificationError)
            check_positive(f"prior: standard deviation of {name}", deviation, IdentificationError)
            yield Prior(i, mean, deviation)


def _output_of_start_value(name: str) -> str:
    """Name of the output whose start value a parameter is: ``"theta[1]"`` for ``"theta_0[1]"``; else empty."""
    base, _ = array_and_index(name)
    return base.removesuffix("_0") + name[len(base) :] if base.endswith("_0") else ""


def _check_solvable(problem: FittingProblem) -> None:
    """Raise an IdentificationError without unknowns, for fewer numbers than unknowns, or starts outside bounds."""
    count = len(problem.names)
    if not count:
        raise IdentificationError("unknown: nothing is unknown; name one value at least")
    numbers = problem.value_count + len(problem.priors)
    if numbers < count:
        raise IdentificationError(f"unknown: {count} values from {numbers} numbers; measure more, or leave some out")
    for name, start, low, high in zip(problem.names, problem.start, *problem.limits, strict=True):
        if not low <= start <= high:
            raise IdentificationError(f"{name} starts at {start:g}, outside of {low:g} to {high:g}; start elsewhere")
