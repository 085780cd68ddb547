"""A fitted motion as FMUs perform it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
from scipy.interpolate import PPoly

from liaisons import cosim
from liaisons.folders import process_folder
from liaisons.identification.estimates import ParameterEstimate
from liaisons.identification.problems import TIME_OFFSET, FittingProblem, MeasuredMotion
from liaisons.interface import operator, simulate
from liaisons.library import build
from liaisons.mechanics import Model
from liaisons.results import Result

_TOLERANCE = 1e-12
_STEPS = 1000
"""Communication steps, at least: what operators do in one is interpolated."""


def replays(estimate: ParameterEstimate) -> tuple[Result, ...]:
    """The motion of each experiment; its times are among the communication points."""
    problem, values = estimate.problem, estimate.values.tolist()
    return tuple(
        _replay(problem, experiment, {name: values[i] for name, i in columns.items() if name != TIME_OFFSET})
        for experiment, columns in zip(estimate.objective.experiments, problem.columns, strict=True)
    )


def _replay(problem: FittingProblem, experiment: MeasuredMotion, values: Mapping[str, float]) -> Result:
    starts = {**problem.start_values, **values}
    data, subject = experiment.measurements, problem.subject
    ends = np.unique([problem.start_time, *experiment.motion.times])
    most = np.ptp(ends) / _STEPS
    inner = [np.linspace(a, b, int(np.ceil((b - a) / most)), endpoint=False) for a, b in pairwise(ends)]
    times = np.append(np.concatenate(inner), ends[-1])
    inputs = {name: _driven(polynomial) for name, polynomial in data.inputs.items()}
    if isinstance(subject, cosim.System):
        return subject.with_start_values(starts).simulate(times=times, tolerance=_TOLERANCE, inputs=inputs)
    for name, target in problem.operators.items():
        own = [start for start in starts if start.startswith(f"{name}.")]
        starts[name] = operator(target, start_values={start.partition(".")[2]: starts.pop(start) for start in own})
    fmu = build(subject, process_folder()) if isinstance(subject, Model) else subject
    return simulate(fmu, times=times, tolerance=_TOLERANCE, inputs=inputs, start_values=starts)


def _driven(polynomial: PPoly) -> Callable[[float], list[float]]:
    """Value, rate and acceleration over time."""
    rates = [polynomial.derivative(n) for n in range(3)]
    return lambda time: [float(rate(time)) for rate in rates]
