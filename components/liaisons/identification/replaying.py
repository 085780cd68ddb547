"""Simulation of FMUs at the values of a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np

from liaisons import cosim
from liaisons.base.folders import process_folder
from liaisons.derivatives.fmus import input_functions
from liaisons.identification.estimates import ParameterEstimate
from liaisons.identification.problems import TIME_OFFSET, FittingProblem, Floats, MeasuredMotion
from liaisons.interface import operator, simulate
from liaisons.library import build, fmu_file
from liaisons.mechanics import Model
from liaisons.results import Result

_TOLERANCE = 1e-12
_MARGIN = 1e-6
"""Distance of a communication point from an impact, relative to the duration."""
_MIN_STEPS = 1000
"""Least number of communication steps; motions of operators are interpolated within a step."""


@lru_cache(maxsize=1)  # film and verdicts share the runs
def replays(estimate: ParameterEstimate) -> tuple[Result, ...]:
    """Results of the FMUs for each experiment, with the times of its measurements as communication points."""
    problem, values = estimate.problem, estimate.values.tolist()
    return tuple(
        _run_experiment(
            problem,
            experiment,
            {name: values[column] for name, column in columns.items() if name != TIME_OFFSET},
            [times.ravel() for times in impact_sides(estimate, i).values()],
        )
        for i, (experiment, columns) in enumerate(zip(estimate.objective.experiments, problem.columns, strict=True))
    )


def impact_sides(estimate: ParameterEstimate, experiment: int) -> dict[str, Floats]:
    """Times [s] just before and just after the fitted impacts of an experiment, shape (2, impacts)."""
    chosen, begin = estimate.objective.experiments[experiment], estimate.problem.start_time
    delay = 0.0 if chosen.offset is None else estimate.values[chosen.offset]
    margin = _MARGIN * (chosen.motion.times[-1] - begin)
    return {
        name: np.maximum(times + delay + margin * np.array([[-1], [1]]), begin)
        for name, times in estimate.instants[experiment].items()
    }


def _run_experiment(
    problem: FittingProblem, experiment: MeasuredMotion, values: Mapping[str, float], further: Sequence[Floats]
) -> Result:
    """Simulate the FMUs with the inputs of an experiment, with further communication points."""
    starts = {**problem.start_values, **values}
    data, subject = experiment.measurements, problem.subject
    ends = np.unique(np.concatenate([[problem.start_time], experiment.motion.times, *further]))
    most = np.ptp(ends) / _MIN_STEPS
    inner = [np.linspace(a, b, int(np.ceil((b - a) / most)), endpoint=False) for a, b in pairwise(ends)]
    times = np.append(np.concatenate(inner), ends[-1])
    if isinstance(subject, cosim.System):
        inputs = input_functions(subject.name, subject.parts, data.inputs, single=False)
        return subject.with_start_values(starts).simulate(times=times, tolerance=_TOLERANCE, inputs=inputs)
    for name, target in problem.operators.items():
        own = [start for start in starts if start.startswith(f"{name}.")]
        starts[name] = operator(target, start_values={start.partition(".")[2]: starts.pop(start) for start in own})
    fmu = build(subject, process_folder()) if isinstance(subject, Model) else fmu_file(subject)
    alone = cosim.System(fmu.stem)
    alone.add(fmu.stem, fmu)
    inputs = input_functions(fmu.stem, alone.parts, data.inputs, single=True)
    return simulate(fmu, times=times, tolerance=_TOLERANCE, inputs=inputs, start_values=starts)
