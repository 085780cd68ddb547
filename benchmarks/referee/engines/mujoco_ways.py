"""MuJoCo: rates overwritten, position actuators, an equality, and the operator's force."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from liaisons import MujocoOperator
from liaisons.errors import InvalidValueError
from referee.task import Task
from referee.way import CannotError, Run, Way, march


class _Model:
    """A task in MuJoCo at its start."""

    def __init__(self, task: Task, step: float, integrator: str, more: str = "") -> None:
        self.task, self.step = task, step
        self.model = mujoco.MjModel.from_xml_string(task.mjcf(step, integrator, more))
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in task.motions]
        self.places, self.rows = (
            np.array([int(j.qposadr[0]) for j in joints]),
            np.array([int(j.dofadr[0]) for j in joints]),
        )
        for name, (place, rate) in task.start.items():
            joint = self.model.joint(name)
            if name == "attitude":
                self.data.qvel[joint.dofadr[0] : joint.dofadr[0] + 3] = [
                    task.start_values[f"omega_{a}_0"] for a in "xyz"
                ]
            else:
                self.data.qpos[joint.qposadr[0]], self.data.qvel[joint.dofadr[0]] = place, rate
        self.data.qpos[self.places], self.data.qvel[self.rows] = task.sigma(0.0)[:2]
        mujoco.mj_forward(self.model, self.data)

    def asked(self) -> NDArray:
        data, model = self.data, self.model
        if self.task.asked[0] == ("attitude",):
            address = int(model.joint("attitude").qposadr[0])
            return data.qpos[address : address + 4].copy()
        return np.array(
            [sum(data.qpos[int(model.joint(name).qposadr[0])] for name in names) for names in self.task.asked]
        )

    def overwrite(self, t: float) -> None:
        self.data.qpos[self.places], self.data.qvel[self.rows] = self.task.sigma(t)[:2]


def overwritten(task: Task, step: float, integrator: str) -> Run:
    """Places and rates of the joints are set before each step; nobody reads a force."""
    it = _Model(task, step, integrator)

    def advance(t: float) -> None:
        it.overwrite(t)
        mujoco.mj_step(it.model, it.data)

    return march(task, step, advance, lambda: (it.asked(), None))


def actuated(task: Task, step: float, stiffness: float) -> Run:
    """Position actuators, critically damped, of so many times m/h²; ``implicitfast``, since others blow up."""
    inertia = _inertia(task)
    scale = inertia * stiffness / step**2
    actuators = "".join(
        f'<position name="{name}" joint="{name}" kp="{k}" kv="{2 * np.sqrt(k * m)}"/>'
        for name, k, m in zip(task.motions, scale, inertia, strict=True)
    )
    it = _Model(task, step, "implicitfast", f"<actuator>{actuators}</actuator>")
    lag = 2 * np.sqrt(inertia / scale)  # of the damping, which brakes against the world

    def advance(t: float) -> None:
        sigma, sigma_dot, _ = task.sigma(t + step)
        it.data.ctrl[:] = sigma + lag * sigma_dot
        mujoco.mj_step(it.model, it.data)

    return march(task, step, advance, lambda: (it.asked(), it.data.qfrc_actuator[it.rows].copy()))


def _inertia(task: Task) -> NDArray:
    """Diagonal of the mass matrix at the joints, at the start."""
    it = _Model(task, 1e-3, "Euler")
    full = np.zeros((it.model.nv, it.model.nv))
    mujoco.mj_fullM(it.model, it.data, full)
    return np.diag(full)[it.rows]


def equality(task: Task, step: float, time_constant: float, integrator: str) -> Run:
    """An equality holds each joint at a constant that is moved along."""
    solver = f'solref="{time_constant * step} 1" solimp="0.9999 0.9999 0.001 0.5 2"'
    held = "".join(f'<joint joint1="{name}" {solver}/>' for name in task.motions)
    it = _Model(task, step, integrator, f"<equality>{held}</equality>")
    first = it.model.neq - len(task.motions)

    def advance(t: float) -> None:
        sigma, sigma_dot, _ = task.sigma(t)
        it.model.eq_data[first:, 0] = sigma + sigma_dot * (time_constant * step)  # its damping brakes against the world
        mujoco.mj_step(it.model, it.data)

    return march(task, step, advance, lambda: (it.asked(), it.data.qfrc_constraint[it.rows].copy()))


@contextmanager
def _callback(function: Any) -> Iterator[None]:
    mujoco.set_mjcb_control(function)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(None)


def operated(task: Task, step: float) -> Run:
    """``liaisons.MujocoOperator``: the exact force, with Runge and Kutta's rule."""
    it = _Model(task, step, "RK4")
    operator = MujocoOperator(it.model, task.motions)

    def read() -> tuple[NDArray, NDArray]:
        return it.asked(), np.array(list(operator.forces(it.model, it.data).values()))

    def jump(t: float) -> NDArray:
        it.data.time = t + 1e-15
        after = MujocoOperator(it.model, {n: lambda t, n=n: task.motions[n](t + 2e-12) for n in task.motions})
        return np.array(list(after.jump(it.model, it.data).values()))

    operator.place(it.data)
    try:
        with _callback(operator):
            return march(task, step, lambda _: mujoco.mj_step(it.model, it.data), read, jump)
    except InvalidValueError as error:
        raise CannotError(f"refused: {str(error).partition(' acts')[0]}") from None


INTEGRATORS = ("Euler", "RK4", "implicitfast")
WAYS = (
    Way(
        "mujoco",
        "rate overwritten",
        "mujoco.readthedocs.io/en/stable/programming/simulation.html (state and control)",
        overwritten,
        [{"integrator": name} for name in INTEGRATORS],
    ),
    Way(
        "mujoco",
        "position actuator",
        "mujoco.readthedocs.io/en/stable/XMLreference.html#actuator-position",
        actuated,
        [{"stiffness": s} for s in (1e-3, 1e-2, 0.1, 1.0)],
    ),
    Way(
        "mujoco",
        "equality",
        "mujoco.readthedocs.io/en/stable/XMLreference.html#equality-joint",
        equality,
        [{"time_constant": c, "integrator": i} for c in (2.0, 5.0) for i in ("Euler", "RK4")],
    ),
    Way("mujoco", "MujocoOperator", "docs/reference/api.md", operated),
)
