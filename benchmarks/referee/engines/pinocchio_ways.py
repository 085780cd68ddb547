"""Pinocchio: rates overwritten in its semi-implicit step, and hybrid dynamics."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from liaisons import PinocchioOperator
from referee.task import Task
from referee.way import CannotError, Run, Way, march


class _Model:
    """A task in Pinocchio at its start."""

    def __init__(self, task: Task) -> None:
        if task.constraint:
            raise CannotError(f"no {task.constraint}")
        self.task = task
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "task.xml"
            path.write_text(task.mjcf(1e-3), encoding="utf-8")
            self.model = pin.buildModelFromMJCF(str(path))
        self.q, self.v = pin.neutral(self.model), np.zeros(self.model.nv)
        self.index = {name: self.model.joints[self.model.getJointId(name)] for name in self.model.names}
        for name, (place, rate) in task.start.items():
            joint = self.index[name]
            if name == "attitude":
                self.v[joint.idx_v : joint.idx_v + 3] = [task.start_values[f"omega_{a}_0"] for a in "xyz"]
            else:
                self.q[joint.idx_q], self.v[joint.idx_v] = place, rate

    def asked(self) -> NDArray:
        if self.task.asked[0] == ("attitude",):
            x, y, z, w = self.q[self.index["attitude"].idx_q :][:4]
            return np.array([w, x, y, z])
        return np.array([sum(self.q[self.index[name].idx_q] for name in names) for names in self.task.asked])

    def torque(self, q: NDArray) -> NDArray:
        """Of springs, which the model does not have."""
        found = np.zeros(self.model.nv)
        for name, stiffness in self.task.springs.items():
            found[self.index[name].idx_v] = -stiffness * q[self.index[name].idx_q]
        return found


def overwritten(task: Task, step: float) -> Run:
    it = _Model(task)
    data = it.model.createData()
    joints = [it.index[name] for name in task.motions]

    def advance(t: float) -> None:
        for joint, sigma, sigma_dot in zip(joints, *task.sigma(t)[:2], strict=True):
            it.q[joint.idx_q], it.v[joint.idx_v] = sigma, sigma_dot
        it.v += step * pin.aba(it.model, data, it.q, it.v, it.torque(it.q))
        it.q = pin.integrate(it.model, it.q, step * it.v)

    return march(task, step, advance, lambda: (it.asked(), None))


def operated(task: Task, step: float) -> Run:
    """``liaisons.PinocchioOperator`` in Runge and Kutta's rule."""
    it = _Model(task)
    side = [1.0]
    motions: dict[str, Any] = {
        name: lambda t, k=k: tuple(task.sigma(t, side[0])[:, k]) for k, name in enumerate(task.motions)
    }
    operator, time = PinocchioOperator(it.model, motions), [0.0]
    it.q, it.v = operator.place(0.0, it.q, it.v)

    def rates(t: float, q: NDArray, v: NDArray) -> NDArray:
        return operator.accelerations(t, q, v, it.torque(q))[0]

    def advance(t: float) -> None:
        model, h = it.model, step
        side[0] = 1.0
        v_1, a_1 = it.v, rates(t, it.q, it.v)
        v_2 = it.v + h / 2 * a_1
        a_2 = rates(t + h / 2, pin.integrate(model, it.q, h / 2 * v_1), v_2)
        v_3 = it.v + h / 2 * a_2
        a_3 = rates(t + h / 2, pin.integrate(model, it.q, h / 2 * v_2), v_3)
        v_4 = it.v + h * a_3
        side[0] = -1.0
        a_4 = rates(t + h, pin.integrate(model, it.q, h * v_3), v_4)
        it.q = pin.integrate(model, it.q, h / 6 * (v_1 + 2 * v_2 + 2 * v_3 + v_4))
        it.v = it.v + h / 6 * (a_1 + 2 * a_2 + 2 * a_3 + a_4)
        time[0] = t + h
        it.q, it.v = operator.place(time[0], it.q, it.v)

    def read() -> tuple[NDArray, NDArray]:
        return it.asked(), np.array(list(operator.accelerations(time[0], it.q, it.v, it.torque(it.q))[1].values()))

    def jump(t: float) -> NDArray:
        side[0] = 1.0
        it.v, impulses = operator.jump(t, it.q, it.v)
        return np.array(list(impulses.values()))

    return march(task, step, advance, read, jump)


PAGE = "docs.ros.org/en/humble/p/pinocchio: Articulated-Body Algorithm (aba), integrate"
WAYS = (
    Way("pin", "rate overwritten", PAGE, overwritten),
    Way("pin", "PinocchioOperator", "docs/reference/api.md", operated),
)
