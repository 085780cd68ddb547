"""Feedback: gains against closed forms, multipliers against those of the FMUs, refusals in one line."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from liaisons import Plan, hold, plan
from liaisons.errors import LiaisonsError, PlanError
from liaisons.fmu.code import model_code
from liaisons.library import component
from liaisons.library import model as component_model
from liaisons_catalogue.regulator import KNOTS
from liaisons_motion.holding.controllers import ReferenceTrajectory
from liaisons_motion.holding.feedback import (
    discrete_lqr_gains,
    periodic_riccati,
    reachable_subspace,
    rest_offsets,
    riccati_recursion,
)
from liaisons_motion.holding.subjects import sampled_mechanism
from liaisons_motion.planning.phases import optimal_control_problem

from .conftest import SCALES, Scale, parameters, scaled, sizes, times, verified

STEP = 0.02
HELD: dict[str, dict[str, Any]] = {
    "Pendulum": {"at": {"theta": np.pi, "pivot_x": 0}, "moves": "pivot_x", "step_size": STEP},
    "CircularHoop": {"at": {"xi": np.pi, "beta_dot": 2.0}, "moves": "beta", "step_size": STEP},
    "Satellite": {
        "at": {"attitude": (1, 0.1, 0.2, -0.3)},
        "moves": ["wheel_1", "wheel_2", "wheel_3"],
        "step_size": 0.5,
    },
}
CONSERVED = {"Pendulum": (), "CircularHoop": (), "Satellite": ("H_x", "H_y", "H_z")}


def test_gains_of_the_oscillator_tend_to_the_closed_form() -> None:
    """x'' = -ω² x + u, least ∫ x² + r u²: k_1 = √(ω⁴ + 1/r) - ω², k_2 = √(2 k_1)."""
    omega, r = 1.5, 0.3
    k_1 = np.sqrt(omega**4 + 1 / r) - omega**2
    errors = []
    for h in (1e-3, 5e-4):
        step: Any = expm(np.array([[0, 1, 0], [-(omega**2), 0, 1], [0, 0, 0]]) * h)
        gains = discrete_lqr_gains(step[:2, :2], step[:2, 2:], np.diag([h, 0]), np.array([[r * h]]))
        errors.append(np.max(np.abs(gains - [k_1, np.sqrt(2 * k_1)])))
    assert errors[0] < 2e-3  # of first order in h
    assert errors[1] == pytest.approx(errors[0] / 2, rel=1e-2)


def test_the_recursion_finds_the_least_sum() -> None:
    """Of a changing system, in all directions of its inputs; and for ever, against SciPy's Riccati."""
    rng = np.random.default_rng(1)
    steps = [(rng.normal(size=(3, 3)), rng.normal(size=(3, 1))) for _ in range(6)]
    Q, R, end = np.diag([1.0, 0.2, 0.5]), np.array([[0.1]]), np.diag([2.0, 1.0, 3.0])
    gains, P = riccati_recursion(steps, [Q] * 6, R, end)
    x_0 = np.array([1.0, -2.0, 0.5])

    def cost(off: Any) -> float:
        """Where inputs are off those of the feedback along its own course."""
        x, course, total = x_0, x_0, 0.0
        for (A, B), K, more in zip(steps, gains, off, strict=True):
            best = -K @ course
            total += x @ Q @ x + (best + more) @ R @ (best + more)
            x, course = A @ x + B @ (best + more), A @ course + B @ best
        return float(total + x @ end @ x)

    assert cost(np.zeros((6, 1))) == pytest.approx(x_0 @ P @ x_0, rel=1e-9)
    for off in np.eye(6)[:, :, None]:  # the sum is quadratic
        assert cost(off) == pytest.approx(cost(-off), rel=1e-9)
        assert cost(off) > cost(0 * off)
    repeated = periodic_riccati(steps[:1], [Q], R)
    assert repeated is not None
    np.testing.assert_allclose(repeated[0][0], discrete_lqr_gains(*steps[0], Q, R), rtol=1e-8)


def test_the_staircase_ends_where_control_does() -> None:
    A = np.array([[0.0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]])
    V, U = reachable_subspace(A, np.array([[0.0], [1], [0], [0]]))
    assert V.shape == U.shape == (4, 2)
    np.testing.assert_allclose(V[2:], 0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.hstack([V, U]) @ np.hstack([V, U]).T, np.eye(4), rtol=0, atol=1e-15)


def test_what_cannot_be_moved_is_made_up_for() -> None:
    V, U = np.eye(2)[:, :1], np.eye(2)[:, 1:]
    target, missed = rest_offsets(np.eye(2), np.array([[1.0, 2.0]]), V, U)  # x_1 + 2 x_2 = 0 where x_2 stays 1
    assert (target.item(), missed.item()) == pytest.approx((-2, 0))


@pytest.mark.parametrize("name", HELD)
def test_the_fmus_have_the_multipliers_that_were_predicted(name: str) -> None:
    regulator = hold(name, **HELD[name])
    verified(regulator)
    assert regulator.conserved == CONSERVED[name]
    assert regulator.controlled.size == regulator.floquet_multipliers.size - len(regulator.conserved)
    np.testing.assert_allclose(regulator.floquet_multipliers[: len(regulator.conserved)], 1, rtol=0, atol=1e-9)
    # Solver tolerance 1e-11 over a difference of 1e-5.
    np.testing.assert_allclose(regulator.measured(), regulator.loop, rtol=0, atol=2e-6 * np.abs(regulator.loop).max())


def test_multipliers_of_the_pendulum_lie_on_the_root_locus() -> None:
    """What Σ x'Qx + r w² leaves satisfies r + G(1/μ)' Q G(μ) = 0, G of w → x: Riccati's equation is not needed.

    A length of 1 m has the size of an angle, and a radian of the free motion takes √(l/g): r = (l/g)².
    """
    regulator, r = hold("Pendulum", **HELD["Pendulum"]), (1 / 9.81) ** 2
    sizes = regulator.sizes
    assert regulator.states[:3] == ("theta", "p_theta", "pivot_x")
    decay, n = np.exp(-1.0), 5
    B = np.array([0, 0, *(STEP ** np.array([2, 1, 0]) * [0.5 - decay, decay, 1 - decay])])[:, None]
    A = sizes[:, None] * regulator.loop / sizes + B @ regulator.gains[0]
    for mu in regulator.controlled:
        out, back = (np.linalg.solve(z * np.eye(n) - A, B)[[0, 2], 0] for z in (mu, 1 / mu))
        assert abs(r + back @ out) < 1e-6 * r * (1 + np.abs(back) @ np.abs(out) / r)


def test_three_links_stand_on_each_other() -> None:
    regulator = hold("PendulumChain", {"theta": np.pi, "pivot_x": 0}, "pivot_x", step_size=0.005, n=3)
    starts: Any = {"theta_0[1]": np.pi + 0.01}
    run = regulator.simulate(8.0, **starts)
    assert np.abs(regulator.deviation(run)[:, 0]).max() > 0.009
    assert np.abs(regulator.deviation(run)[:, -1]).max() < 1e-4


def test_a_run_of_one_step_samples_as_a_longer_one() -> None:
    regulator = hold("Pendulum", **HELD["Pendulum"])
    short, long = (regulator.simulate(count * STEP, theta_0=np.pi + 0.01) for count in (1, 5))
    np.testing.assert_array_equal(short.values[:, 1], long.values[:, 1])  # dividing the step would sample twice


@pytest.mark.variants(core=0)
def test_a_pendulum_comes_back_within_bounds_and_survives_a_push() -> None:
    regulator = hold("Pendulum", **HELD["Pendulum"], bounds={"pivot_x_ddot": (-6, 6)})
    run = regulator.simulate(8.0, theta_0=np.pi + 0.2)
    usual = regulator.system(theta_0=np.pi + 0.2).simulate(8.0, STEP, tolerance=1e-11)
    # Whatever the coupling; the solver begins anew at samples that are announced, at a tolerance of 1e-11.
    np.testing.assert_allclose(usual["Pendulum.theta"], run["Pendulum.theta"], rtol=0, atol=1e-9)
    assert np.abs(regulator.deviation(run)[:, -1]).max() < 1e-6
    acceleration = run["Pendulum.pivot_x_ddot"]
    assert np.abs(acceleration).max() <= 6 + 1e-9
    assert np.abs(acceleration).max() > 5.5
    free = hold("Pendulum", **HELD["Pendulum"])
    pushed, kept = (r.survives("theta_force", 0.2, stop_time=8.0) for r in (free, regulator))
    assert 1.0 < kept < pushed


def test_wheels_take_the_momentum_that_a_torque_leaves() -> None:
    upright: dict[str, Any] = HELD["Satellite"] | {"at": {"attitude": (1, 0, 0, 0)}}
    regulator = hold("Satellite", **upright)
    run = regulator.simulate(150.0, omega_x_0=0.001)
    off = regulator.deviation(run)[:, -1]
    assert abs(off[4] - 0.01) < 1e-3  # H_x stays
    assert np.abs(off[:4]).max() < 1e-5
    assert off[regulator.states.index("wheel_1_dot")] == pytest.approx(0.01 / 0.1, rel=0.05)


@pytest.mark.parametrize(
    ("name", "changed", "message"),
    [
        ("PlanarCat", {"at": {"psi_1": 0.5}}, "cannot be held there: .* phi .* psi_1"),
        ("Satellite", {"at": {"wheel_1": 0.0}}, "cannot be held there: to first order wheel_1, .* cannot change q_x"),
        ("Pendulum", {"at": {"theta": 1.0}}, "no equilibrium: the rate of p_theta is -8.2"),
        (
            "Pendulum",
            {"bounds": {"theta": (-1, 1)}},
            "the regulators bound pivot_x, pivot_x_dot, pivot_x_ddot, pivot_x_",
        ),
        ("Pendulum", {"bounds": {"pivot_x_ddot": 3}}, r"bounds of pivot_x_ddot = 3: give \(low, high\)"),
        ("Pendulum", {"bounds": {"pivot_x": (1, 2)}}, r"bounds of pivot_x = \(1, 2\): .* low < 0 < high"),
        (
            "PendulumChain",
            {"at": {"theta": np.pi}, "moves": "pivot_x"},
            "hardly reach all that falls; Riccati's equation",
        ),
        ("PendulumChain", {"at": {"theta": np.pi}, "moves": None, "n": 12}, "28 states are more than the 24"),
        ("Pendulum", {"at": {"theta": np.pi}, "moves": "pivot_z"}, "first order pivot_z cannot change theta"),
        ("CartesianPendulum", {"at": {"x": 0, "z": 2}, "moves": "rod"}, "to first order rod cannot change x"),
        ("Pendulum", {"weights": {"thetta": 1}}, "weights of 'thetta': the states are theta, p_theta"),
        ("Pendulum", {"step_size": 0.0}, "must be > 0"),
        *(
            ("Pendulum", {"step_size": H}, rf"pivot_x every {H:g} s hardly reach all that falls".replace("+", r"\+"))
            for H in (4.0, 8.0, 1e12)
        ),
        ("Pendulum", {"step_size": 1e-300}, r"step_size = 1e-300: give seconds > 0, 1e-100 to 1e\+100$"),
        ("Pendulum", {"at": {"theta": np.nan}}, "at: theta = nan: finite numbers only"),
        ("Pendulum", {"at": {"theta": "up"}}, "at: theta = 'up': give numbers"),
        ("Satellite", {"at": {"attitude": (0, 0, 0, 0)}}, r"attitude = \(0, 0, 0, 0\): give four numbers, not all 0"),
        ("Pendulum", {"effort": 0.0}, r"^effort = 0(\.0)?: .*> 0"),
        ("Pendulum", {"weights": {"theta": -1}}, "weight of theta = -1: must be >= 0"),
        ("Pendulum", {"at": None}, "hold: no equilibrium and no plan: give a mechanism and at="),
        ("Pendulum", {"moves": "theta"}, "is no active coordinate"),
    ],
)
def test_what_cannot_be_held_is_refused_in_one_line(name: str, changed: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"step_size": STEP} | HELD.get(name, {}) | changed
    with pytest.raises(PlanError, match=message) as refused:
        hold(name, **arguments)
    assert "\n" not in str(refused.value)


# ---- round a plan -------------------------------------------------------------------------------------------------

PLANS: dict[str, tuple[str, Any, dict[str, Any]]] = {
    "crane": (
        "Pendulum",
        "pivot_x",
        {
            "start": {"theta": 0, "pivot_x": 0},
            "end": {"theta": 0, "theta_dot": 0, "pivot_x": 1, "pivot_x_dot": 0},
            "duration": 2.0,
            "minimize": "pivot_x_ddot**2",
        },
    ),
    "swing": (
        "Pendulum",
        "length",
        {
            "start": {"theta": 0.5},
            "closed": ["length", "theta", "p_theta"],
            "duration": (1.5, 2.5),
            "minimize": "length_ddot**2",
            "bounds": {"length": (0.5, 1.5)},
            "friction": 0.05,
        },
    ),
    "cat": (
        "PlanarCat",
        None,
        {"start": {"phi": 0}, "end": {"phi": -0.7}, "closed": True, "duration": 0.9, "arm_1": 0.25, "arm_2": 0.25},
    ),
    "constraints": (
        "CartesianPendulum",
        "rod",
        {
            "start": {"x": 0.5, "z": 1 - np.sqrt(0.75)},
            "end": {"rod": 1.2, "rod_dot": 0},
            "duration": 1.7,
            "minimize": "rod_ddot**2",
        },
    ),
    "satellite": ("Satellite", ["wheel_1", "wheel_2"], {"end": {"attitude": (0, 0, 0, 1)}, "duration": 2.0}),
}
REST = {"crane": (), "swing": (), "constraints": (), "cat": ("p_phi",), "satellite": ("H_x", "H_y", "H_z")}


@cache
def planned(name: str) -> Plan:
    mechanism, moves, goal = PLANS[name]
    return plan(mechanism, moves, accuracy=None, **goal)


@pytest.mark.parametrize("name", PLANS)
def test_the_fmus_have_the_monodromy_that_was_predicted(name: str) -> None:
    regulator = hold(planned(name))
    verified(regulator)
    assert regulator.conserved == REST[name]
    assert regulator.returns == (name not in ("crane", "constraints"))
    assert regulator.controlled.size == len(regulator.loop) - len(regulator.conserved)
    if regulator.returns:
        np.testing.assert_allclose(regulator.floquet_multipliers[: len(regulator.conserved)], 1, rtol=0, atol=1e-8)
        assert np.abs(regulator.controlled).max() < 0.99


@pytest.mark.parametrize("name", PLANS)
def test_what_is_not_disturbed_stays_with_the_plan(name: str) -> None:
    motion, regulator = planned(name), hold(planned(name))
    run = regulator.simulate()
    assert np.abs(regulator.deviation(run) / regulator.sizes[:, None]).max() < 1e-8
    end = motion.problem.end
    X = np.array([run[f"{regulator.name}.{state}"][-1] for state in motion.problem.states])
    np.testing.assert_allclose(
        np.array(end.function(X)).ravel(), end.low, rtol=0, atol=1e-7
    )  # the knots are the regulators'


@pytest.mark.variants(core=0)
def test_rounds_contract_by_their_greatest_multiplier() -> None:
    """The cat that has turned too far by 0.01 rad comes back loop by loop; a plan without feedback keeps all of it."""
    regulator = hold(planned("cat"))
    run = regulator.simulate(8 * regulator.duration, phi_0=0.01)
    ends = np.searchsorted(run.time, regulator.duration * np.arange(1, 9) - 1e-6, side="right")
    phi = regulator.deviation(run)[0, np.minimum(ends, run.time.size - 1)]
    np.testing.assert_allclose(phi[4:] / phi[3:-1], np.abs(regulator.controlled[0]), rtol=1e-3)  # 0.01 is not small
    assert run["PlanarCat.phi"][-1] == pytest.approx(-8 * 0.7, abs=2e-3)


@pytest.mark.parametrize("name", ["crane", "swing", "satellite"])
def test_readings_are_samples_of_which_nobody_is_warned(name: str, caplog: pytest.LogCaptureFixture) -> None:
    hold(planned(name)).simulate(pivot_x=0.01) if name == "crane" else hold(planned(name)).simulate()
    assert not caplog.records


def test_after_its_end_a_plan_is_held_at_rest() -> None:
    regulator = hold(planned("crane"))
    pushed = regulator.simulate(15.0, inputs={"theta_force": lambda t: 2.0 if 0.5 < t < 0.7 or 3 < t < 3.2 else 0.0})
    off = np.abs(regulator.deviation(pushed))
    assert off[0].max() > 0.05
    assert off[:, -1].max() < 1e-5
    assert pushed["Pendulum.pivot_x"][-1] == pytest.approx(1.0, abs=1e-5)


def test_a_swing_up_is_held_upright_as_its_goal_says() -> None:
    """Rounding grows by exp(√(g/l) t) on the way: whether it ends at rest is no matter of what is left of it."""
    end = {"theta": np.pi, "theta_dot": 0, "pivot_x": 0, "pivot_x_dot": 0}
    goal: dict[str, Any] = {"start": {"theta": 0, "pivot_x": 0}, "end": end, "duration": 2, "length": 0.5}
    regulator = hold(plan("Pendulum", "pivot_x", minimize="pivot_x_ddot**2", **goal))
    assert regulator.trajectory.after == "rests"
    np.testing.assert_allclose(regulator.trajectory.states[:, -1], [np.pi, 0, 0, 0, 0], rtol=0, atol=1e-9)
    verified(regulator)
    run = regulator.simulate(5, theta_0=0.01)
    np.testing.assert_allclose([run[f"Pendulum.{n}"][-1] for n in ("theta", "pivot_x")], [np.pi, 0], rtol=0, atol=1e-5)


def test_a_plan_that_its_steps_do_not_follow_is_refused_in_one_line() -> None:
    """A quintic of a quarter of a second is none of an upright pendulum's motions, by far."""
    end = {"theta": np.pi, "theta_dot": 0, "pivot_x": 1.0, "pivot_x_dot": 0}
    goal: dict[str, Any] = {"start": {"theta": np.pi}, "end": end, "duration": 2.0, "length": 0.2, "accuracy": None}
    upright = plan("Pendulum", "pivot_x", minimize="pivot_x_ddot**2", **goal)
    with pytest.raises(PlanError, match=r"in steps of 0.25 s the motion misses the plan's end, .*theta by .*: give"):
        hold(upright, step_size=0.25)


@pytest.mark.parametrize(
    ("bounded", "low", "high"),
    [("pivot_x", -0.02, 1.02), ("pivot_x_dot", -0.2, 0.8), ("pivot_x_ddot", -4.2, 4.2)],
)
def test_corrections_keep_to_bounds(bounded: str, low: float, high: float) -> None:
    runs = [
        hold(planned("crane"), bounds=bounds).simulate(6.0, theta_0=0.4)[f"Pendulum.{bounded}"]
        for bounds in ({}, {bounded: (low, high)})
    ]
    beyond = [max(run.max() - high, low - run.min()) for run in runs]
    assert beyond[0] > 0.01
    assert beyond[1] < 1e-3


def test_motors_give_no_more_than_they_can() -> None:
    greatest = []
    for bounds in ({}, {"wheel_1_force": (-0.002, 0.002)}):
        regulator = hold("Satellite", {"attitude": (1, 0, 0, 0)}, step_size=0.5, bounds=bounds)
        run = regulator.simulate(200.0, omega_x_0=0.002)
        greatest.append(np.abs(run["Satellite.wheel_1_force"]).max())
        assert np.abs(regulator.deviation(run)[:4, -1]).max() < 1e-5
    assert greatest[0] > 0.003
    assert greatest[1] == pytest.approx(0.002, rel=0.1)


def test_what_acts_on_a_bounded_force_shares_it() -> None:
    motion = planned("cat")
    regulator, sampled = hold(motion, bounds={"psi_1_force": (-20, 20)}), sampled_mechanism(motion)
    trajectory, limits = regulator.trajectory, regulator.correction_limits
    least, most = limits["lowest"].T, limits["highest"].T
    for (x, sigma), low, high in zip(trajectory.states_and_motion, least, most, strict=True):
        point = sampled.full_state(x[: len(sampled.names)]), *sigma.T
        forces, masses = np.hsplit(np.array(sampled.forces_and_mass(*point)), [1])
        assert forces[0] + masses[0] @ np.where(masses[0] > 0, high, low) <= 20 + 1e-9


@pytest.mark.parametrize(("name", "bound"), [("swing", {}), ("crane", {"pivot_x": (-0.1, 1.05)})])
def test_corrections_keep_to_the_room_of_the_knots_ahead(name: str, bound: dict[str, Any]) -> None:
    """Six knots ahead: those of the next round, or the last one."""
    regulator = hold(planned(name), bounds=bound)
    (low, high), sigma = {"swing": (0.5, 1.5), "crane": (-0.1, 1.05)}[name], regulator.trajectory.motion[0, 0]
    last = sigma.size - 1
    assert regulator.trajectory.after == {"swing": "repeats", "crane": "rests"}[name]
    for k in range(last + 1):
        knots = [(k + j) % last if name == "swing" else min(k + j, last) for j in range(7)]
        assert regulator.correction_limits["least"][0, k] == max(min(0.0, low - sigma[i]) for i in knots)
        assert regulator.correction_limits["most"][0, k] == min(max(0.0, high - sigma[i]) for i in knots)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"at": {"theta": 0}}, "a plan says what moves, where"),
        ({"friction": 1.0}, "a plan says what moves, where, and with which parameters"),
        ({"step_size": 1e-4}, "step_size = 0.0001 over 2 s: more than 10000 steps; give a longer one"),
        ({"bounds": {"pivot_x": (np.nan, 1)}}, r"bounds of pivot_x = \(nan, 1\): give \(low, high\) with low < high"),
        ({"bounds": {"length": (0, 1)}}, "bounds of 'length': the regulators bound pivot_x, "),
        ({"bounds": {"pivot_x_force": (-3, 3)}}, "the effective mass at pivot_x vanishes where it is held"),
        ({"weights": {"phi": 1}}, "weights of 'phi': the states are theta, p_theta"),
    ],
)
def test_a_plan_is_held_as_it_is(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(PlanError, match=message) as refused:
        hold(planned("crane"), **arguments)
    assert "\n" not in str(refused.value)


# ---- whatever the units are ----------------------------------------------------------------------------------------

ALL_SCALES = [*SCALES, (1e3, 1e-3, 1e3)]


@pytest.mark.parametrize("name", HELD)
def test_equilibria_are_held_alike_in_all_units(name: str) -> None:
    usual = HELD[name]
    expected = hold(name, **usual)
    for scale in ALL_SCALES:
        moves = [usual["moves"]] if isinstance(usual["moves"], str) else usual["moves"]
        options: dict[str, Any] = parameters(name, scale, {}, moves) | {"step_size": usual["step_size"] * scale[2]}
        regulator = hold(name, scaled(usual["at"], sizes(name, scale)), moves, **options)
        # Of a double multiplier half the digits are left.
        np.testing.assert_allclose(
            np.sort(np.abs(regulator.floquet_multipliers)),
            np.sort(np.abs(expected.floquet_multipliers)),
            rtol=0,
            atol=1e-5,
        )
        np.testing.assert_allclose(regulator.loop, expected.loop, rtol=0, atol=1e-6 * np.abs(expected.loop).max())
        assert (regulator.conserved, regulator.controlled.size) == (expected.conserved, expected.controlled.size)


@cache
def in_units(name: str, scale: Scale) -> Plan:
    """A plan that is the same in other units: nothing is planned anew."""
    motion = planned(name)
    goal, solution = motion.goal, motion.solution
    of = sizes(goal.component, scale)
    rows, controls = (
        np.array([of[n] for n in names])[:, None] for names in (motion.problem.states, motion.problem.controls)
    )
    trajectory = solution.trajectory
    trajectory = replace(
        trajectory,
        durations=trajectory.durations * scale[2],
        knots=trajectory.knots * rows,
        inner=trajectory.inner * rows,
        controls=trajectory.controls * controls,
    )
    goal = replace(
        goal,
        start=scaled(goal.start, of),
        end=scaled(goal.end, of),
        duration=times(goal.duration, scale[2]),
        values=parameters(goal.component, scale, dict(goal.values), goal.moves),
    )
    return Plan(goal, optimal_control_problem(goal), replace(solution, trajectory=trajectory))


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANS)
@pytest.mark.parametrize("scale", ALL_SCALES)
def test_plans_are_held_alike_in_all_units(name: str, scale: Scale) -> None:
    expected, regulator = hold(planned(name)), hold(in_units(name, scale))
    mine, theirs = (np.sort(np.abs(one.floquet_multipliers)) for one in (regulator, expected))  # whatever the basis
    np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-4 * np.max(theirs))
    assert (regulator.trajectory.after, regulator.conserved) == (expected.trajectory.after, expected.conserved)
    verified(regulator)


def test_a_heavy_load_stays_where_it_was_brought() -> None:
    """500 kg on 5 m: momenta of 1e4 kg m²/s, whose mesh error is no motion."""
    goal: dict[str, Any] = PLANS["crane"][2] | {"duration": 8.0, "length": 5.0, "mass": 500.0}
    regulator = hold(plan("Pendulum", "pivot_x", accuracy=None, **goal))
    assert regulator.trajectory.after == "rests"
    assert regulator.simulate(40.0)["Pendulum.pivot_x"][-1] == pytest.approx(1.0, abs=1e-6)
    assert any("undisturbed" in verdict.claim and verdict.passed for verdict in regulator.verify())


def test_what_drifts_off_fails_its_verdict() -> None:
    regulator = hold(planned("crane"))
    lost = replace(regulator, trajectory=replace(regulator.trajectory, motion=regulator.trajectory.motion + 1e-3))
    assert not lost.verify()[-1].passed


# ---- tables ---------------------------------------------------------------------------------------------------------


@pytest.mark.variants(core=0)
def test_a_plan_of_more_steps_than_parameters_is_held_by_a_table_in_a_file() -> None:
    regulator = hold(planned("crane"), step_size=0.01)
    assert regulator.trajectory.times.size > KNOTS
    run = regulator.simulate(15.0, theta_0=0.2)
    assert np.abs(regulator.deviation(run)[:, -1]).max() < 1e-5
    undisturbed = regulator.simulate()
    assert np.abs(regulator.deviation(undisturbed)).max() < 1e-8
    usual = hold(planned("crane"), step_size=0.05)
    assert usual.trajectory.times.size <= KNOTS
    in_file = replace(usual, correction_limits={})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("liaisons_catalogue.regulator.KNOTS", 10)
        run = in_file.simulate(3.0, theta_0=0.2)
    expected = replace(usual, correction_limits={}).simulate(3.0, theta_0=0.2)
    np.testing.assert_array_equal(run["Pendulum.theta"], expected["Pendulum.theta"])  # a file or parameters


def test_the_next_jump_is_the_first_pair_that_differs_and_is_still_to_come() -> None:
    times = np.array([0.0, 1.0, 1 + 1e-9, 2.0, 2 + 1e-9, 3.0, 3 + 1e-9])
    planned_values = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.0])[None, None]  # the last pair does not differ
    trajectory = ReferenceTrajectory(times, planned_values, planned_values[0], "ends")
    np.testing.assert_array_equal(
        trajectory.next_jump_times(1e-6), [times[2], times[2], times[4], times[4], *[1e30] * 3]
    )


@pytest.mark.parametrize("most", [KNOTS, 10])
def test_jumps_are_announced_from_parameters_and_from_a_file(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The crane's acceleration does not end at 0."""
    regulator = hold(planned("crane"), step_size=0.1)
    monkeypatch.setattr("liaisons_catalogue.regulator.KNOTS", most)
    name = "Pendulum_pivot_x.next_event_time"
    jumps, samples = (
        system.simulate(times=regulator.times(3.0), coupling="gauss-seidel", record=name)
        for system in (regulator._connected_system({}), regulator.system())
    )
    np.testing.assert_allclose(jumps[name][jumps.time < 2], 2, rtol=1e-12)
    assert np.all(jumps[name][jumps.time >= 2] > 1e29)
    expected = 0.1 * (np.floor(samples.time / 0.1 + 1e-6) + 1)
    is_at_the_jump = np.abs(samples.time - 2) < 1e-8  # it is sampled 2e-9 s before, too
    np.testing.assert_allclose(samples[name], np.where(is_at_the_jump, samples[name], expected), rtol=0, atol=3e-9)


@pytest.mark.parametrize("step", [0.02, 0.03, 0.05, 0.0125])
def test_a_held_plan_is_held_alike_at_any_step(step: float) -> None:
    """The run takes the samples, each 0.05 s, as communication points of its own accord."""
    regulator = hold(planned("crane"))
    expected = regulator.simulate(3.0, theta_0=0.2)
    run = regulator.system(theta_0=0.2).simulate(3.0, step, tolerance=1e-11)
    rows, others = np.nonzero(np.abs(run.time[:, None] - expected.time) < 1e-9)
    assert len(rows) > 10
    # The mechanism's polynomials are those of a part of the period: of sixth order in it.
    np.testing.assert_allclose(run["Pendulum.theta"][rows], expected["Pendulum.theta"][others], rtol=0, atol=3e-8)


def test_a_regulator_refuses_steps_that_miss_its_samples() -> None:
    equilibrium = hold("Pendulum", **HELD["Pendulum"])
    ends = [
        equilibrium.system(theta_0=np.pi + 0.01).simulate(0.4, STEP / parts, tolerance=1e-11)["Pendulum.theta"][-1]
        for parts in (2, 4, 16)
    ]
    assert abs(ends[1] - ends[2]) < abs(ends[0] - ends[2]) / 3  # of second order: σ̈ is extrapolated; samples stay
    assert abs(ends[1] - ends[2]) < 1e-3 * 0.01
    start = {"theta_0": np.pi + 0.01}
    for step in (1.5 * STEP, 2 * STEP):
        run = equilibrium.system(start_values=start).simulate(0.4, step, tolerance=1e-11)  # it stops at samples, too
        assert abs(run["Pendulum.theta"][-1] - ends[0]) < abs(ends[0] - ends[2]) * 10
        with pytest.raises(LiaisonsError, match="each sample has to be a communication point: choose a communication"):
            equilibrium._connected_system(start).simulate(0.4, step)


def test_a_time_optimal_plan_is_held_with_the_step_that_it_chooses() -> None:
    goal = PLANS["crane"][2] | {"duration": (1.0, 4.0), "minimize": "time", "bounds": {"pivot_x_ddot": (-4, 4)}}
    regulator = hold(plan("Pendulum", "pivot_x", accuracy=None, **goal))
    assert regulator.trajectory.after == "rests"
    assert np.abs(regulator.deviation(regulator.simulate())).max() < 1e-6


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_the_code_of_a_regulator_is_small(fmi: Any) -> None:
    assert len(model_code(component_model(component("Regulator")), "", fmi)) <= 100_000  # gcc once took 7.5 GB for it


def test_what_is_no_push_is_refused(caplog: pytest.LogCaptureFixture) -> None:
    regulator: Any = hold(planned("constraints"))
    for arguments, message in (
        ({"duration": np.nan}, "survives: duration = nan: must be a finite number"),
        ({"duration": 0}, "survives: duration = 0: must be > 0"),
        ({"duration": -1}, "survives: duration = -1: must be > 0"),
        ({"duration": 1, "stop_time": 1}, "stop_time = 1 s: must be greater than the push, duration = 1 s"),
        ({"duration": 1, "stop_time": 1e9}, "points, and 8 signals at each of them .* of memory"),
        ({"duration": 1, "port": "x_fource"}, "no input 'x_fource' is free; did you mean 'x_force'"),
    ):
        with pytest.raises(LiaisonsError, match=message):
            regulator.survives(**({"port": "x_force"} | arguments))
    for stop, message in (
        (np.nan, "stop_time = "),
        (0.0, "> 0"),
        ("late", "stop_time = "),
        (1e9, "of memory are free"),
    ):
        with pytest.raises(LiaisonsError, match=message):
            regulator.simulate(stop)
    assert regulator.trajectory.after == "ends"
    regulator.simulate(1.1 * regulator.duration)
    assert "the plan ends in motion at 1.7 s" in caplog.text


def test_an_archive_says_what_the_regulator_does() -> None:
    system = hold(planned("crane")).system()
    assert system.name.isidentifier()
    assert system.experiment is not None
    assert (system.experiment.stop_time, system.experiment.step_size) == (2.0, pytest.approx(0.05))
