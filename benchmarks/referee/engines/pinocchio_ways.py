"""Pinocchio: rates overwritten in its semi-implicit step, and hybrid dynamics."""

import numpy as np
import pinocchio as pin

from liaisons import PinocchioOperator
from referee.way import CannotError, Model, Way, runge_kutta


class _Model(Model):
    """A task in Pinocchio at its start."""

    def __init__(self, task, step):
        if task.constraint:
            raise CannotError(f"MJCF: no {task.constraint}")
        self.model = pin.buildModelFromMJCF(str(task.path("xml")))
        self.data, joints = self.model.createData(), self.model.joints
        self.q, self.v = pin.neutral(self.model), np.zeros(self.model.nv)
        super().__init__(task, step, self.model.names, [j.idx_q for j in joints], [j.idx_v for j in joints])

    def advance(self, _):
        self.v += self.step * pin.aba(self.model, self.data, self.q, self.v, self.torque(self.q))
        self.q = pin.integrate(self.model, self.q, self.step * self.v)

    def attitude(self, q):
        return q[[3, 0, 1, 2]]

    def torque(self, q):
        """Of springs, which the model does not have."""
        found = np.zeros(self.model.nv)
        for name, stiffness in self.task.springs.items():
            found[self.rates[name]] = -stiffness * q[self.places[name]]
        return found


class _Operated(_Model):
    """``liaisons.PinocchioOperator`` in Runge and Kutta's rule."""

    def __init__(self, task, step):
        super().__init__(task, step)
        self.operator, self.end = PinocchioOperator(self.model, self.motions), 0.0

    def accelerations(self, t, q, v):
        return self.operator.accelerations(t, q, v, self.torque(q))

    def advance(self, t):
        self.end = t + self.step

        def rates(at, y):
            """Of the way from q at the begin of the step, and of v."""
            self.side = -1.0 if at == self.end else 1.0
            way, v = y
            return np.array([v, self.accelerations(at, pin.integrate(self.model, self.q, way), v)[0]])

        way, v = runge_kutta(rates, t, np.array([0 * self.v, self.v]), self.step)
        self.q, self.v = self.operator.place(self.end, pin.integrate(self.model, self.q, way), v)

    def forces(self):
        return np.array([*self.accelerations(self.end, self.q, self.v)[1].values()])

    def jump(self, t):
        self.side = 1.0
        self.v, impulses = self.operator.jump(t, self.q, self.v)
        return np.array([*impulses.values()])


def operated(task, step):
    it = _Operated(task, step)
    return it.march(forces=it.forces, jump=it.jump)


PAGE = "https://github.com/stack-of-tasks/pinocchio/blob/devel/examples/simulation-pendulum.py"
WAYS = (
    Way("pin", "rate overwritten", PAGE, _Model.overwritten),
    Way("pin", "PinocchioOperator", "docs/reference/api.md", operated),
)
