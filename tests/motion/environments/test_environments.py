"""Environments of Gymnasium against closed forms, and their copies in compiled code against those stepped as FMUs."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy.linalg import expm

from liaisons import LiaisonsError, System
from liaisons.errors import InvalidValueError, SimulationError
from liaisons.models import Pendulum
from liaisons_motion.gymnasium import Environment, VectorEnvironment

REGISTERED = ["SwingUp", "FallingCat", "CraneShift", "TorqueFreeTurn"]
SWING: dict[str, Any] = {
    "observe": ["theta", "theta_dot", "pivot_x", "pivot_x_dot"],
    "act": {"pivot_x_ddot": (-5, 5)},
    "reward": "-theta**2",
    "step_size": 0.1,
}


def swing(**settings: Any) -> Environment:
    return Environment("Pendulum", **SWING | settings)


def stepped(environment: Any, acts: Any, count: int) -> tuple[Any, ...]:
    """What the last of some steps returns."""
    *_, last = (environment.step(acts) for _ in range(count))
    return last


@pytest.mark.filterwarnings("ignore:.*(infinity|normalized space):UserWarning")  # advice
@pytest.mark.parametrize("name", REGISTERED)
def test_gymnasium_accepts_it(name: str) -> None:
    environment = gymnasium.make(f"liaisons/{name}-v0")
    check_env(environment.unwrapped)
    environment.close()


@pytest.mark.parametrize("name", REGISTERED)
def test_copies_move_as_fmus_do(name: str) -> None:
    """Explicit steps of order 8 in C, and the FMU's solver, from the same equations."""
    spec = gymnasium.spec(f"liaisons/{name}-v0")
    settings: dict[str, Any] = {**spec.kwargs, "randomize": {}}
    one, copies = Environment(**settings), VectorEnvironment(num_envs=33, **settings)
    seen, _ = one.reset(seed=1)
    all_seen, _ = copies.reset(seed=2)
    copies.action_space.seed(3)
    for _ in range(30):
        assert all_seen[32] == pytest.approx(seen, abs=1e-9)
        acts = copies.action_space.sample()
        all_seen, rewards, ended, truncated, information = copies.step(acts)
        seen, reward, *ends, balance = one.step(acts[32])
        assert (ended[32], truncated[32]) == tuple(ends)
        assert rewards[32] == pytest.approx(reward, abs=1e-9)
        assert abs(balance["energy_balance"]) < 1e-10
        assert abs(information["energy_balance"][32]) < 1e-10
        if ended[32]:
            break
    assert not np.allclose(all_seen[0], all_seen[1], rtol=1e-3)
    one.close()


def test_each_copy_has_a_balance_of_its_own() -> None:
    """Of steps so long that it is not rounding: that of one copy alone, whatever the others do."""
    acts = {"pivot_x_ddot": (-9, 9)}
    settings: dict[str, Any] = {"subject": "Pendulum", "observe": ["theta"], "act": acts, "reward": "theta"}
    settings |= {"step_size": 0.5, "stop_time": 2.0}
    alone, both = (VectorEnvironment(num_envs=n, **settings) for n in (1, 2))
    alone.reset(seed=0)
    both.reset(seed=0)
    for _ in range(3):
        *_, one = alone.step([[8.0]])
        *_, two = both.step([[8.0], [-3.0]])
        assert two["energy_balance"][0] == one["energy_balance"][0]
        assert min(abs(two["energy_balance"])) > 1e-12
        assert abs(np.diff(two["energy_balance"])) > 1e-12


CONTACTS: list[dict[str, Any]] = [
    {"subject": "BouncingBall", "observe": ["height", "table", "gap_impacts"], "act": {"table_ddot": (-5, 5)}},
    {"subject": "BouncingBall", "observe": ["height", "table", "gap_impulse"], "act": {"table_dot": (-0.3, 0.3)}},
    {
        "subject": "DryOscillator",
        "observe": ["x", "belt", "slip_sticks"],
        "act": {"x_force": (-3, 3), "belt_dot": (-0.3, 0.3)},
        "start_values": {"mu_static": 0.2, "x_0": 0.1},
    },
]


@pytest.mark.parametrize("settings", CONTACTS)
def test_copies_with_contacts_have_the_numbers_of_their_fmu(settings: dict[str, Any]) -> None:
    """Each with acts of its own, and begun again at another step."""
    settings = settings | {"reward": settings["observe"][0], "step_size": 0.125, "stop_time": 2.0}
    one, copies = Environment(**settings), VectorEnvironment(num_envs=3, **settings)
    copies.action_space.seed(3)
    (all_seen, _), (seen, _) = copies.reset(seed=0), one.reset()
    started = all_seen[1].copy()
    changed = set()
    for step in range(24):
        assert np.array_equal(all_seen[1], seen)
        acts = copies.action_space.sample()
        all_seen, rewards, ended, truncated, information = copies.step(acts)
        if step == 16:
            assert np.array_equal(all_seen[1], started)
            seen, _ = one.reset()
            continue
        seen, reward, *ends, balance = one.step(acts[1])
        assert (rewards[1], ended[1], truncated[1]) == (reward, *ends)
        assert information["energy_balance"][1] == pytest.approx(balance["energy_balance"], abs=1e-12)
        changed.add(seen[2])
    assert len(changed) > 1
    assert not np.array_equal(all_seen[0], all_seen[1])
    one.close()


def test_a_copy_with_contacts_that_failed_begins_again() -> None:
    """Each time with a shorter sentence, of which the rest of an older one is no part."""
    settings = {
        "subject": "BouncingBall",
        "observe": ["height"],
        "act": {"height_load": (-1e30, 1e30)},
        "reward": "0",
        "step_size": 0.1,
    }
    settings["start_values"] = {"mass": 1e-290}
    copies = VectorEnvironment(num_envs=2, **settings)
    copies.reset(seed=0)
    for _ in range(3):
        *_, ended, _, information = copies.step([[1e30], [0.0]])
        assert list(ended) == [*information["failure"]]
        assert not ended[1]
    copies.reset(seed=0)
    assert not copies.step([[0.0], [0.0]])[2].any()


def test_a_copy_whose_bodies_overlap_is_named() -> None:
    settings = {
        **CONTACTS[0],
        "reward": "0",
        "step_size": 0.1,
        "randomize": {"height_0": (0.5, 1.0), "table": (0, 0.1)},
    }
    copies = VectorEnvironment(num_envs=2, **settings)
    copies.task.randomize["table"] = (0.9, 1.1)  # type: ignore[index]
    with pytest.raises(
        SimulationError, match=r"copy [01]: height_0 = 0\.\d+, table = [01]\.\d+: gap = .*bodies overlap"
    ):
        copies.reset(seed=0)


@pytest.mark.parametrize("many", [False, True])
def test_an_accelerated_pivot_tilts_gravity(many: bool) -> None:
    acts, theta_0 = 3.0, 0.4
    settings = SWING | {"start_values": {"theta_0": theta_0, "pivot_x": 0.5}}
    environment = VectorEnvironment("Pendulum", num_envs=1, **settings) if many else swing(**settings)
    environment.reset()
    for k in range(1, 21):
        seen = np.ravel(environment.step([[acts]] if many else [acts])[0])
        t, tilt = 0.1 * k, np.arctan2(acts, 9.81)
        values = {"theta_0": theta_0 + tilt, "theta_dot_0": 0.0, "gravity": np.hypot(acts, 9.81)}
        exact = Pendulum.exact(np.array([t]), **values)
        assert seen[0] == pytest.approx(exact["theta"][0] - tilt, abs=1e-8)
        assert seen[1] == pytest.approx(exact["theta_dot"][0], abs=1e-8)
        assert seen[2:] == pytest.approx([0.5 + acts * t**2 / 2, acts * t], rel=1e-13)
    environment.close()


def test_what_is_moved_follows_exactly() -> None:
    environment = swing(act={"pivot_x_ddot": (-5, 5), "pivot_z_dot": (-1, 1), "theta_force": (-2, 2)})
    random, values = np.random.default_rng(0), np.zeros(3)
    environment.reset()
    for _ in range(50):
        act = environment.task.action_space.low * random.uniform(-1, 1, 3)
        environment.step(act)
        values += [0.1 * values[1] + act[0] / 200, act[0] / 10, act[1] / 10]
        assert [environment._own[n] for n in ("pivot_x", "pivot_x_dot", "pivot_z")] == pytest.approx(values, abs=1e-14)
    information = stepped(environment, np.zeros(3), 1)[-1]
    assert abs(information["energy_balance"]) < 1e-10  # with the work of jumps of the pivot's rate
    environment.close()


def test_the_energy_balance_shows_steps_that_are_too_large() -> None:
    lost = []
    for size in (0.05, 1.2):
        copies = VectorEnvironment("Pendulum", num_envs=2, **SWING | {"step_size": size})
        copies.reset(seed=0)
        acts = np.array([[5.0], [-5.0]])
        information = stepped(copies, acts, 3)[-1]
        lost.append(np.abs(information["energy_balance"]).max())
    assert lost[0] < 1e-12
    assert lost[1] > 1e-6


@pytest.mark.parametrize("many", [False, True])
def test_rewards_add_up_to_an_integral(many: bool) -> None:
    """∫ θ' dt = θ(T) - θ(0), with an error of second order."""
    errors = []
    for size in (0.1, 0.05):
        settings = SWING | {"reward": "theta_dot", "step_size": size, "stop_time": 2.0}
        environment = VectorEnvironment("Pendulum", num_envs=1, **settings) if many else swing(**settings)
        environment.reset(seed=0)
        seen, total, ended = np.zeros(2), 0.0, False
        while not ended:
            seen, reward, _, ended, _ = environment.step([[4.0]] if many else [4.0])
            total += float(np.ravel(reward)[0])
        errors.append(abs(total - np.ravel(seen)[0] + 0.1))
        environment.close()
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_the_same_seed_gives_the_same_draws() -> None:
    settings = SWING | {"observe": ["mass", "theta"], "randomize": {"mass": (0.8, 1.2), "theta_0": (-1, 1)}}
    one, copies = swing(**settings), VectorEnvironment("Pendulum", num_envs=200, **settings)
    for environment in (one, copies):
        first, again, other = (environment.reset(seed=seed)[0] for seed in (5, 5, 6))
        assert np.array_equal(first, again)
        assert not np.array_equal(first, other)
        assert not np.array_equal(other, environment.reset()[0])
    mass, theta = copies.reset()[0].T
    assert (mass.min(), mass.max()) == pytest.approx((0.8, 1.2), abs=0.03)
    assert (theta.min(), theta.max()) == pytest.approx((-1, 1), abs=0.15)
    assert one.reset(options={"mass": 3.0, "theta_0": 0.7})[0] == pytest.approx([3.0, 0.7])
    one.close()


def test_an_episode_ends_and_copies_begin_again() -> None:
    settings = SWING | {"stop": "abs(pivot_x) - 0.09", "stop_time": 0.5}
    one, copies = swing(**settings), VectorEnvironment("Pendulum", num_envs=2, **settings)
    first, _ = copies.reset()
    one.reset()
    acts = np.array([[5.0], [0.0]])
    ended = [copies.step(acts)[2:4] for _ in range(2)]
    assert np.array_equal(ended, [[[False, False]] * 2, [[True, False], [False, False]]])  # 5 t²/2 = 0.1 at t = 0.2
    seen, rewards, *_ = copies.step(acts)
    assert seen[0] == pytest.approx(first[0], abs=0)
    assert (rewards[0] == 0) & (rewards[1] < 0)
    ended = [copies.step(acts)[2:4] for _ in range(2)]
    assert np.array_equal(ended[1], [[True, False], [False, True]])
    assert stepped(one, [0.0], 5)[2:4] == (False, True)
    with pytest.raises(SimulationError, match="no episode is under way; call reset"):
        one.step([0.0])
    one.close()


@pytest.mark.parametrize("many", [False, True])
def test_what_cannot_be_stepped_ends_the_episode(many: bool) -> None:
    """The length becomes 0 after √2 s."""
    settings = SWING | {"observe": ["length"], "act": {"length_ddot": (-1, 1)}, "step_size": 0.2}
    environment = VectorEnvironment("Pendulum", num_envs=1, **settings) if many else swing(**settings)
    environment.reset()
    act = [[-1.0]] if many else [-1.0]
    assert not np.any(stepped(environment, act, 7)[2])
    seen, reward, ended, _, information = environment.step(act)
    assert np.all(ended)
    assert np.ravel(seen) == pytest.approx([1 - 1.4**2 / 2])
    assert np.all(reward == 0)
    assert many or "length" in information["failure"]
    if not many:
        with pytest.raises(SimulationError, match="no episode is under way"):
            environment.step(act)
    environment.reset()
    assert not np.any(environment.step(act)[2])
    environment.close()


def test_systems_and_forces() -> None:
    """Without gravity the angle grows as a constant torque says."""
    system = System("pushed")
    for name in ("swing", "other"):
        system.add(name, Pendulum, theta_0=0.0, gravity=0.0)
    environment = Environment(
        system,
        observe=["swing.theta", "2*swing.theta_dot - 0.5*other.theta"],
        act={"swing.theta_force": (-1, 1)},
        reward="-swing.theta**2",
        step_size=0.1,
    )
    environment.reset()
    seen, *_, information = stepped(environment, [0.5], 10)
    assert seen == pytest.approx([0.25, 1.0], abs=1e-13)
    assert [*information] == ["swing.energy_balance", "other.energy_balance"]
    environment.close()


def test_the_picture_is_rendered() -> None:
    environment = swing(render_mode="rgb_array")
    environment.reset()
    frames: list[Any] = [environment.render()]
    for _ in range(3):
        environment.step([5.0])
        frames.append(environment.render())
    assert {frame.shape for frame in frames} == {(480, 480, 3)}
    assert all(np.ptp(frame) > 100 for frame in frames)
    assert not np.array_equal(frames[2], frames[3])
    environment.close()


def test_the_optimum_is_that_of_lq_control() -> None:
    """Pivot at y, y'' = a: ∫ (y - 1)² + 0.1 a² dt is least along the flow of the Hamiltonian matrix."""
    environment = swing(
        act={"pivot_x_ddot": (-50, 50)},
        reward="-(pivot_x - 1)**2 - 0.1*pivot_x_ddot**2",
        stop_time=2.0,
        step_size=0.02,
        goal={"tries": 1},
        randomize={"pivot_x": (0.0, 0.5)},
    )
    environment.reset(options={"pivot_x": 0.2})
    A, W = np.array([[0, 1], [0, 0.0]]), np.diag([1.0, 0])
    flow = expm(2.0 * np.block([[A, -np.diag([0, 1 / 0.1])], [-W, -A.T]]))
    first = np.array([0.2 - 1, 0.0])
    costate = np.linalg.solve(flow[2:, 2:], -flow[2:, :2] @ first)
    optimum = environment.optimum
    assert optimum is environment.optimum
    assert optimum.cost == pytest.approx(first @ costate, rel=1e-13)
    total = 0.0
    for k in range(100):
        total += environment.step([optimum.sigma(0.02 * (k + 0.5))["pivot_x_ddot"]])[1]
    assert -optimum.cost - total == pytest.approx(0.0, abs=1e-4)  # holding, and the middle of steps: second order
    environment.reset(options={"pivot_x": 0.4})
    assert environment.optimum.cost == pytest.approx(optimum.cost * (0.6 / 0.8) ** 2, rel=1e-13)
    environment.close()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"observe": []}, "observe = []: give one name at least"),
        ({"act": {}}, "act = {}: give one name at least"),
        ({"act": {"pivot_x_ddot": (1, 1)}}, "range of pivot_x_ddot = (1, 1): give (low, high), low < high"),
        ({"act": {"pivot_x_ddot": (-1e39, 1)}}, "give (low, high), low < high, as far as 3.4e+38"),
        ({"act": {"pivot_x_ddot": 3}}, "range of pivot_x_ddot = 3: give (low, high), low < high"),
        ({"randomize": {"mass": (2, 1)}}, "range of mass = (2, 1): give (low, high), low < high"),
        ({"act": {"pivot_x": (0, 1)}}, "act: pivot_x would jump; act on pivot_x_dot or pivot_x_ddot"),
        ({"act": {"pivot_x_dot": (0, 1), "pivot_x_ddot": (0, 1)}}, "a coordinate is moved twice; leave one out"),
        ({"act": {"pivott_x_ddot": (0, 1)}}, "pivott_x"),
        ({"act": {"theta": (0, 1)}}, "which a step cannot set"),
        ({"observe": ["thetta"]}, "there is no 'thetta'; did you mean 'theta'"),
        ({"reward": "theta +"}, "'theta +', at character"),
        ({"stop": "2*foo"}, "there is no 'foo'"),
        ({"randomize": {"masss": (1, 2)}}, "'masss'; did you mean 'mass'"),
        ({"randomize": {"mass": (-1, 1)}}, "mass"),
        ({"step_size": 0}, "step_size = 0: must be > 0"),
        ({"stop_time": 0.05}, "stop_time = 0.05: must be greater than step_size"),
        ({"stop_time": None}, "stop_time = None: must be greater than step_size"),
        ({"reward": 5}, "reward = 5: give a formula as text"),
        ({"stop": None}, "stop = None: give a formula as text"),
        ({"start_values": 5}, "start_values = 5: give a dictionary with names as keys"),
        ({"goal": "x"}, "goal = 'x': give a dictionary with names as keys"),
        ({"render_mode": "human"}, "render_mode = 'human': choose one of 'rgb_array'"),
    ],
)
def test_misuse_is_refused(settings: dict[str, Any], words: str) -> None:
    for make in (Environment, VectorEnvironment):
        with pytest.raises(LiaisonsError) as caught:
            make("Pendulum", **SWING | settings)
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)


def test_actions_are_refused() -> None:
    one, copies = swing(), VectorEnvironment("Pendulum", num_envs=2, **SWING)
    for environment in (one, copies):
        with pytest.raises(SimulationError, match="no episode is under way; call reset"):
            environment.step(environment.action_space.sample())
    one.reset()
    copies.reset()
    for environment, action, words in (
        (one, 1.0, r"action has shape \(\); give \(1,\): pivot_x_ddot"),
        (one, [[1.0]], r"action has shape \(1, 1\); give \(1,\)"),
        (one, [5.1], r"action = \[5.1\]: must be in the ranges"),
        (one, [np.nan], "must be in the ranges"),
        (copies, [1.0], r"action has shape \(1,\); give \(2, 1\)"),
        (copies, [[1.0], [-5.1]], "must be in the ranges"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            environment.step(action)
    for environment, name in ((one, "Environment"), (copies, "VectorEnvironment")):
        for duplicate in (copy.copy, copy.deepcopy, pickle.dumps):
            with pytest.raises(SimulationError, match=f"^Pendulum is neither copied nor pickled; make another {name}$"):
                duplicate(environment)
    for count, words in ((0, "give a whole number, at least 1"), (10**30, "more than memory holds; 10000000 at most")):
        with pytest.raises(InvalidValueError, match=f"^num_envs = {count}: {words}$"):
            VectorEnvironment("Pendulum", num_envs=count, **SWING)
    with pytest.raises(InvalidValueError, match=r"options = .*: give ranges in randomize"):
        copies.reset(options={"mass": 1.0})
    with pytest.raises(InvalidValueError, match="num_envs = 0"):
        VectorEnvironment("Pendulum", num_envs=0, **SWING)
    one.close()


def test_the_optimum_of_a_force_is_that_of_riccatis_equation() -> None:
    environment = Environment(
        "Oscillator", ["x", "x_dot"], {"x_force": (-2, 2)}, "-(x**2 + x_force**2)", 0.05, stop_time=2.0
    )
    environment.reset(options={"x_0": 1.0})
    A, B, Q = np.array([[0.0, 1], [-1, 0]]), np.array([[0.0, 0], [0, 1]]), np.diag([1.0, 0])
    flow = expm(-2.0 * np.block([[A, -B], [-Q, -A.T]]))  # of states and costates, backwards from a costate of 0
    P = flow[2:, :2] @ np.linalg.inv(flow[:2, :2])
    assert environment.optimum.cost == pytest.approx(P[0, 0], rel=1e-8)
    assert environment.optimum.sigma(0.0)["x_force"] == pytest.approx(-P[1, 0], abs=1e-6)
