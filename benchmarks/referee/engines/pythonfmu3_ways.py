"""FMUs as people write them, by pythonfmu3: positions in and differences inside, or rates as inputs, too."""

import tempfile
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pythonfmu3

from referee.engines.ours_ways import instance
from referee.tasks import TASKS
from referee.way import CannotError, Way, march


@cache
def _built():
    return pythonfmu3.FmuBuilder.build_FMU(Path(__file__).with_name("slave_fmu.py"), dest=tempfile.mkdtemp())


def written(task, step, *, runge):
    if task.functions is None:
        raise CannotError("not written")
    task.functions()  # derived before the time of steps is taken
    fmu, _, reference = instance(_built())
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.setFloat64([reference["which"], reference["runge"]], [float(TASKS.index(task)), float(runge)])
    n = len(task.motions)
    inputs = [reference[f"sigma{ending}_{k}"] for ending in ("", "_dot", "_ddot") for k in range(n)]

    def advance(t):
        fmu.setFloat64(inputs, task.sigma(t + runge * step / 2).ravel().tolist())
        fmu.doStep(t, step)

    def outputs(name, count):
        return np.array(fmu.getFloat64([reference[f"{name}_{k}"] for k in range(count)]))

    try:
        return march(
            replace(task, carrier=0.0),
            step,
            advance,
            lambda: (outputs("q", len(task.asked)), outputs("force", n) if runge else None),
        )
    finally:
        fmu.freeInstance()


PAGE = "https://github.com/StephenSmith25/PythonFMU3"
WAYS = (
    Way("pythonfmu3", "positions in, Euler", PAGE, partial(written, runge=False)),
    Way("pythonfmu3", "rates in, Runge and Kutta", PAGE, partial(written, runge=True)),
)
