"""Observers: covariances against closed forms and each other, errors of two hundred runs, refusals in one line."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_discrete_are

from liaisons import Controller, Observer, hold, identify, observe, plan
from liaisons.errors import PlanError

from .conftest import verified

NOISE, PUSH, GRAVITY = 0.01, 0.1, 9.81
UPRIGHT: dict[str, Any] = {"at": {"theta": np.pi, "pivot_x": 0}, "moves": "pivot_x"}
ANGLE: dict[str, Any] = {"measured": "theta", "noise": {"theta": NOISE}, "disturbance": {"theta_force": PUSH}}
HANGING: dict[str, Any] = {"at": {"theta": 0}, "moves": "length", "step_size": 0.02}
ON_A_ROD: dict[str, Any] = {"at": {"x": 0, "z": 0}, "moves": "rod", "step_size": 0.02}
ACROSS: dict[str, Any] = {"measured": "x", "noise": {"x": NOISE}, "disturbance": {"x_force": PUSH}}


@cache
def held_pendulum() -> Controller:
    return hold("Pendulum", step_size=0.02, **UPRIGHT, **ANGLE)


def covariance(observer: Observer) -> np.ndarray:
    """Before a measurement, in SI units."""
    sizes = observer.model.sizes
    return observer.covariance * np.outer(sizes, sizes)


def test_covariances_tend_to_those_in_continuous_time() -> None:
    """θ'' = a θ + f, density q of f and r of the noise: p_12 = r (a + √(a² + q/r)), p_11 = √(2 r p_12)."""
    errors = []
    for H in (2e-3, 1e-3):
        arguments: dict[str, Any] = UPRIGHT | ANGLE | {"noise": {"theta": NOISE / np.sqrt(H)}}
        observer = observe("Pendulum", step_size=H, **arguments)
        r, q = NOISE**2, PUSH**2
        mixed = r * (GRAVITY + np.sqrt(GRAVITY**2 + q / r))
        P = covariance(observer)
        errors.append(np.array([P[0, 0] / np.sqrt(2 * r * mixed), P[0, 1] / mixed]) - 1)
    assert np.max(np.abs(errors[1])) < 5e-3
    np.testing.assert_allclose(errors[1], errors[0] / 2, rtol=2e-2)  # of first order in H


def test_multipliers_are_those_of_the_innovation() -> None:
    """(I - K C) F of the filter, from two samples of its own function beside the mechanism's."""
    observer = observe("Pendulum", step_size=0.02, **UPRIGHT, **ANGLE)
    model, sigma = observer.model, observer.model.sampled.sigma
    step, x = model.filter_step(observer.covariance), model.start

    def after(off: np.ndarray) -> np.ndarray:
        """The estimate where the mechanism is at rest, and it was off before."""
        y = np.array(model.measure(x, sigma)[0])
        return np.array(step(0, x + off, [], sigma, sigma, y)[0]).ravel() - x

    matrix = np.transpose([(after(1e-6 * e) - after(-1e-6 * e)) / 2e-6 for e in np.eye(len(x))])
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(matrix)), np.sort(observer.multipliers), rtol=1e-6)
    assert np.max(np.abs(observer.multipliers)) < 1


def test_a_measurement_is_compared_with_what_sigma_makes_of_it_at_its_own_instant() -> None:
    """The pivot has moved by 0.3 m within the period: what is read at its end contradicts the estimate in nothing."""
    place = {"measured": "bob_x", "noise": {"bob_x": NOISE}}
    observer = observe("Pendulum", step_size=0.02, **UPRIGHT | ANGLE | place)
    model, begin = observer.model, np.array(observer.model.sampled.sigma)
    end = np.add(begin, [[0.3, 0.0, 0.0]])
    y = np.array(model.measure(model.start, end)[0])
    assert y[0] == pytest.approx(0.3 / NOISE, rel=1e-12)
    x, _, innovations = model.filter_step(observer.covariance)(1, model.start, [], begin, end, y)
    np.testing.assert_allclose(np.array(innovations), 0, rtol=0, atol=1e-9)  # of readings of 30
    np.testing.assert_allclose(np.array(x).ravel(), model.start, rtol=0, atol=1e-12)


TILTED = {"at": {"theta": np.pi / 6}, "moves": "pivot_x", "step_size": 0.02}
CHAIN = {"at": {"theta": np.pi, "pivot_x": 0}, "moves": "pivot_x", "step_size": 0.01, "n": 2}
PUSHED: dict[str, tuple[str, dict[str, Any]]] = {
    "a pendulum": ("Pendulum", {"step_size": 0.02, **UPRIGHT, **ANGLE}),
    "a bias": ("Pendulum", {"step_size": 0.02, "bias": {"theta": 0.02}, **UPRIGHT, **ANGLE}),
    "an unknown force": ("Pendulum", {"step_size": 0.02, "unknown_forces": {"theta_force": 1.0}, **UPRIGHT, **ANGLE}),
    "a constraint": ("CartesianPendulum", {**ON_A_ROD, **ACROSS}),
    "an array": ("PendulumChain", {**CHAIN, **ANGLE}),
    "a constant torque": ("Pendulum", {**TILTED, **ANGLE, "theta_force": GRAVITY / 2}),
}


@cache
def pushed(name: str) -> Observer:
    mechanism, arguments = PUSHED[name]
    return observe(mechanism, **arguments)


@pytest.mark.parametrize("name", PUSHED)
def test_the_extended_filter_at_rest_tends_to_the_steady_one(name: str) -> None:
    """Its covariance, in all redundant states and without Riccati's equation."""
    observer = pushed(name)
    model, sigma, n = observer.model, observer.model.sampled.sigma, len(observer.model.states)
    step, y = model.filter_step(None), np.array(model.measure(model.start, sigma)[0])
    columns, rows = np.triu_indices(n)
    P = 0.01 * observer.directions @ observer.directions.T
    x, innovations = model.start, y
    for k in range(20000):
        results = step(k == 0, model.start, P[rows, columns], sigma, sigma, y)
        x, triangle, innovations = (np.array(result).ravel() for result in results)
        before, P = P, np.zeros((n, n))
        P[rows, columns] = P[columns, rows] = triangle
        if np.allclose(P, before, rtol=1e-10, atol=1e-14):
            break
    np.testing.assert_allclose(P, observer.corrected[0], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(innovations, 0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(x, model.start, rtol=0, atol=1e-12)


def test_constraints_change_nothing() -> None:
    """A pendulum on a rod of two constraints and one with an angle: x = l θ, p_x = p_θ/l."""
    by_angle = observe("Pendulum", **HANGING, **ANGLE).standard_deviations
    on_a_rod = observe("CartesianPendulum", **ON_A_ROD, **ACROSS).standard_deviations
    assert on_a_rod["x"] == pytest.approx(by_angle["theta"], rel=1e-4)  # what Runge-Kutta leaves in x'' and θ''
    assert on_a_rod["p_x"] == pytest.approx(by_angle["p_theta"], rel=1e-4)
    assert max(on_a_rod[name] for name in ("y", "z", "p_z")) < 1e-9


@cache
def satellite() -> Observer:
    stop = {f"wheel_{i}_dot": 0 for i in (1, 2, 3)}
    motion = plan("Satellite", end={"attitude": (0.8, 0, 0, 0.6)} | stop, duration=5.0, minimize="effort")
    return observe(motion, "attitude", {"attitude": NOISE})


def test_quaternions_stay_on_their_sphere() -> None:
    observer = satellite()
    model = observer.model
    assert model.measured == ("q_w", "q_x", "q_y", "q_z")
    step, n, x, sigma = model.filter_step(None), len(model.states), model.start, model.sampled.sigma
    columns, rows = np.triu_indices(n)
    triangle, random = observer.covariance[rows, columns], np.random.default_rng(2)
    for k in range(5):
        y = np.array(model.measure(model.start, sigma)[0]).ravel() + random.standard_normal(4)
        x, triangle, _ = (np.array(z).ravel() for z in step(k == 0, x, triangle, sigma, sigma, y))
    P = np.zeros((n, n))
    P[rows, columns] = P[columns, rows] = triangle
    q = x[:4] * model.sizes[:4]
    assert np.linalg.norm(q) == pytest.approx(1, abs=1e-14)
    np.testing.assert_allclose(P[:, :4] @ (q / model.sizes[:4]), 0, rtol=0, atol=1e-14)
    assert np.linalg.matrix_rank(P, tol=1e-9) == n - 1


def test_a_rotation_is_measured_as_three_angles() -> None:
    """Half the angle of four components with the noise s: its deviation is 2 s, less what was known before."""
    observer = satellite()
    deviations = observer.standard_deviations
    assert deviations["q_w"] < 1e-4  # of second order in s
    known = 0.1 * observer.model.sizes[1]
    for axis in "xyz":
        assert deviations[f"q_{axis}"] == pytest.approx(1 / np.hypot(1 / NOISE, 1 / known), rel=1e-6)


@pytest.mark.variants(core=0)
def test_the_loop_with_an_observer_does_what_was_predicted() -> None:
    claims = verified(held_pendulum())
    assert len(claims) == 9
    assert any("tr(S W)" in claim for claim in claims)
    assert "multipliers of the loop are those of feedback and of the observer" in claims


def test_the_fmu_is_a_kalman_filter_of_the_pendulum() -> None:
    """By hand: θ'' = -g sin θ - σ'' cos θ, σ'' constant in a period, and the gain for F = exp(A H) at the top."""
    step, run = 0.02, held_pendulum().simulate(2.0, theta_0=np.pi + 0.1)
    root = np.sqrt(GRAVITY)
    c, s = np.cosh(root * step), np.sinh(root * step)
    F, G = np.array([[c, s / root], [root * s, c]]), np.array([[(c - 1) / GRAVITY], [s / root]])
    C = np.array([[1.0, 0.0]])
    P = solve_discrete_are(F.T, C.T, G @ G.T * PUSH**2 / step, [[NOISE**2]])
    gain = P[:, 0] / (P[0, 0] + NOISE**2)
    estimate, estimates = np.array([np.pi, 0.0]), []
    for k, read in enumerate(run["Pendulum.theta"]):
        if k:
            rate, acceleration = (run[f"Pendulum_pivot_x.{y}"][k - 1] for y in ("y_dot", "y_ddot"))

            def rates(t: float, y: np.ndarray, start: float = rate, slope: float = acceleration) -> list[float]:
                theta_dot = y[1] - (start + slope * t) * np.cos(y[0])  # p = θ' + σ' cos θ
                return [theta_dot, -np.sin(y[0]) * (GRAVITY + (start + slope * t) * theta_dot)]

            estimate = solve_ivp(rates, (0, step), estimate, rtol=1e-10, atol=1e-12).y[:, -1]
        estimate = estimate + gain * (read - estimate[0])
        estimates.append(estimate)
    theta, p_theta = np.transpose(estimates)
    # One Runge-Kutta step of 0.063 radian leaves 0.063^5/120 = 8e-9, of estimates that are off by less than 1.
    np.testing.assert_allclose(run["Pendulum_observer.theta"], theta, rtol=0, atol=1e-7)
    np.testing.assert_allclose(run["Pendulum_observer.p_theta"], p_theta, rtol=0, atol=1e-6)
    assert abs(run["Pendulum_observer.p_theta"][-1] - run["Pendulum.p_theta"][-1]) < 1e-3


def test_rates_divided_by_sizes_are_the_same_in_all_units() -> None:
    """Of a pendulum of 4 mm and 5 kg, and of one of 1 m and 1 kg, in corresponding states."""
    found = []
    for length, mass in ((1.0, 1.0), (4e-3, 5.0)):
        arguments: dict[str, Any] = UPRIGHT | ANGLE | {"disturbance": {"theta_force": PUSH * mass * length}}
        numbers = {"step_size": 0.02 * np.sqrt(length), "length": length, "mass": mass}
        symbols = observe("Pendulum", **arguments, **numbers).model.sampled.symbols
        rates = ca.Function("rates", [ca.vertcat(*symbols.arguments)], [symbols.relative_rates])
        found.append(np.array(rates([0.5, 0.3 * mass * length**1.5, 0, 0, 0])).ravel())
    np.testing.assert_allclose(found[1], found[0], rtol=1e-12)
    assert found[0][1] == pytest.approx(-np.sin(0.5), rel=1e-12)  # of torques m g l


def test_a_filter_that_is_wrong_about_its_errors_fails() -> None:
    observer = held_pendulum().observer
    assert observer is not None
    runs = observer.random_runs(observer.system())
    for factor in (0.5, 2.0):
        wrong = replace(observer, covariance=factor * observer.covariance)
        assert [verdict.passed for verdict in wrong.consistency(runs)] == [True, True, False]


def test_a_filter_that_is_wrong_about_noise_fails() -> None:
    """Noise of twice the size: innovations are too large, and are not white."""
    observer = held_pendulum().observer
    assert observer is not None
    arguments: dict[str, Any] = UPRIGHT | ANGLE | {"noise": {"theta": 2 * NOISE}}
    model = observe("Pendulum", step_size=0.02, **arguments).model
    other = replace(observer, model=model)
    vars(other)["fmu"] = observer.fmu
    assert [verdict.passed for verdict in other.verify()] == [False, False, False]


OBSERVABLE = {"attitude": (1, 0.1, 0.2, -0.3)}
DOWN: dict[str, Any] = {"at": {"theta": 0.0}, "moves": "pivot_x", "disturbance": {"theta_force": 0.1}}
WHEELS = ["wheel_1", "wheel_2", "wheel_3"]


@pytest.mark.parametrize(
    ("mechanism", "arguments", "words"),
    [
        ("Pendulum", {**UPRIGHT, **ANGLE, "measured": "pivot_x", "noise": {"pivot_x": 1}}, "pivot_x shows no change"),
        (
            "Pendulum",
            {**UPRIGHT, **ANGLE, "bias": {"theta": 1}, "unknown_forces": {"theta_force": 1}},
            "theta shows no change along theta - 1 theta_bias - 9.81 theta_force",
        ),
        (
            "PlanarCat",
            {"at": {"psi_1": 0.5}, "measured": "p_phi", "noise": {"p_phi": 1}, "disturbance": {"phi_force": 1}},
            "p_phi shows no change along phi",
        ),
        (
            "Satellite",
            {"at": OBSERVABLE, "moves": WHEELS, "measured": "attitude", "noise": {"attitude": 1}},
            "whose estimate would not be corrected in the long run; random forces act on no port",
        ),
        ("Pendulum", {**UPRIGHT, **ANGLE, "at": {"theta": 1}}, "this is no equilibrium: the rate of p_theta"),
        ("Pendulum", {**ANGLE}, "no equilibrium and no plan"),
        ("Pendulum", {**UPRIGHT, **ANGLE, "measured": []}, "measured is nothing"),
        ("Pendulum", {**UPRIGHT, **ANGLE, "noise": {}}, "noise is that of nothing"),
        (
            "Pendulum",
            {**UPRIGHT, **ANGLE, "noise": {"thet": 1}},
            "noise is that of thet, bias that of nothing: name outputs",
        ),
        ("Pendulum", {**UPRIGHT, **ANGLE, "noise": {"theta": 0}}, "noise of theta = 0: must be > 0"),
        ("Pendulum", {**UPRIGHT, **ANGLE, "bias": {"p_theta": 1}}, "bias that of p_theta"),
        ("Pendulum", {**UPRIGHT, **ANGLE, "disturbance": {"thet_force": 1}}, "did you mean 'theta_force'?"),
        (
            "Pendulum",
            {**UPRIGHT, **ANGLE, "measured": "theta_ddot", "noise": {"theta_ddot": 1}},
            "a random force is part of what is measured; measure no accelerations",
        ),
        ("Pendulum", {**UPRIGHT, **ANGLE, "measured": "thet", "noise": {"thet": 1}}, "did you mean 'theta'?"),
        ("Pendulum", {**UPRIGHT, **ANGLE, "deviations": {"theta": 1}}, "deviations are those at the start of a plan"),
        ("Pendulum", {**UPRIGHT, **ANGLE, "step_size": 0}, "step_size = 0: must be > 0"),
        *(
            ("Pendulum", {**DOWN, **ANGLE, **values}, "Riccati's equation has no solution in 16 digits; give standard")
            for size in (1e-12, 1e12)
            for values in ({"noise": {"theta": size}}, {"disturbance": {"theta_force": size}})
        ),
        ("Pendulum", {**DOWN, **ANGLE, "disturbance": {"theta_force": 1e300}}, "disturbance of theta_force = 1e+300"),
        ("PlanarCat", {"at": {}, "measured": "com_x", "noise": {"com_x": 1}}, "com_x depends on com_x"),
    ],
)
def test_refusals_name_the_cause(mechanism: str, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(PlanError) as caught:
        observe(mechanism, **arguments)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_hold_refuses_a_plan_that_jumps_between_samples() -> None:
    """Bang-bang: σ̈ jumps at a quarter, a half and three quarters, between which samples are even."""
    ends: dict[str, Any] = {"start": {"theta": 0.0, "pivot_x": 0.0}, "end": {"theta": 0.0, "theta_dot": 0.0}}
    ends["end"] |= {"pivot_x": 1.0, "pivot_x_dot": 0.0}
    motion = plan("Pendulum", "pivot_x", duration=(1, 3), minimize="time", bounds={"pivot_x_ddot": (-3, 3)}, **ends)
    with pytest.raises(PlanError, match="σ̈ jumps between two samples of"):
        hold(motion, measured="theta", noise={"theta": NOISE})


def test_hold_takes_noise_with_what_is_measured() -> None:
    with pytest.raises(PlanError, match="give measured, too"):
        hold("Pendulum", **UPRIGHT, noise={"theta": 0.1})


def test_what_identify_estimates_is_the_noise() -> None:
    """One line from residuals to the filter."""
    random, t = np.random.default_rng(0), np.linspace(0, 5, 400)
    theta = 0.1 * np.cos(np.sqrt(GRAVITY) * t) + NOISE * random.standard_normal(400)
    fit = identify("Pendulum", {"time": t, "theta": theta}, ["theta_0"])
    observer = observe(
        "Pendulum", "theta", dict(zip(["theta"], fit.noise[0], strict=True)), {"theta_force": PUSH}, **HANGING
    )
    assert observer.model.noise.item() == pytest.approx(NOISE, rel=0.1)


@pytest.mark.variants(core=0)
def test_a_crane_along_its_plan() -> None:
    """The covariance is a state of the FMU; in 2 s a load of 0.3 rad/s is known to a hundredth of it."""
    ends: dict[str, Any] = {"theta": 0.0, "theta_dot": 0.0, "pivot_x": 1.0, "pivot_x_dot": 0.0}
    start = {"theta": 0.0, "pivot_x": 0.0}
    motion = plan("Pendulum", "pivot_x", start=start, end=ends, duration=2.0, minimize="pivot_x_ddot**2")
    observer = observe(motion, "theta", {"theta": NOISE}, {"theta_force": 0.01}, deviations={"p_theta": 0.3})
    assert observer.covariance[1, 1] * observer.model.sizes[1] ** 2 == pytest.approx(0.3**2)
    verified(observer)
    run = observer.system(theta_dot_0=0.3).simulate(2.0, observer.model.period, coupling="gauss-seidel")
    assert run["Pendulum_observer.p_theta"][-1] == pytest.approx(run["Pendulum.p_theta"][-1], abs=3e-3)
    assert run["Pendulum_observer.covariance_2_2"][-1] < 0.1 * observer.covariance[1, 1]


@pytest.mark.slow
def test_a_double_pendulum_stands_by_two_angles() -> None:
    """Pushed all the time, measured with noise: eigenvalues separate, and the cost is that of the formula."""
    angles = ["theta_1", "theta_2"]
    upright = dict.fromkeys(angles, np.pi) | {"pivot_x": 0}
    controller = hold(
        "DoublePendulum",
        upright,
        "pivot_x",
        step_size=0.01,
        measured=angles,
        noise=dict.fromkeys(angles, 1e-3),
        disturbance={f"{angle}_force": 1e-3 for angle in angles},
    )
    assert len(verified(controller)) == 9
    run = controller.simulate(6.0, theta_1_0=np.pi + 0.02)
    assert abs(run["DoublePendulum.theta_1"][-1] - np.pi) < 1e-4


@pytest.mark.slow
def test_a_satellite_along_its_plan() -> None:
    """Its momentum, which no sensor shows, is estimated from its attitude."""
    verified(satellite())


@pytest.mark.slow
def test_a_cat_along_its_plan() -> None:
    arms = {"arm_1": 0.25, "arm_2": 0.25, "bounds": {"psi_1": (-3, 3), "psi_2": (-3, 3)}}
    cat = plan("PlanarCat", start={"phi": 0}, end={"phi": -0.08}, closed=True, duration=0.9, **arms)
    verified(observe(cat, "phi", {"phi": NOISE}, {"phi_force": 0.003}))
    held = hold(cat, measured="phi", noise={"phi": NOISE}, disturbance={"phi_force": 0.003})
    verified(held)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a bias", "a constraint", "an array", "a constant torque"])
def test_errors_are_of_the_size_that_covariances_say(name: str) -> None:
    verified(pushed(name))


@pytest.mark.slow
def test_a_hoop_that_turns_is_observed() -> None:
    """σ moves: an equilibrium in its frame."""
    far_side = {"xi": np.pi, "beta_dot": 2.0}
    seen: dict[str, Any] = {"measured": "xi", "noise": {"xi": 1e-3}, "disturbance": {"xi_force": 1e-2}}
    verified(hold("CircularHoop", far_side, step_size=0.02, **seen))


@pytest.mark.slow
def test_an_unknown_force_and_a_hanging_angle_are_estimated() -> None:
    """Without noise: 10 radians, in which the slowest multiplier decays."""
    forces: dict[str, Any] = {"unknown_forces": {"theta_force": 1.0}}
    observer = observe("Pendulum", **HANGING, **ANGLE, **forces)
    stop = np.log(1e-3) / np.log(np.max(np.abs(observer.multipliers))) * 0.02
    with observer.system().start(step_size=0.02, coupling="jacobi") as run:
        while run.time < stop:
            run.step({"Pendulum.theta_force": 0.3})
        assert run["Pendulum_observer.theta_force"] == pytest.approx(0.3, abs=0.002)
        assert run["Pendulum_observer.p_theta"] == pytest.approx(run["Pendulum.p_theta"], abs=1e-3)
