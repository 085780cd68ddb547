"""Prescribed joints in MuJoCo and Pinocchio against equations by hand and each engine's own inverse dynamics."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons import MujocoOperator, PinocchioOperator
from liaisons.errors import InvalidValueError, ProjectError

mujoco = pytest.importorskip("mujoco")
pin = pytest.importorskip("pinocchio")

AMPLITUDE, FREQUENCY = 0.1, 3.0  # [m], [rad/s]
CART, BOB, LENGTH, GRAVITY = 0.5, 1.0, 1.0, 9.81  # [kg], [kg], [m], [m/s2]
INERTIA = 1e-9  # of the bob about its centre, which MuJoCo will not have without [kg.m2]
MODEL = """<mujoco>
  <option timestep="0.0005" integrator="RK4" gravity="0 0 -9.81"/>
  <worldbody>
    <body name="cart">
      <joint name="pivot" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/>
      <body name="rod">
        <joint name="theta" type="hinge" axis="0 -1 0" {joint}/>
        <inertial pos="0 0 -1" mass="1" diaginertia="1e-9 1e-9 1e-9"/>
        {geom}
      </body>
    </body>
    {world}
  </worldbody>
  {more}
</mujoco>"""


def pivot(t: float) -> tuple[float, float, float]:
    sine, cosine = np.sin(FREQUENCY * t), np.cos(FREQUENCY * t)
    return AMPLITUDE * sine, AMPLITUDE * FREQUENCY * cosine, -AMPLITUDE * FREQUENCY**2 * sine


def theta_ddot(theta: float, sigma_ddot: float, torque: float = 0.0) -> float:
    """(m l² + I) θ'' = -m l (g sin θ + σ'' cos θ) + torque, moments about the pivot."""
    moment = -BOB * LENGTH * (GRAVITY * np.sin(theta) + sigma_ddot * np.cos(theta))
    return (moment + torque) / (BOB * LENGTH**2 + INERTIA)


def force(theta: float, theta_dot: float, sigma_ddot: float, torque: float = 0.0) -> float:
    """Of the horizontal momentum of cart and bob."""
    bob = sigma_ddot + LENGTH * (theta_ddot(theta, sigma_ddot, torque) * np.cos(theta) - theta_dot**2 * np.sin(theta))
    return CART * sigma_ddot + BOB * bob


def swing(stop: float, torque: Callable[[float], float] = lambda _: 0.0) -> NDArray:
    def rates(t: float, y: NDArray) -> list[float]:
        return [y[1], theta_ddot(y[0], pivot(t)[2], torque(y[1]))]

    return solve_ivp(rates, (0.0, stop), [0.3, 0.0], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]


def loaded(**parts: str) -> Any:
    model = mujoco.MjModel.from_xml_string(MODEL.format(**{"joint": "", "geom": "", "world": "", "more": "", **parts}))
    data = mujoco.MjData(model)
    data.qpos[1] = 0.3
    return model, data


@pytest.fixture
def callback() -> Iterator[Callable[[object], None]]:
    yield mujoco.set_mjcb_control
    mujoco.set_mjcb_control(None)


def run(model, data, stop: float) -> None:
    while data.time < stop - model.opt.timestep / 2:
        mujoco.mj_step(model, data)


def test_mujoco_moves_the_pivot_and_swings_as_newton_says(callback) -> None:
    model, data = loaded()
    operator = MujocoOperator(model, {"pivot": pivot})
    operator.place(data)
    assert (data.qpos[0], data.qvel[0]) == (0.0, AMPLITUDE * FREQUENCY)
    callback(operator)
    run(model, data, 3.0)
    theta, theta_dot = swing(3.0)
    sigma, sigma_dot, sigma_ddot = pivot(3.0)
    # Runge-Kutta's fourth order at 0.5 ms and 3 rad/s: (0.0015)^4 = 5e-12.
    assert [*data.qpos, *data.qvel] == pytest.approx([sigma, theta, sigma_dot, theta_dot], abs=1e-10)
    assert operator.forces(model, data)["pivot"] == pytest.approx(force(theta, theta_dot, sigma_ddot), abs=1e-9)


def test_what_actuators_users_and_springs_do_is_reckoned_with(callback) -> None:
    more = '<actuator><motor name="motor" joint="theta" gear="2"/><motor name="push" joint="pivot"/></actuator>'
    model, data = loaded(joint='damping="0.1"', more=more)
    data.xfrc_applied[2, 0] = 0.7  # at the bob, along x
    data.qfrc_applied[:] = 5.0, 0.05  # that at the pivot is the operator's
    data.qvel[1] = 0.4

    def control(_, data) -> None:
        data.ctrl[:] = 0.2, 3.0

    operator = MujocoOperator(model, {"pivot": pivot}, control=control)
    data.time = 0.4
    operator.place(data)
    callback(operator)
    mujoco.mj_forward(model, data)
    sigma_ddot = pivot(0.4)[2]
    torque = 2 * 0.2 - 0.1 * 0.4 + 0.05 + 0.7 * LENGTH * np.cos(0.3)
    assert data.qacc == pytest.approx([sigma_ddot, theta_ddot(0.3, sigma_ddot, torque)], rel=1e-12)
    expected = force(0.3, 0.4, sigma_ddot, torque) - 3.0 - 0.7
    assert data.qfrc_applied[0] == pytest.approx(expected, rel=1e-12)


def test_both_joints_prescribed_take_what_mujocos_inverse_dynamics_says(callback) -> None:
    model, data = loaded()
    operator = MujocoOperator(model, {"theta": lambda t: (0.3 + t, 1.0, 0.5), "pivot": pivot})
    data.time = 0.2
    operator.place(data)
    assert data.qpos == pytest.approx([pivot(0.2)[0], 0.5])
    forces = operator.forces(model, data)
    callback(operator)
    mujoco.mj_forward(model, data)
    applied = data.qfrc_applied.copy()
    mujoco.mj_inverse(model, data)
    assert data.qacc == pytest.approx([pivot(0.2)[2], 0.5], rel=1e-12)
    assert applied == pytest.approx(data.qfrc_inverse, rel=1e-11)
    assert [forces["pivot"], forces["theta"]] == pytest.approx(applied, rel=1e-12)


def test_a_rate_jumps_and_the_momentum_of_the_rod_stays() -> None:
    model, data = loaded()
    data.qvel[1] = 0.7
    operator = MujocoOperator(model, {"pivot": lambda _: (0.2, 0.5, 0.0)})
    impulse = operator.jump(model, data)["pivot"]
    # p_θ = m l² θ' + m l σ' cos θ; the impulse is that of the horizontal momentum.
    theta_dot = 0.7 - 0.5 * np.cos(0.3) / (1 + INERTIA)
    assert [*data.qpos, *data.qvel] == pytest.approx([0.2, 0.3, 0.5, theta_dot], rel=1e-12)
    assert impulse == pytest.approx(CART * 0.5 + BOB * (0.5 + np.cos(0.3) * (theta_dot - 0.7)), rel=1e-12)


GEOM = '<geom name="bob" type="sphere" size="0.1" pos="0 0 -1" mass="0"/>'
REFUSED = {
    "friction loss of joint 'theta'": {"joint": 'frictionloss="0.1"'},
    "limit of joint 'theta'": {"joint": 'limited="true" range="-1 1"'},
    "equality 'held'": {"more": '<equality><joint name="held" joint1="theta"/></equality>'},
    "equality number 0": {"more": '<equality><joint joint1="theta"/></equality>'},
    "friction loss or limit of tendon 'rope'": {
        "more": '<tendon><fixed name="rope" frictionloss="1"><joint joint="theta" coef="1"/></fixed></tendon>'
    },
    "contact of geoms 'table' and 'bob'": {
        "geom": GEOM,
        "world": '<geom name="table" type="plane" size="1 1 1" pos="0 0 -1"/>',
    },
}


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize("refused", REFUSED)
def test_constraints_of_mujoco_that_act_on_the_tree_are_refused_by_name(refused, jacobian) -> None:
    model, data = loaded(**REFUSED[refused])
    model.opt.jacobian = {"dense": 0, "sparse": 1}[jacobian]
    mujoco.mj_forward(model, data)
    with pytest.raises(InvalidValueError, match=f"^{refused} acts at t = 0 s on the kinematic tree of pivot"):
        MujocoOperator(model, {"pivot": pivot})(model, data)


@pytest.mark.parametrize("jacobian", [0, 1])
def test_constraints_elsewhere_are_left_alone(jacobian) -> None:
    other = '<body pos="3 0 0"><joint name="other" frictionloss="1"/><geom size="0.1"/></body>'
    model, data = loaded(world=other)
    model.opt.jacobian = jacobian
    mujoco.mj_forward(model, data)
    assert data.nefc == 1
    operator = MujocoOperator(model, {"pivot": pivot})
    operator.place(data)
    assert operator.forces(model, data)["pivot"] == pytest.approx(force(0.3, 0.0, 0.0), rel=1e-12)


def test_integrators_that_are_implicit_are_refused() -> None:
    model, data = loaded()
    operator = MujocoOperator(model, {"pivot": pivot})
    for integrator in ("IMPLICIT", "IMPLICITFAST"):
        model.opt.integrator = mujoco.mjtIntegrator.__members__[f"mjINT_{integrator}"]
        with pytest.raises(InvalidValueError, match=f"mjINT_{integrator} is not explicit; .* RK4"):
            MujocoOperator(model, {"pivot": pivot})
        with pytest.raises(InvalidValueError, match=f"mjINT_{integrator} is not explicit"):
            operator(model, data)  # as a callback, when somebody has changed the model
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    MujocoOperator(model, {"pivot": pivot})
    model.dof_damping[1] = 0.1
    with pytest.raises(InvalidValueError, match="mjINT_EULER with joint damping is not explicit"):
        MujocoOperator(model, {"pivot": pivot})
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    MujocoOperator(model, {"pivot": pivot})


@pytest.mark.parametrize(("coordinates", "words"), [("qpos", "place of joint 'pivot' is 0.001"), ("qvel", "rate of")])
def test_a_motion_that_does_not_begin_where_the_joint_is_is_refused(coordinates, words, callback) -> None:
    model, data = loaded()
    operator = MujocoOperator(model, {"pivot": pivot})
    callback(operator)
    for _ in range(2):  # a reset sets the time back, and the place
        operator.place(data)
        run(model, data, 0.1)
        mujoco.mj_resetData(model, data)
        with pytest.raises(InvalidValueError, match=r"rate of joint 'pivot' is 0 at t = 0 s, .* 0\.3; call place"):
            mujoco.mj_step(model, data)
    operator.place(data)
    getattr(data, coordinates)[0] += 1e-3
    with pytest.raises(InvalidValueError, match=words):
        operator.forces(model, data)


def test_another_model_under_the_same_callback_is_refused(callback) -> None:
    other = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'
    )
    callback(MujocoOperator(loaded()[0], {"pivot": pivot}))
    with pytest.raises(InvalidValueError, match=r"of pivot was called with another model: .* set_mjcb_control\(None\)"):
        mujoco.mj_step(other, mujoco.MjData(other))


def test_joints_and_motions_that_do_not_fit_are_refused() -> None:
    free = '<body pos="5 0 0"><joint name="turn" type="ball"/><geom size="0.1"/></body>'
    model, data = loaded(world=free)
    with pytest.raises(InvalidValueError, match="motions is empty"):
        MujocoOperator(model, {})
    with pytest.raises(InvalidValueError, match="the model has no joint 'pivt'; did you mean 'pivot'"):
        MujocoOperator(model, {"pivt": pivot})
    with pytest.raises(InvalidValueError, match="'turn' is neither hinge nor slide"):
        MujocoOperator(model, {"turn": pivot})
    wrong: Any
    for wrong in ((0.0, 1.0), (0.0, np.nan, 1.0)):
        with pytest.raises(InvalidValueError, match=r"motion of 'pivot' at t = 0 s: .* three finite numbers"):
            MujocoOperator(model, {"pivot": lambda _, wrong=wrong: wrong}).place(data)
    spherical = pin.Model()
    spherical.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    with pytest.raises(InvalidValueError, match="motions is empty"):
        PinocchioOperator(spherical, {})
    with pytest.raises(InvalidValueError, match="no joint 'bal'; did you mean 'ball'"):
        PinocchioOperator(spherical, {"bal": pivot})
    with pytest.raises(InvalidValueError, match="joint 'ball' has 4 coordinates"):
        PinocchioOperator(spherical, {"ball": pivot})


@pytest.fixture
def pendulum() -> Any:
    """Cart along x, rod about -y, as MODEL."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    cart = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "pivot")
    model.appendBodyToJoint(cart, pin.Inertia(CART, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    rod = model.addJoint(cart, pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0])), pin.SE3.Identity(), "theta")
    bob = pin.Inertia(BOB, np.array([0.0, 0.0, -LENGTH]), np.diag([0.0, INERTIA, 0.0]))
    model.appendBodyToJoint(rod, bob, pin.SE3.Identity())
    return model


def test_pinocchio_gives_force_and_accelerations_as_newton_says(pendulum) -> None:
    operator = PinocchioOperator(pendulum, {"pivot": pivot})
    accelerations, forces = operator.accelerations(0.4, [9.0, 0.3], [9.0, 0.4], [0.0, 0.2])
    sigma_ddot = pivot(0.4)[2]
    assert accelerations == pytest.approx([sigma_ddot, theta_ddot(0.3, sigma_ddot, 0.2)], rel=1e-12)
    assert forces["pivot"] == pytest.approx(force(0.3, 0.4, sigma_ddot, 0.2), rel=1e-12)
    q, v = operator.place(0.4, [9.0, 0.3], [9.0, 0.4])
    assert [*q, *v] == pytest.approx([pivot(0.4)[0], 0.3, pivot(0.4)[1], 0.4])
    inverse = pin.rnea(pendulum, pendulum.createData(), q, v, operator.accelerations(0.4, q, v)[0])
    assert operator.accelerations(0.4, q, v)[1]["pivot"] == pytest.approx(inverse[0], rel=1e-12)


def test_pinocchio_keeps_the_momentum_of_the_rod_where_a_rate_jumps(pendulum) -> None:
    operator = PinocchioOperator(pendulum, {"pivot": lambda _: (0.2, 0.5, 0.0)})
    rates, impulses = operator.jump(0.0, [0.0, 0.3], [0.1, 0.7])
    theta_dot = 0.7 - 0.4 * np.cos(0.3) / (1 + INERTIA)
    assert rates == pytest.approx([0.5, theta_dot], rel=1e-12)
    assert impulses["pivot"] == pytest.approx(CART * 0.4 + BOB * (0.4 + np.cos(0.3) * (theta_dot - 0.7)), rel=1e-12)


def test_without_the_engine_the_operator_says_what_to_install(monkeypatch, pendulum) -> None:
    for operator, engine in ((MujocoOperator, "mujoco"), (PinocchioOperator, "pin")):
        monkeypatch.setattr(sys.modules[operator.__module__], engine, None)
    with pytest.raises(ProjectError, match="pip install mujoco"):
        MujocoOperator(loaded()[0], {})
    with pytest.raises(ProjectError, match="pip install pin"):
        PinocchioOperator(pendulum, {})
