"""A mechanism as one writes an FMU: inputs are held during a step."""

from functools import partial

import numpy as np
from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3StepResult

from referee.tasks import TASKS
from referee.way import runge_kutta


class SlaveFmu(Fmi3Slave):
    """Rates by differences and one Euler step, or rates as inputs and a step by Runge and Kutta's rule.

    Inputs are the number of the task, whether the rule is that of Runge and Kutta, and σ, σ̇, σ̈ of the first joint, then
    of the second; outputs are two places and two forces.
    """

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.states, self.before = 0.0, np.zeros(0), np.zeros((3, 2))
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        for name, size, causality in (("inputs", 8, Fmi3Causality.input), ("outputs", 4, Fmi3Causality.output)):
            setattr(self, name, np.zeros(size))
            kind = {"dimensions": [Dimension(str(size))], "setter": partial(setattr, self, name)}
            self.register_variable(Float64(name, causality=causality, **kind))

    def do_step(self, current_time, step_size):
        which, runge, *sigma = self.inputs
        task, given = TASKS[int(which)], np.reshape(sigma, (2, 3)).T
        n, dynamics = len(task.start), task.dynamics("math")
        for k in () if runge else (1, 2):
            given[k] = (given[k - 1] - self.before[k - 1]) / step_size
        if current_time == 0.0:
            self.states = np.ravel([*task.start.values()], "F")
            given[1:] *= runge
        self.before = given
        known = given[:, : len(task.motions)].ravel().tolist()

        def rates(_, y):
            return np.array([*y[n:], *dynamics(*known, *y.tolist())[:n]])

        rule = runge_kutta if runge else lambda rates, t, y, h: y + h * rates(t, y)
        self.states = rule(rates, current_time, self.states, step_size)
        forces = np.resize(dynamics(*known, *self.states)[n:-1], 2)
        self.outputs = np.hstack([self.states[:2], forces])
        return Fmi3StepResult()
