"""MuJoCo: rates overwritten, position actuators, an equality, mocap bodies, and the operator's force."""

import mujoco
import numpy as np

from liaisons import MujocoOperator
from liaisons.errors import InvalidValueError
from referee.way import CannotError, Model, Way


class _Model(Model):
    """A task in MuJoCo at its start."""

    def __init__(self, task, step, integrator="Euler", more=""):
        option = f'<option timestep="{step}" integrator="{integrator}"/>'
        self.model = mujoco.MjModel.from_xml_string(task.mjcf(option + more))
        self.data = mujoco.MjData(self.model)
        self.q, self.v = self.data.qpos, self.data.qvel
        names = [joint.name for joint in map(self.model.joint, range(self.model.njnt))]
        super().__init__(task, step, names, self.model.jnt_qposadr, self.model.jnt_dofadr)
        mujoco.mj_forward(self.model, self.data)

    def advance(self, _):
        mujoco.mj_step(self.model, self.data)

    def constraint_forces(self):
        return self.data.qfrc_constraint[self.rows]


def actuated(task, step, stiffness):
    """Position actuators, critically damped, of so many times m/h²; ``implicitfast``, since others blow up."""
    rest = _Model(task, step)
    full = np.zeros((rest.model.nv, rest.model.nv))
    mujoco.mj_fullM(rest.model, rest.data, full)
    actuators = "".join(
        f'<position name="{name}" joint="{name}" kp="{m * stiffness / step**2}" kv="{2 * m * stiffness**0.5 / step}"/>'
        for name, m in zip(task.motions, np.diag(full)[rest.rows], strict=True)
    )
    it = _Model(task, step, "implicitfast", f"<actuator>{actuators}</actuator>")

    def aim(t):
        sigma, sigma_dot, _ = task.sigma(t + step)
        it.data.ctrl[:] = sigma + 2 * step / stiffness**0.5 * sigma_dot  # the damping brakes against the world

    return it.march(aim, lambda: it.data.qfrc_actuator[it.rows])


def equality(task, step, time_constant, integrator):
    """An equality holds each joint at a constant that is moved along."""
    solver = f'solref="{time_constant * step} 1" solimp="0.9999 0.9999 0.001 0.5 2"'
    held = "".join(f'<joint joint1="{name}" {solver}/>' for name in task.motions)
    it = _Model(task, step, integrator, f"<equality>{held}</equality>")

    def aim(t):
        sigma, sigma_dot, _ = task.sigma(t)
        it.model.eq_data[-len(sigma) :, 0] = sigma + sigma_dot * (time_constant * step)  # likewise

    return it.march(aim, it.constraint_forces)


def mocap(task, step, time_constant):
    """A body that is moved without dynamics, and the prescribed one welded to it."""
    rest = _Model(task, step).model
    joint = rest.joint(next(iter(task.motions)))
    body = rest.body(joint.bodyid[0])
    if body.parentid[0] or len(task.motions) > 1:
        raise CannotError("no joint between bodies")
    weld = f'<weld body1="hand" body2="{body.name}" solref="{time_constant * step} 1"/>'
    hand = f'<body name="hand" mocap="true" pos="{" ".join(map(str, body.pos))}"/>'
    it = _Model(task, step, more=f"<equality>{weld}</equality><worldbody>{hand}</worldbody>")

    def move(t):
        sigma = task.sigma(t)[0, 0]
        if joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE:
            it.data.mocap_pos[0] = body.pos + sigma * joint.axis
        else:
            mujoco.mju_axisAngle2Quat(it.data.mocap_quat[0], joint.axis, sigma)

    return it.march(move, it.constraint_forces)


def operated(task, step):
    """``liaisons.MujocoOperator``: the exact force, with Runge and Kutta's rule."""
    it = _Model(task, step, "RK4")
    operator = MujocoOperator(it.model, it.motions)

    def named(method):
        return np.array([*method(it.model, it.data).values()])

    mujoco.set_mjcb_control(operator)
    try:
        return it.march(forces=lambda: named(operator.forces), jump=lambda _: named(operator.jump))
    except InvalidValueError as error:
        raise CannotError(f"refused: {str(error).partition(' acts')[0]}") from None
    finally:
        mujoco.set_mjcb_control(None)


PAGE = "https://mujoco.readthedocs.io/en/stable/"
EVERY, STIFF = {"integrator": ("Euler", "RK4", "implicitfast")}, {"stiffness": (1e-3, 1e-2, 0.1, 1.0)}
SOFT = {"time_constant": (2.0, 5.0)}
EQUALITY = SOFT | {"integrator": ("Euler", "RK4")}
WAYS = (
    Way("mujoco", "rate overwritten", f"{PAGE}programming/simulation.html", _Model.overwritten, EVERY),
    Way("mujoco", "position actuator", f"{PAGE}XMLreference.html#actuator-position", actuated, STIFF),
    Way("mujoco", "equality", f"{PAGE}XMLreference.html#equality-joint", equality, EQUALITY),
    Way("mujoco", "mocap and weld", f"{PAGE}modeling.html#mocap-bodies", mocap, SOFT),
    Way("mujoco", "MujocoOperator", "docs/reference/api.md", operated),
)
