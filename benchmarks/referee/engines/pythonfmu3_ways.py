"""FMUs as people write them, by pythonfmu3: positions in and differences inside, or rates as inputs, too."""

import tempfile
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pythonfmu3

from referee.engines.ours_ways import instance
from referee.tasks import TASKS
from referee.way import CannotError, Model, Way


@cache
def _built():
    return pythonfmu3.FmuBuilder.build_FMU(Path(__file__).with_name("slave_fmu.py"), dest=tempfile.mkdtemp())


class _Model(Model):
    """A task in an FMU at its start."""

    def __init__(self, task, step, runge):
        if task.constraint or task.springs or task.dynamics is None:
            raise CannotError("not written")
        task.dynamics("math")  # derived before the time of steps is taken
        self.task, self.step = replace(task, carrier=0.0), step
        self.which, self.q, self.force = [TASKS.index(task), runge], np.zeros(2), np.zeros(2)
        self.fmu, _, self.reference = instance(_built())
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def read(self, q):
        return q[: len(self.task.asked)]

    def advance(self, t):
        sigma = self.task.sigma(t + self.which[1] * self.step / 2)
        self.fmu.setFloat64([self.reference["inputs"]], [*self.which, *np.resize(sigma.T, 6)])
        self.fmu.doStep(t, self.step)
        self.q, self.force = np.reshape(self.fmu.getFloat64([self.reference["outputs"]], 4), (2, 2))


def written(task, step, runge):
    it = _Model(task, step, runge)
    try:
        return it.march(forces=lambda: it.force[: len(task.motions)] if runge else None)
    finally:
        it.fmu.freeInstance()


PAGE = "https://github.com/StephenSmith25/PythonFMU3"
WAYS = (
    Way("pythonfmu3", "positions in, Euler", PAGE, partial(written, runge=False)),
    Way("pythonfmu3", "rates in, Runge and Kutta", PAGE, partial(written, runge=True)),
)
