"""Pinocchio: rates overwritten in its semi-implicit step, and hybrid dynamics."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from liaisons import PinocchioOperator
from referee.task import Task
from referee.way import CannotError, Places, Run, Way, march


class _Model:
    """A task in Pinocchio at its start."""

    def __init__(self, task: Task) -> None:
        if task.constraint:
            raise CannotError(f"MJCF: no {task.constraint}")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "task.xml"
            path.write_text(task.mjcf(), encoding="utf-8")
            self.model = pin.buildModelFromMJCF(str(path))
        self.q, self.v = pin.neutral(self.model), np.zeros(self.model.nv)
        joints = dict(zip(self.model.names, self.model.joints, strict=True))
        addresses = ({n: j.idx_q for n, j in joints.items()}, {n: j.idx_v for n, j in joints.items()})
        self.places = Places(task, *addresses, lambda q: q[[3, 0, 1, 2]])
        self.places.start(self.q, self.v)
        self.springs = [(*(where[name] for where in addresses), k) for name, k in task.springs.items()]

    def torque(self, q: NDArray) -> NDArray:
        """Of springs, which the model does not have."""
        found = np.zeros(self.model.nv)
        for place, row, stiffness in self.springs:
            found[row] = -stiffness * q[place]
        return found


def overwritten(task: Task, step: float) -> Run:
    it = _Model(task)
    data = it.model.createData()

    def advance(t: float) -> None:
        it.places.move(it.q, it.v, t)
        it.v += step * pin.aba(it.model, data, it.q, it.v, it.torque(it.q))
        it.q = pin.integrate(it.model, it.q, step * it.v)

    return march(task, step, advance, lambda: (it.places.read(it.q), None))


def operated(task: Task, step: float) -> Run:
    """``liaisons.PinocchioOperator`` in Runge and Kutta's rule."""
    it = _Model(task)
    now, side = [0.0], [1.0]
    motions = {n: lambda t, k=k: tuple(task.sigma(t, side[0])[:, k]) for k, n in enumerate(task.motions)}
    operator = PinocchioOperator(it.model, motions)

    def advance(t: float) -> None:
        side[0] = 1.0
        rates: list[NDArray] = []
        accelerations: list[NDArray] = []
        for part in (0.0, step / 2, step / 2, step):
            if part == step:
                side[0] = -1.0
            v = it.v + part * accelerations[-1] if part else it.v
            q = pin.integrate(it.model, it.q, part * rates[-1]) if part else it.q
            rates.append(v)
            accelerations.append(operator.accelerations(t + part, q, v, it.torque(q))[0])
        weights = step / 6 * np.array([1.0, 2.0, 2.0, 1.0])
        it.q = pin.integrate(it.model, it.q, weights @ np.array(rates))
        now[0] = t + step
        it.q, it.v = operator.place(now[0], it.q, it.v + weights @ np.array(accelerations))

    def read() -> tuple[NDArray, NDArray]:
        forces = operator.accelerations(now[0], it.q, it.v, it.torque(it.q))[1]
        return it.places.read(it.q), np.array([*forces.values()])

    def jump(t: float) -> NDArray:
        side[0] = 1.0
        it.v, impulses = operator.jump(t, it.q, it.v)
        return np.array([*impulses.values()])

    return march(task, step, advance, read, jump)


PAGE = "https://github.com/stack-of-tasks/pinocchio/blob/devel/examples/simulation-pendulum.py"
WAYS = (
    Way("pin", "rate overwritten", PAGE, overwritten),
    Way("pin", "PinocchioOperator", "docs/reference/api.md", operated),
)
