"""Forces as controls: feedback, observers and plans that set torques, alone and beside prescribed motions."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_discrete_are

from liaisons import Controller, Plan, from_control, hold, observe, plan, simulate
from liaisons.errors import LiaisonsError, PlanError
from liaisons.library import model
from liaisons.linkages import Body, Linkage, Prismatic, Revolute, ground
from liaisons_motion.planning.searching import refuse_singularity

from .conftest import verified

Floats = Any
G = 9.81


def riccati(A: Floats, B: Floats, Q: Floats, R: Floats) -> Floats:
    """Solution of the discrete Riccati equation from the stable eigenvectors of its symplectic matrix."""
    n, inverse = len(A), np.linalg.inv(A).T
    S = B @ np.linalg.solve(R, B.T)
    symplectic = np.block([[A + S @ inverse @ Q, -S @ inverse], [-inverse @ Q, inverse]])
    values, vectors = np.linalg.eig(symplectic)
    stable = vectors[:, np.abs(values) < 1]
    return np.real(stable[n:] @ np.linalg.inv(stable[:n]))


def gains_with_delay(A: Floats, B: Floats, Q: Floats, R: Floats) -> Floats:
    """Gains of the states and of the force that acts: of what the states will be at the next sample."""
    P = riccati(A, B, Q, R)
    assert_allclose(P, solve_discrete_are(A, B, Q, R), rtol=1e-8)  # 16 digits less a condition number of 1e6
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    return np.hstack([K @ A, K @ B])


def held_constant(A: Floats, B: Floats, H: float) -> tuple[Floats, Floats]:
    """Matrices over a period of x' = A x + B u, with u constant in it."""
    n, k = B.shape
    flow = expm(H * np.block([[A, B], [np.zeros((k, n + k))]]))
    return flow[:n, :n], flow[:n, n:]


def furuta_upright() -> tuple[Floats, Floats, Floats]:
    """Mass matrix of the Furuta pendulum upside down, and A, B of (turn, swing, p_turn, p_swing), by hand.

    Linearised from Cazzolato and Prime (2011), eq. 33-34, with the numbers of the catalogue.
    """
    m, arm, rod = 0.075, 0.25, 0.15
    J_1, J_2, J_3 = 2e-3 + 0.3 * 0.1**2, 1e-4 + m * rod**2, 1e-6
    M = np.array([[J_1 + m * arm**2 + J_3, -m * arm * rod], [-m * arm * rod, J_2]])
    A, B = np.zeros((4, 4)), np.array([[0.0], [0], [1], [0]])
    A[:2, 2:], A[3, 1] = np.linalg.inv(M), m * G * rod
    return M, A, B


def test_gains_of_a_furuta_pendulum_are_those_of_our_own_riccati_equation() -> None:
    weights, effort = {"turn": 2.0, "swing": 1.0, "p_swing": 0.5}, 3.0
    held = hold("FurutaPendulum", {"swing": np.pi, "turn": 0.0}, controls="turn_force", step_size=0.005,
                weights=weights, effort=effort)  # fmt: skip
    assert held.states == ("turn", "swing", "p_turn", "p_swing", "turn_force")
    A, B = held_constant(*furuta_upright()[1:], 0.005)
    of_weights = np.array([2.0, 1.0, 0.0, 0.5]) / held.sizes[:4] ** 2
    expected = gains_with_delay(A, B, np.diag(of_weights), np.array([[effort / held.sizes[4] ** 2]]))
    assert_allclose(held.gains[0], expected, rtol=1e-8)  # of the equation's; the matrix of the step is good to 1e-10
    _, energy = furuta_upright()[0], held.energy
    assert held.sizes[4] == pytest.approx(energy, rel=1e-12)  # a torque does a typical work along one radian


@pytest.fixture(scope="module")
def furuta() -> Controller:
    return hold("FurutaPendulum", {"swing": np.pi, "turn": 0.0}, controls="turn_force", step_size=0.01,
                bounds={"turn_force": (-0.12, 0.15)})  # fmt: skip


def test_a_furuta_pendulum_stands_by_a_torque_within_bounds(furuta: Controller) -> None:
    verified(furuta)
    run = furuta.simulate(6, swing_0=np.pi + 0.07)
    torque = run["FurutaPendulum.turn_force"]
    assert torque.min() == pytest.approx(-0.12, abs=1e-15), "the bound is reached, and not exceeded"
    assert abs(run["FurutaPendulum.swing"][-1] - np.pi) < 1e-4 > abs(run["FurutaPendulum.turn"][-1])
    samples = np.round(run.time / 0.01, 9) % 1 == 0
    assert samples.all()
    gains, states = furuta.gains[0, 0], np.array([run[name] for name in furuta.signals])
    wanted = gains @ (furuta.trajectory.states[:, 0, None] - states)
    assert_allclose(torque[1:], wanted[:-1].clip(-0.12, 0.15), rtol=0, atol=1e-12)  # rounding; one sample later


def test_a_system_needs_no_setting_to_be_run_and_is_restored(furuta: Controller) -> None:
    system = furuta.system(swing_0=np.pi + 0.05)
    result = system.simulate(0.5)
    own = furuta.simulate(0.5, swing_0=np.pi + 0.05)
    assert not result.warnings
    assert_allclose(result["FurutaPendulum.swing"], own["FurutaPendulum.swing"], rtol=0, atol=1e-5)  # default tolerance
    with system.start(step_size=0.005) as run:
        for _ in range(41):  # half a period after a sample
            run.step()
        state = run.save()
        ends = []
        for _ in range(2):
            run.restore(state)
            for _ in range(30):
                run.step()
            ends.append([run[name] for name in ("FurutaPendulum.swing", "FurutaPendulum_turn_force.force")])
    assert_array_equal(*ends)


def test_start_values_of_a_force_act_until_the_next_sample(furuta: Controller) -> None:
    run = furuta.simulate(0.02, turn_force=0.1)
    assert run["FurutaPendulum.turn_force"][0] == 0.1
    A, B = held_constant(*furuta_upright()[1:], 0.01)
    states = [run[f"FurutaPendulum.{name}"][1] for name in ("turn", "swing", "p_turn", "p_swing")]
    assert_allclose(states, [0, np.pi, 0, 0] + 0.1 * B[:, 0], rtol=0, atol=2e-7)  # of second order: 0.01⁴ s⁴ times 16
    assert A.shape == (4, 4)


def test_forces_that_balance_weight_are_found() -> None:
    held = hold("Pendulum", {"theta": 1.0}, controls=["theta_force"], step_size=0.02, length=2.0, mass=0.5)
    assert held.starts["theta_force"] == pytest.approx(0.5 * G * 2 * np.sin(1.0), rel=1e-12)
    verified(held)
    with pytest.raises(PlanError, match=r"^Pendulum: this is no equilibrium: the rate of p_theta is -7\.25"):
        hold("Pendulum", {"theta": 1.0, "theta_force": 1.0}, controls="theta_force", step_size=0.02)


def test_viscous_friction_is_linearised() -> None:
    held = hold("Oscillator", {"x": 0.0}, controls="x_force", step_size=0.05, damping=0.3, mass=2.0, stiffness=5.0)
    A, B = held_constant(np.array([[0, 1 / 2.0], [-5.0, -0.3]]), np.array([[0.0], [1.0]]), 0.05)
    sizes = held.sizes
    expected = np.block([[A, B], [-held.gains[0]]]) * sizes / sizes[:, None]
    assert_allclose(held.loop, expected, rtol=0, atol=1e-10)  # error of the integration


def test_a_force_beside_a_prescribed_motion() -> None:
    held = hold("Pendulum", {"theta": np.pi, "pivot_x": 0.0}, "pivot_x", controls="theta_force", step_size=0.02)
    assert held.driven == ("pivot_x", "theta_force")
    assert held.states[2:] == ("pivot_x", "theta_force", "pivot_x_dot", "pivot_x_ddot")
    verified(held)
    run = held.simulate(theta_0=np.pi + 0.3, pivot_x=0.1)
    assert abs(run["Pendulum.theta"][-1] - np.pi) < 1e-5 > abs(run["Pendulum.pivot_x"][-1])
    assert np.abs(run["Pendulum.theta_force"]).max() > 0.1 < np.abs(run["Pendulum_pivot_x.y"]).max() + 0.1


class MotorArm(Linkage):
    """Two links in a vertical plane, a motor in each joint."""

    upper = Body(mass=2.0, inertia=(0.02, 0.02, 1e-3), centre=(0.2, 0, 0))
    lower = Body(mass=1.5, inertia=(0.01, 0.01, 1e-3), centre=(0.15, 0, 0))
    shoulder = Revolute(ground, upper, axis="y", damping=0.1)
    elbow = Revolute(upper, lower, axis="y", at=(0.4, 0, 0), damping=0.05)


def test_two_motors_hold_an_arm_against_its_weight() -> None:
    held = hold(MotorArm, {"shoulder": 0.3, "elbow": 0.5}, controls=["shoulder_force", "elbow_force"], step_size=0.01)
    of_lower = 1.5 * G * 0.15 * np.cos(0.3 + 0.5)
    of_upper = (2.0 * 0.2 + 1.5 * 0.4) * G * np.cos(0.3)
    torques = [held.starts["shoulder_force"], held.starts["elbow_force"]]  # an angle about y lowers the arm
    assert torques == pytest.approx([-of_lower - of_upper, -of_lower], rel=1e-12)
    verified(held)
    own = held.simulate(1.0, shoulder_0=0.4)
    coupled = held.system(shoulder_0=0.4).simulate(1.0, 0.01, tolerance=1e-10)
    assert not coupled.warnings
    assert_allclose(
        coupled["MotorArm.elbow"], own["MotorArm.elbow"], rtol=0, atol=1e-7
    )  # tolerance of the mechanism's solver
    assert abs(own["MotorArm.shoulder"][-1] - 0.3) < 0.1 * abs(own["MotorArm.shoulder"][0] - 0.3)


def test_two_angles_show_a_furuta_pendulum_that_a_torque_holds() -> None:
    shown: Any = {
        "measured": ["turn", "swing"],
        "noise": {"turn": 1e-3, "swing": 1e-3},
        "disturbance": {"swing_force": 1e-3, "turn_load": 1e-3},
    }
    upright: Any = {"at": {"swing": np.pi, "turn": 0.0}, "controls": "turn_force", "step_size": 0.01}
    held = hold("FurutaPendulum", **upright, **shown)
    claims = verified(held)
    assert any("those of feedback and of the observer" in claim for claim in claims)
    assert any("a step costs" in claim for claim in claims)
    observer = observe("FurutaPendulum", **upright, **shown)
    A, _ = held_constant(*furuta_upright()[1:], 0.01)
    F, _, C = observer.model.start_matrices()
    size = observer.model.sizes
    assert_allclose(F * size[:, None] / size, A, rtol=3e-6, atol=1e-15)  # Runge-Kutta steps of an eighth of a radian
    P = riccati(A.T, C.T / size[:, None], *noise_matrices())
    assert_allclose(np.diag(observer.covariance) * size**2, np.diag(P), rtol=1e-5)


def noise_matrices() -> tuple[Floats, Floats]:
    """Covariances of what forces add in a period, constant in it, and of the readings, divided by their noise."""
    _, A, B = furuta_upright()
    _, on_turn = held_constant(A, B, 0.01)
    _, on_swing = held_constant(A, np.array([[0.0], [0], [0], [1]]), 0.01)
    pushes = np.hstack([on_turn, on_swing])
    return 1e-6 / 0.01 * pushes @ pushes.T, np.eye(2)


@pytest.mark.parametrize(
    ("subject", "arguments", "message"),
    [
        ("Pendulum", {"controls": "theta_farce"}, "Pendulum: controls = 'theta_farce' is no input force; did you mean"),
        ("Pendulum", {"controls": "pivot_x"}, "controls = 'pivot_x' is no input force: it is prescribed; give moves="),
        ("Pendulum", {"controls": ["theta_force"] * 2}, r"controls = .*: name each force once"),
        ("Pendulum", {"controls": 3}, "controls = 3"),
        ("Pendulum", {"controls": "theta_force", "theta_force": 1.0}, "theta_force is a control and cannot have the"),
        ("Pendulum", {"controls": "theta_force", "bounds": {"theta_force": (1, 2)}}, "low < 0.979366 < high"),
        ("Pendulum", {"controls": "theta_force", "bounds": {"x_force": (1, 2)}}, "the regulators bound theta_force$"),
        ("FurutaPendulum", {}, r"FurutaPendulum has no active coordinate: .*; give forces, controls=\['turn_force'"),
        ("DryOscillator", {"controls": "x_force"}, "DryOscillator: what is planned or held takes no .*friction"),
    ],
)
def test_refusals(subject: str, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(LiaisonsError, match=message):
        hold(subject, {}, step_size=0.01, **arguments)


# ---- plans --------------------------------------------------------------------------------------------------------


def test_the_least_effort_of_a_linear_mechanism_is_that_of_its_gramian(tmp_path: Path) -> None:
    motion = plan("Oscillator", controls="x_force", start={"x": 1.0, "x_dot": 0.0}, end={"x": 0.0, "x_dot": 0.0},
                  duration=2.0, mass=2.0, stiffness=3.0, damping=0.1)  # fmt: skip
    assert "a mesh of 30 intervals costs the same as one of 20" in verified(motion)
    A, B, T = np.array([[0, 1 / 2.0], [-3.0, -0.1]]), np.array([[0.0], [1.0]]), 2.0
    flow = expm(T * np.block([[-A, B @ B.T], [np.zeros((2, 2)), A.T]]))
    gramian = flow[2:, 2:].T @ flow[:2, 2:]
    wanted = np.linalg.solve(gramian, -expm(T * A) @ [1.0, 0.0])
    assert motion.cost == pytest.approx(wanted @ gramian @ wanted, rel=1e-12)
    t = np.linspace(0, T, 9)
    force = [float(B[:, 0] @ expm(A.T * (T - s)) @ wanted) for s in t]
    assert_allclose(motion.sigma(t)["x_force"], force, rtol=0, atol=1e-7)  # polynomials of degree four on 20 intervals
    assert motion.goal.minimize == "effort"
    motion.save(tmp_path / "plan.json")
    assert_array_equal(Plan.load(tmp_path / "plan.json").sigma(t)["x_force"], motion.sigma(t)["x_force"])
    assert motion.impulse("x_force", T) == pytest.approx(wanted @ np.linalg.solve(A, expm(T * A) - np.eye(2)) @ B[:, 0])


def test_a_bounded_force_takes_a_mass_there_in_least_time() -> None:
    motion = plan("Oscillator", controls=["x_force"], start={"x": 0.0, "x_dot": 0.0}, end={"x": 3.0, "x_dot": 0.0},
                  duration=(0.5, 10), minimize="time", bounds={"x_force": (-4, 2)}, mass=2.0, stiffness=0)  # fmt: skip
    forward, back = 2.0 / 2.0, 4.0 / 2.0  # accelerations
    assert motion.duration == pytest.approx(np.sqrt(2 * 3.0 * (1 / forward + 1 / back)), rel=1e-10)
    assert motion.switches == pytest.approx([motion.duration * back / (forward + back)], rel=1e-8)
    assert_allclose(motion.sigma([0.1, motion.duration - 0.1])["x_force"], [2.0, -4.0], rtol=1e-9)
    end = motion.replay()
    assert [end["x"][-1], end["x_dot"][-1]] == pytest.approx([3.0, 0.0], abs=1e-9)


class CartPole(Linkage):
    """Cart that a force drives along a rail, with a pole that swings freely."""

    cart = Body(mass=1.0)
    pole = Body(mass=0.3, inertia=(1e-3, 1e-3, 1e-6), centre=(0, 0, -0.5))
    rail = Prismatic(ground, cart, axis="x")
    swing = Revolute(cart, pole, axis="y")


def cart_pole_rates(state: Floats, force: float) -> Floats:
    """Rates of (rail, swing, their rates), by Newton's equations; swing turns the pole towards -x."""
    M, m, rod, J = 1.0, 0.3, 0.5, 1e-3
    _, angle, speed, turning = state
    coupling = -m * rod * np.cos(angle)
    mass = np.array([[M + m, coupling], [coupling, J + m * rod**2]])
    forces = [force - m * rod * np.sin(angle) * turning**2, -m * G * rod * np.sin(angle)]
    return np.append([speed, turning], np.linalg.solve(mass, forces))


@pytest.fixture(scope="module")
def swing_up() -> Plan:
    return plan(CartPole, controls="rail_force", start={"rail": 0, "swing": 0}, duration=2.0, tries=1,
                end={"rail": 0, "rail_dot": 0, "swing": np.pi, "swing_dot": 0}, bounds={"rail_force": (-20, 20)},
                time_limit=400)  # fmt: skip


@pytest.mark.slow
def test_a_cart_swings_its_pole_up(swing_up: Plan) -> None:
    verdicts = swing_up.verify(time_limit=600)
    assert all(verdict.passed for verdict in verdicts), "\n".join(map(str, verdicts))
    replay = swing_up.replay()
    ends = [replay[name][-1] for name in ("rail", "swing", "rail_dot", "swing_dot")]
    assert_allclose(ends, [0, np.pi, 0, 0], rtol=0, atol=1e-9)
    breaks, state = swing_up.solution.trajectory.breaks, np.zeros(4)
    for begin, end in pairwise(breaks):
        state = solve_ivp(lambda t, x: cart_pole_rates(x, float(swing_up.sigma(t)["rail_force"])), (begin, end), state,
                          rtol=1e-11, atol=1e-12).y[:, -1]  # fmt: skip
    assert_allclose(state, [0, np.pi, 0, 0], rtol=0, atol=1e-7)  # what falls grows by exp(2 s √(3 g/2 l)) on the way


@pytest.mark.slow
def test_a_pole_that_a_cart_swings_up_is_held_there(swing_up: Plan) -> None:
    held = hold(swing_up, step_size=0.005)
    assert held.trajectory.after == "rests"
    assert held.trajectory.motion[0, 0, -1] == pytest.approx(0, abs=1e-9), "upright it needs no force"
    verified(held)
    run = held.simulate(6.0, swing_0=0.05)
    assert abs(run["CartPole.swing"][-1] - np.pi) < 1e-3 > abs(run["CartPole.rail"][-1])
    assert np.abs(run["CartPole.rail_force"]).max() <= 20


@pytest.mark.slow
def test_a_motor_at_its_bounds_swings_a_furuta_pendulum_up_in_least_time() -> None:
    end = {"turn": 0.0, "turn_dot": 0.0, "swing": np.pi, "swing_dot": 0.0}
    motion = plan("FurutaPendulum", controls="turn_force", start={"turn": 0.0, "swing": 0.0}, end=end, tries=1,
                  duration=(0.3, 5.0), minimize="time", bounds={"turn_force": (-0.2, 0.2)}, time_limit=400)  # fmt: skip
    verdicts = motion.verify(time_limit=900)
    assert all(verdict.passed for verdict in verdicts), "\n".join(map(str, verdicts))
    run, solution = motion.replay(), motion.solution
    assert_allclose([run[name][-1] for name in end], [*end.values()], rtol=0, atol=1e-9)
    torques, price = solution.trajectory.controls[0], solution.adjoints[motion.problem.states.index("p_turn")]
    assert_allclose(torques, -0.2 * np.sign(price), rtol=1e-9)  # what a torque is worth says on which side it is
    assert len(motion.switches) == np.count_nonzero(np.diff(np.sign(price)))


class Crane(Linkage):
    """Trolley that a motor drives along a girder, with friction, and a load on a rope."""

    trolley = Body(mass=400.0)
    load = Body(mass=1000.0, inertia=(1.0, 1.0, 1.0), centre=(0, 0, -10.0))
    travel = Prismatic(ground, trolley, axis="x", damping=200.0)
    rope = Revolute(trolley, load, axis="y")


def test_a_crane_brings_its_load_by_a_force_and_holds_it_there() -> None:
    rest = {"travel_dot": 0, "rope": 0, "rope_dot": 0}
    motion = plan(Crane, controls="travel_force", start={"travel": 0.0, **rest}, end={"travel": 8.0, **rest},
                  duration=12.0)  # fmt: skip
    run = motion.replay()
    assert [run["travel"][-1], run["rope"][-1]] == pytest.approx([8.0, 0.0], abs=1e-8)
    momentum = run["travel_dot"] * 400 + 1000 * (run["travel_dot"] - 10 * np.cos(run["rope"]) * run["rope_dot"])
    t = run.time
    pushed = motion.impulse("travel_force", t) - 200 * run["travel"]  # what friction takes is 200 times the way
    assert_allclose(momentum, pushed, rtol=0, atol=1e-5 * momentum.max())  # recorded to the tolerance of a replay
    held = hold(motion, step_size=0.1)
    verified(held)
    assert held.trajectory.after == "repeats", "what is 8 m farther on is where it was, but for the way"
    end = held.simulate(36.0, rope_0=0.05)
    assert [end["Crane.travel"][-1], end["Crane.rope"][-1]] == pytest.approx([24, 0], abs=0.01)


def test_a_force_is_planned_beside_a_prescribed_motion() -> None:
    motion = plan("Pendulum", "pivot_x", controls="theta_force", minimize="pivot_x_ddot**2 + theta_force**2",
                  start={"theta": 0.0, "pivot_x": 0.0}, duration=1.5,
                  end={"theta": 0.5, "theta_dot": 0.0, "pivot_x": 0.3, "pivot_x_dot": 0.0})  # fmt: skip
    verified(motion)
    assert motion.problem.controls == ("pivot_x_ddot", "theta_force")
    alone = plan("Pendulum", "pivot_x", minimize="pivot_x_ddot**2", start={"theta": 0.0, "pivot_x": 0.0}, duration=1.5,
                 end={"theta": 0.5, "theta_dot": 0.0, "pivot_x": 0.3, "pivot_x_dot": 0.0}, tries=1)  # fmt: skip
    assert motion.cost < alone.cost, "one control more costs no more"
    held = hold(motion)
    verified(held)
    with pytest.raises(PlanError, match="observe takes no plan of forces beside prescribed motions"):
        hold(motion, measured="theta", noise={"theta": 0.01})
    assert held.trajectory.after == "rests"
    assert held.trajectory.motion[1, 0, -1] == pytest.approx(G * np.sin(0.5), rel=1e-9), "what weight needs there"
    run = held.simulate(6.0, theta_0=0.1)
    assert [run["Pendulum.theta"][-1], run["Pendulum.pivot_x"][-1]] == pytest.approx([0.5, 0.3], abs=1e-4)


def test_a_force_beside_a_planned_motion_goes_straight_from_sample_to_sample() -> None:
    arguments: dict[str, Any] = {
        "bounds": {"pivot_x_ddot": (-3, 3), "theta_force": (-6, 6)},
        "start": {"theta": 0.0, "pivot_x": 0.0},
        "end": {"theta": 0.5, "theta_dot": 0.0, "pivot_x": 0.3, "pivot_x_dot": 0.0},
    }
    motion = plan("Pendulum", "pivot_x", controls="theta_force", minimize="time", duration=(0.2, 3), **arguments)
    assert motion.switches.size > 0
    held = hold(motion)
    verified(held)
    run = held.simulate(held.duration)
    assert np.abs(run["Pendulum.theta_force"]).max() == pytest.approx(6, abs=1e-12)
    t, force = run.time, run["Pendulum.theta_force"]
    pushed = np.sum((force[1:] + force[:-1]) / 2 * np.diff(t))
    assert pushed == pytest.approx(float(motion.impulse("theta_force", motion.duration)), rel=1e-6)


def test_what_a_force_beside_a_motion_cannot_hold_ends_in_motion() -> None:
    motion = plan("Pendulum", "pivot_x", controls="theta_force", minimize="pivot_x_ddot**2 + theta_force**2",
                  start={"theta": 0.0, "pivot_x": 0.0}, duration=1.5, bounds={"theta_force": (-3, 3)}, tries=1,
                  end={"theta": 0.5, "theta_dot": 0.0, "pivot_x": 0.3, "pivot_x_dot": 0.0})  # fmt: skip
    assert G * np.sin(0.5) > 3
    assert hold(motion, step_size=0.1).trajectory.after == "ends"


def test_two_forces_follow_a_plan_in_steps_shorter_than_the_period() -> None:
    still = {"shoulder_dot": 0, "elbow_dot": 0}
    motion = plan(MotorArm, controls=["shoulder_force", "elbow_force"], start={"shoulder": 0.0, "elbow": 0.0},
                  end={"shoulder": 0.7, "elbow": 0.3, **still}, duration=1.0)  # fmt: skip
    held = hold(motion, step_size=0.0099)
    assert np.diff(held.trajectory.times).max() < 0.0099
    verified(held)


def test_forces_have_no_mass_that_could_vanish() -> None:
    motion = plan("Oscillator", controls="x_force", start={"x": 1.0, "x_dot": 0.0}, end={"x": 0.0}, duration=1.0)
    blurred = motion.solution.hamiltonian * np.linspace(1, 2, motion.solution.hamiltonian.size)
    refuse_singularity(replace(motion.solution, hamiltonian=blurred))
    with pytest.raises(
        PlanError, match="hold: moved coordinates or their rates jump beside forces: weigh or bound x_ddot"
    ):
        hold(replace(motion, goal=replace(motion.goal, moves=("x",))))


@pytest.mark.parametrize("mechanism", ["FurutaPendulum", "CartPole"])
def test_an_end_that_a_force_cannot_reach_in_time_is_named(mechanism: str) -> None:
    names, subject = ("turn", "swing"), mechanism
    if mechanism == "CartPole":
        names, subject = ("rail", "swing"), CartPole
    end = dict.fromkeys((names[0], *(f"{name}_dot" for name in names)), 0.0) | {"swing": np.pi}
    with pytest.raises(PlanError, match="no motion was found"):
        plan(subject, controls=f"{names[0]}_force", start=dict.fromkeys(names, 0.0), end=end, duration=0.4,
             bounds={f"{names[0]}_force": (-0.2, 0.2)}, tries=2, time_limit=30)  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"start": {"theta_force": 1.0}},
            "Pendulum: start: theta_force is a control, which may have any value at once",
        ),
        ({"minimize": "motion"}, "minimize = 'motion' is of moved coordinates; weigh forces by 'effort'"),
        ({"minimize": "time"}, "minimize = 'time' would take none: bound theta_force"),
        ({"closed": "thet"}, "closed = 'thet' is no state of the plan"),
    ],
)
def test_what_cannot_be_planned_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(PlanError, match=message):
        plan("Pendulum", controls="theta_force", **{"end": {"theta": 1.0}, "duration": (1.0, 2.0), **arguments})


# ---- controllers of python-control --------------------------------------------------------------------------------


def state_space(dt: float, **labels: Any) -> Any:
    control = pytest.importorskip("control")
    matrices = [[0.9, 0.1], [-0.2, 0.7]], [[0.0, 0.3], [1.0, 0.0]], [[2.0, -1.0]], [[0.5, 0.25]]
    return control.ss(*matrices, dt, **labels)


def test_a_controller_of_python_control_is_a_sampled_component() -> None:
    labels = {"states": ["slow", "fast"], "inputs": ["angle", "rate"], "outputs": ["torque"]}
    controller = from_control(state_space(0.1, **labels), "Lead", units={"angle": "rad", "torque": "N.m"})
    units = {v.name: v.unit for v in model(controller).variables}
    assert (units["angle"], units["rate"], units["torque"]) == ("rad", "1", "N.m")
    inputs = {"angle": lambda t: np.sin(3 * t), "rate": lambda t: 0 * t + 0.5}
    run = simulate(controller, stop_time=1.0, step_size=0.1, inputs=inputs, slow_0=0.3, fast_0=-0.1)
    x, outputs = np.array([0.3, -0.1]), []
    for t in run.time:
        u = np.array([np.sin(3 * t), 0.5])
        outputs.append(2 * x[0] - x[1] + 0.5 * u[0] + 0.25 * u[1])
        x = np.array([0.9 * x[0] + 0.1 * x[1] + 0.3 * u[1], -0.2 * x[0] + 0.7 * x[1] + u[0]])
    assert_allclose(run["torque"][:-1], outputs[:-1], rtol=0, atol=1e-12)  # rounding


def test_a_continuous_controller_is_sampled_with_held_inputs() -> None:
    control = pytest.importorskip("control")
    lag = from_control(control.ss([[-2.0]], [[3.0]], [[1.0]], [[0.0]]), "Lag", period=0.2)
    run = simulate(lag, stop_time=1.0, step_size=0.2, inputs={"u_0": lambda t: 0 * t + 1.0})
    assert_allclose(run["y_0"][:-1], 1.5 * (1 - np.exp(-2 * run.time[:-1])), rtol=0, atol=1e-12)  # its step response


@pytest.mark.parametrize(
    ("dt", "arguments", "message"),
    [
        (0.1, {"period": 0.2}, "period = 0.2 s, but that of the system is 0.1 s; resample it"),
        (0, {}, "Lead has no period: give period="),
        (0.1, {"units": {"angl": "rad"}}, "units of 'angl': no such name; did you mean"),
        (0.1, {"name": "Le ad"}, "'Le ad' is no identifier"),
        (0, {"period": -1}, "period"),
    ],
)
def test_what_is_no_controller_is_refused(dt: float, arguments: dict[str, Any], message: str) -> None:
    system = state_space(dt, inputs=["angle", "rate"])
    with pytest.raises(PlanError, match=message):
        from_control(system, **{"name": "Lead", **arguments})
    with pytest.raises(PlanError, match="give a StateSpace of python-control"):
        from_control(3, "Lead")
