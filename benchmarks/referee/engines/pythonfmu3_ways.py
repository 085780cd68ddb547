"""FMUs as people write them, by pythonfmu3: positions in and differences inside, or rates as inputs, too."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pythonfmu3
from fmpy.simulation import instantiate_fmu
from numpy.typing import NDArray

from referee.task import Task
from referee.tasks import TASKS
from referee.way import CannotError, Run, Way, march


@cache
def _built() -> tuple[Any, str]:
    path = pythonfmu3.FmuBuilder.build_FMU(Path(__file__).with_name("slave_fmu.py"), dest=tempfile.mkdtemp())
    return fmpy.read_model_description(path, validate=False), str(fmpy.extract(path))


def written(task: Task, step: float, *, runge: bool) -> Run:
    if task.lagrange is None:
        raise CannotError("not written")
    description, folder = _built()
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    n, fmu = len(task.motions), instantiate_fmu(folder, description, fmi_type="CoSimulation")
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.setFloat64([reference["which"], reference["runge"]], [float(TASKS.index(task)), float(runge)])
    inputs = [reference[f"sigma{ending}_{k}"] for ending in ("", "_dot", "_ddot") for k in range(n)]

    def advance(t: float) -> None:
        fmu.setFloat64(inputs, task.sigma(t + runge * step / 2).ravel().tolist())
        fmu.doStep(t, step)

    def read() -> tuple[NDArray, NDArray | None]:
        forces = np.array(fmu.getFloat64([reference[f"force_{k}"] for k in range(n)])) if runge else None
        return np.array(fmu.getFloat64([reference[f"q_{k}"] for k in range(len(task.asked))])), forces

    try:
        return march(replace(task, carrier=0.0), step, advance, read)
    finally:
        fmu.freeInstance()


PAGE = "https://github.com/StephenSmith25/PythonFMU3"
WAYS = (
    Way("pythonfmu3", "positions in, Euler", PAGE, partial(written, runge=False)),
    Way("pythonfmu3", "rates in, Runge and Kutta", PAGE, partial(written, runge=True)),
)
