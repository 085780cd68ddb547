"""MuJoCo: rates overwritten, position actuators, an equality, and the operator's force."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from liaisons import MujocoOperator
from liaisons.errors import InvalidValueError
from referee.task import Task
from referee.way import CannotError, Places, Run, Way, march

INTEGRATORS = {"Euler": 0, "RK4": 1, "implicitfast": 3}


class _Model:
    """A task in MuJoCo at its start."""

    def __init__(self, task: Task, step: float, integrator: str, more: str = "", hand: str = "") -> None:
        self.task, self.step = task, step
        text = task.mjcf(more).replace("</worldbody>", f"{hand}</worldbody>")
        self.model: Any = mujoco.MjModel.from_xml_string(text)
        self.model.opt.timestep, self.model.opt.integrator = step, INTEGRATORS[integrator]
        self.data: Any = mujoco.MjData(self.model)
        names = [self.model.joint(k).name for k in range(self.model.njnt)]
        addresses = (self.model.jnt_qposadr, self.model.jnt_dofadr)
        self.places = Places(task, *(dict(zip(names, where, strict=True)) for where in addresses))
        self.places.start(self.data.qpos, self.data.qvel)
        mujoco.mj_forward(self.model, self.data)

    def march(self, before: Any, forces: Any = lambda: None, jump: Any = lambda _: None) -> Run:
        def advance(t: float) -> None:
            before(t)
            mujoco.mj_step(self.model, self.data)

        return march(self.task, self.step, advance, lambda: (self.places.read(self.data.qpos), forces()), jump)


def overwritten(task: Task, step: float, integrator: str) -> Run:
    """Places and rates of the joints are set before each step; nobody reads a force."""
    it = _Model(task, step, integrator)
    return it.march(lambda t: it.places.move(it.data.qpos, it.data.qvel, t))


def actuated(task: Task, step: float, stiffness: float) -> Run:
    """Position actuators, critically damped, of so many times m/h²; ``implicitfast``, since others blow up."""
    rest = _Model(task, step, "Euler")
    full = np.zeros((rest.model.nv, rest.model.nv))
    mujoco.mj_fullM(rest.model, rest.data, full)
    inertia = np.diag(full)[rest.places.rows]
    actuators = "".join(
        f'<position name="{name}" joint="{name}" kp="{m * stiffness / step**2}" kv="{2 * m * stiffness**0.5 / step}"/>'
        for name, m in zip(task.motions, inertia, strict=True)
    )
    it = _Model(task, step, "implicitfast", f"<actuator>{actuators}</actuator>")

    def aim(t: float) -> None:
        sigma, sigma_dot, _ = task.sigma(t + step)
        it.data.ctrl[:] = sigma + 2 * step / stiffness**0.5 * sigma_dot  # the damping brakes against the world

    return it.march(aim, lambda: it.data.qfrc_actuator[it.places.rows])


def equality(task: Task, step: float, time_constant: float, integrator: str) -> Run:
    """An equality holds each joint at a constant that is moved along."""
    solver = f'solref="{time_constant * step} 1" solimp="0.9999 0.9999 0.001 0.5 2"'
    held = "".join(f'<joint joint1="{name}" {solver}/>' for name in task.motions)
    it = _Model(task, step, integrator, f"<equality>{held}</equality>")

    def aim(t: float) -> None:
        sigma, sigma_dot, _ = task.sigma(t)
        it.model.eq_data[-len(sigma) :, 0] = sigma + sigma_dot * (time_constant * step)  # likewise

    return it.march(aim, lambda: it.data.qfrc_constraint[it.places.rows])


def mocap(task: Task, step: float, time_constant: float) -> Run:
    """A body that is moved without dynamics, and the prescribed one welded to it."""
    rest = _Model(task, step, "Euler").model
    joint = rest.joint(next(iter(task.motions)))
    if rest.body_parentid[joint.bodyid[0]] or len(task.motions) > 1:
        raise CannotError("moves a body in space, no joint between bodies")
    weld = f'<weld body1="hand" body2="{rest.body(joint.bodyid[0]).name}" solref="{time_constant * step} 1"/>'
    it = _Model(task, step, "Euler", f"<equality>{weld}</equality>", '<body name="hand" mocap="true"/>')

    def move(t: float) -> None:
        sigma = task.sigma(t)[0, 0]
        if joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE:
            it.data.mocap_pos[0] = sigma * joint.axis
        else:
            mujoco.mju_axisAngle2Quat(it.data.mocap_quat[0], joint.axis, sigma)

    return it.march(move, lambda: it.data.qfrc_constraint[it.places.rows])


def operated(task: Task, step: float) -> Run:
    """``liaisons.MujocoOperator``: the exact force, with Runge and Kutta's rule."""
    it = _Model(task, step, "RK4")
    operator = MujocoOperator(it.model, task.motions)

    def forces() -> NDArray:
        return np.array([*operator.forces(it.model, it.data).values()])

    def jump(t: float) -> NDArray:
        it.data.time = t + 1e-15
        after = MujocoOperator(it.model, {n: lambda t, n=n: task.motions[n](t + 2e-12) for n in task.motions})
        return np.array([*after.jump(it.model, it.data).values()])

    mujoco.set_mjcb_control(operator)
    try:
        return it.march(lambda _: None, forces, jump)
    except InvalidValueError as error:
        raise CannotError(f"refused: {str(error).partition(' acts')[0]}") from None
    finally:
        mujoco.set_mjcb_control(None)


PAGE = "https://mujoco.readthedocs.io/en/stable/"
WAYS = (
    Way(
        "mujoco",
        "rate overwritten",
        f"{PAGE}programming/simulation.html",
        overwritten,
        [{"integrator": name} for name in INTEGRATORS],
    ),
    Way(
        "mujoco",
        "position actuator",
        f"{PAGE}XMLreference.html#actuator-position",
        actuated,
        [{"stiffness": s} for s in (1e-3, 1e-2, 0.1, 1.0)],
    ),
    Way(
        "mujoco",
        "equality",
        f"{PAGE}XMLreference.html#equality-joint",
        equality,
        [{"time_constant": c, "integrator": i} for c in (2.0, 5.0) for i in ("Euler", "RK4")],
    ),
    Way(
        "mujoco",
        "mocap and weld",
        f"{PAGE}modeling.html#mocap-bodies",
        mocap,
        [{"time_constant": c} for c in (2.0, 5.0)],
    ),
    Way("mujoco", "MujocoOperator", "docs/reference/api.md", operated),
)
