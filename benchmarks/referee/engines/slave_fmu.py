"""A mechanism as one writes an FMU: inputs are held during a step."""

import numpy as np
from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3StepResult

from referee.tasks import TASKS
from referee.way import runge_kutta

OUTPUTS = ("q_0", "q_1", "force_0", "force_1")
INPUTS = tuple(f"sigma{ending}_{k}" for ending in ("", "_dot", "_ddot") for k in range(2))


class SlaveFmu(Fmi3Slave):
    """Rates by differences and one Euler step, or rates as inputs and a step by Runge and Kutta's rule (``runge``)."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.states, self.before = 0.0, np.zeros(0), np.zeros((2, 2))
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        for name in (*INPUTS, *OUTPUTS, "which", "runge"):
            setattr(self, name, 0.0)
            causality = Fmi3Causality.output if name in OUTPUTS else Fmi3Causality.input
            self.register_variable(Float64(name, causality=causality))

    def do_step(self, current_time, step_size):
        task, h = TASKS[int(self.which)], step_size
        n, accelerations, forces = len(task.motions), *task.functions()
        given = np.array([getattr(self, name) for name in INPUTS]).reshape(3, 2)
        if not self.runge:
            given[1] = (given[0] - self.before[0]) / h
            given[2] = (given[1] - self.before[1]) / h
        if current_time == 0.0:
            self.states = np.array([*task.start.values()]).T.ravel()
            given[1:] *= self.runge
        self.before = given[:2]
        known = given[:, :n].ravel()

        def rates(_, y):
            return np.array([*y[len(y) // 2 :], *accelerations(*known, *y)])

        rule = runge_kutta if self.runge else lambda rates, t, y, h: y + h * rates(t, y)
        self.states = rule(rates, current_time, self.states, h)
        found = forces(*known, *self.states, *accelerations(*known, *self.states))
        for name, value in zip(OUTPUTS, [*self.states[:2], *found[:n]], strict=False):
            setattr(self, name, float(value))
        return Fmi3StepResult()
