"""A mechanism as one writes an FMU: inputs are held during a step."""

import numpy as np
from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3StepResult

from referee.tasks import TASKS

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
        n, accelerations, forces = len(task.motions), *task.lagrange.functions
        given = np.array([getattr(self, name) for name in INPUTS]).reshape(3, 2)
        if not self.runge:
            given[1] = (given[0] - self.before[0]) / h
            given[2] = (given[1] - self.before[1]) / h
        if current_time == 0.0:
            self.states = np.array([*task.start.values()]).T.ravel()
            given[1:] *= self.runge
        self.before = given[:2]
        known = given[:, :n].ravel()

        def rates(y):
            return np.array([*y[len(y) // 2 :], *accelerations(*known, *y)])

        y = self.states
        k_1 = rates(y)
        if self.runge:
            k_2 = rates(y + h / 2 * k_1)
            k_3 = rates(y + h / 2 * k_2)
            k_1 = (k_1 + 2 * k_2 + 2 * k_3 + rates(y + h * k_3)) / 6
        self.states = y + h * k_1
        found = forces(*known, *self.states, *accelerations(*known, *self.states))
        for name, value in zip(OUTPUTS, [*self.states[:2], *found[:n]], strict=False):
            setattr(self, name, float(value))
        return Fmi3StepResult()
