"""The closed forms against what they must satisfy: the equations of motion, series with 40 digits, known integrals."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from on_paper import State, derivative, sine_and_cosine, taylor
from scipy.integrate import quad

from liaisons.language import Mechanism
from liaisons.models import CircularHoop, Flywheel, Junction, Oscillator, Pendulum, Swing

# ---- every closed form solves the derived equations --------------------------------------------------------------

CASES: list[tuple[type[Mechanism], dict[str, float]]] = [
    (Pendulum, {"theta_0": 2.5, "length": 1.3, "mass": 2.0}),
    (Pendulum, {"theta_0": -0.4, "theta_dot_0": -8.0}),
    (Pendulum, {"theta_0": 10.0, "theta_dot_0": 0.3}),
    (Oscillator, {"x_0": 1.0, "stiffness": 4.0, "damping": 0.3, "support": 0.2, "x_force": 0.7, "mass": 1.5}),
    (Oscillator, {"x_dot_0": 1.0, "damping": 2.0}),
    (Oscillator, {"x_dot_0": 1.0, "x_0": 0.5, "damping": 7.0}),
    (Oscillator, {"x_dot_0": 1.0, "stiffness": 0.0, "x_force": 0.5, "damping": 1e-6}),
    (Flywheel, {"angle_0": 1.0, "angle_dot_0": 3.0, "friction": 0.4, "inertia": 2.0, "angle_force": 0.7}),
    (Junction, {"inertia": 2.0, "angle_0": 1.0, "angle_dot_0": 0.4, "angle_force": 0.5}),
    (Swing, {"theta_0": 1.2, "theta_dot_0": 0.5, "lean": 0.7, "mass_torso": 30.0}),
    (Swing, {"theta_dot_0": -6.0, "lean": 2.0, "rope": 1.5, "torso_length": 0.8}),
    (CircularHoop, {"xi_0": 1.0, "xi_dot_0": 0.3, "beta_dot": 2.0, "radius": 1.4, "offset": 0.6, "mass": 2.0}),
    (CircularHoop, {"xi_dot_0": -3.0, "beta_dot": -1.0}),
    (CircularHoop, {"xi_0": 0.3, "xi_dot_0": 0.4, "beta_dot": 1.0, "offset": 0.0}),
]


@pytest.mark.parametrize(("component", "start"), CASES)
def test_closed_form_solves_the_derived_equations(component, start: dict[str, float]) -> None:
    (coordinate,) = component.coordinates
    q = coordinate.name
    still = {name: value for name, value in start.items() if name not in (f"{q}_0", f"{q}_dot_0")}

    def exact(name: str, t: float) -> float:
        return float(component.exact(t, **start)[name])

    at_start = component.exact(0.0, **start)
    assert at_start[q] == pytest.approx(start.get(f"{q}_0", coordinate.start), rel=1e-15, abs=1e-15)
    assert at_start[f"{q}_dot"] == pytest.approx(start.get(f"{q}_dot_0", coordinate.start_rate), rel=1e-15, abs=1e-15)

    for t in (0.31, 1.7, 4.4):
        state = State(component, still | {q: exact(q, t), f"{q}_dot": exact(f"{q}_dot", t)})
        # Truncation h¹⁰ ω¹¹/2772 with h = 0.02 and harmonics up to ω ≈ 15, and roundings of q/h.
        assert derivative(lambda t: exact(q, t), t) == pytest.approx(exact(f"{q}_dot", t), rel=1e-9, abs=1e-9)
        q_ddot = state("accelerations")
        assert derivative(lambda t: exact(f"{q}_dot", t), t) == pytest.approx(q_ddot, rel=1e-9, abs=1e-9)
        for name in {*at_start} - {q, f"{q}_dot"}:  # angles, forces, powers
            derived = state({"beta_force": "operator_forces", "beta_power": "power"}.get(name) or name)
            # The same numbers from two expressions: roundings of their terms.
            assert derived == pytest.approx(exact(name, t), rel=1e-12, abs=1e-12)


# ---- pendulum: elliptic functions --------------------------------------------------------------------------------

GRAVITY = 9.81
FREQUENCY = np.sqrt(GRAVITY)  # of the default pendulum


def pendulum_reference(times: NDArray, theta_0: float, theta_dot_0: float) -> NDArray:
    rates = [{(1,): 1}, {(2,): -Decimal(GRAVITY)}, {(3, 1): 1}, {(2, 1): -1}]
    # θ' = ω, ω' = -g s, s' = c ω, c' = -s ω
    return taylor(times, [theta_0, theta_dot_0, *sine_and_cosine(theta_0)], rates)[:2]


LIBRATIONS = [(0.1, 0.0), (2.5, 0.3), (-3.0, -1.2), (3.1, 0.0), (10.0, 0.0), (np.pi, 0.0), (-np.pi, 1e-17)]
ROTATIONS = [(0.0, 7.0), (1.0, -8.0), (10.0, 20.0), (np.pi, 0.5), (-np.pi, 1e-9)]


@pytest.mark.parametrize(("theta_0", "theta_dot_0"), [*LIBRATIONS, *ROTATIONS])
def test_pendulum_is_exact_to_rounding(theta_0: float, theta_dot_0: float) -> None:
    times = np.linspace(0, 20, 41)
    theta, theta_dot = pendulum_reference(times, theta_0, theta_dot_0)
    exact = Pendulum.exact(times, theta_0=theta_0, theta_dot_0=theta_dot_0)
    # Two roundings of the phase Ω t, times the largest rate and acceleration; θ = π starts at an unstable
    # equilibrium and keeps its digits because 1 - k² is a product.
    speed = max(1.0, np.max(np.abs(theta_dot)))
    phase = 4e-16 * times[-1] * max(FREQUENCY, speed)
    assert np.max(np.abs(exact["theta"] - theta)) <= 4 * phase
    assert np.max(np.abs(exact["theta_dot"] - theta_dot)) <= 4 * phase * FREQUENCY**2


@pytest.mark.parametrize("excess", [-1e-6, -1e-9, 1e-9, 1e-6])
def test_pendulum_near_the_separatrix_is_as_good_as_its_data(excess: float) -> None:
    """E = 2 m g l (1 + excess): the rounding of the start value alone shifts each passage of the top."""
    theta_dot_0 = 2 * FREQUENCY * np.sqrt(1 + excess)
    times = np.linspace(0, 10, 41)
    theta, _ = pendulum_reference(times, 0.0, theta_dot_0)
    exact = Pendulum.exact(times, theta_0=0.0, theta_dot_0=theta_dot_0)["theta"]
    # ε / |1 - k²| a passage in units of 1/Ω, with ε = 4e-16 for 1 - k²; two passages in 10 s; rate at most 2 Ω.
    assert np.max(np.abs(exact - theta)) <= 2 * 2 * 4e-16 / abs(excess)
    # and the energy, which has no such amplification
    rate = Pendulum.exact(times, theta_0=0.0, theta_dot_0=theta_dot_0)["theta_dot"]
    np.testing.assert_allclose(rate**2 / 2 - 9.81 * np.cos(exact), theta_dot_0**2 / 2 - 9.81, rtol=0, atol=1e-13)


@pytest.mark.parametrize("theta_0", [0.0, -1.0, 2.0])
@pytest.mark.parametrize("sense", [1, -1])
def test_pendulum_on_the_separatrix_climbs_to_the_top_and_stays(theta_0: float, sense: int) -> None:
    theta_dot_0 = sense * 2 * FREQUENCY * np.cos(theta_0 / 2)
    times = np.linspace(0, 3, 13)
    theta, theta_dot = pendulum_reference(times, theta_0, theta_dot_0)
    exact = Pendulum.exact(times, theta_0=theta_0, theta_dot_0=theta_dot_0)
    amplified = 4e-16 * np.exp(FREQUENCY * times)  # the rounded start is off the separatrix, and e^Ωt leads away
    assert np.all(np.abs(exact["theta"] - theta) <= amplified)
    assert np.all(np.abs(exact["theta_dot"] - theta_dot) <= 4 * amplified)
    late = Pendulum.exact(1e6, theta_0=theta_0, theta_dot_0=theta_dot_0)
    assert late["theta"] == pytest.approx(sense * np.pi, rel=1e-15)
    assert late["theta_dot"] == 0
    assert Pendulum.period(theta_0=theta_0, theta_dot_0=theta_dot_0) == np.inf


@pytest.mark.parametrize("theta_0", [0.3, 1.5, 3.0])
def test_period_of_a_swing_is_the_quadrature_of_the_energy_law(theta_0: float) -> None:
    # sin(θ/2) = sin(θ_0/2) sin φ takes the root out of ∫ dθ/θ'
    k = np.sin(theta_0 / 2)
    quarter, _ = quad(lambda phi: 1 / np.sqrt(1 - (k * np.sin(phi)) ** 2), 0, np.pi / 2, epsabs=1e-13, epsrel=1e-13)
    period = Pendulum.period(theta_0=theta_0)
    assert period == pytest.approx(4 * quarter / FREQUENCY, rel=1e-12)  # ten times the quadrature's
    later = Pendulum.exact(0.77 + 3 * period, theta_0=theta_0)["theta"]
    assert later == pytest.approx(Pendulum.exact(0.77, theta_0=theta_0)["theta"], abs=1e-13)  # phase of 3 periods


def test_time_of_a_turn_is_the_quadrature_of_the_energy_law() -> None:
    theta_dot_0 = -7.0
    turn, _ = quad(lambda theta: 1 / np.sqrt(49 - 2 * 9.81 * (1 - np.cos(theta))), 0, 2 * np.pi, epsabs=1e-13)
    assert Pendulum.period(theta_0=0.0, theta_dot_0=theta_dot_0) == pytest.approx(turn, rel=1e-12)  # of quad
    after = Pendulum.exact(5 * turn, theta_0=0.0, theta_dot_0=theta_dot_0)["theta"]
    assert after == pytest.approx(-10 * np.pi, abs=1e-11)  # five times the quadrature's, times the rate


def test_pendulum_hangs_at_rest() -> None:
    exact = Pendulum.exact(np.linspace(0, 5, 3), theta_0=0.0)
    np.testing.assert_array_equal(exact["theta"], 0)
    np.testing.assert_array_equal(exact["tension"], 9.81)


def test_small_angle_with_friction_is_the_limit_of_the_pendulum() -> None:
    times = np.linspace(0, 5, 11)
    small = Pendulum.small_angle(times, theta_0=1e-4, friction=0.0)["theta"]
    large = Pendulum.exact(times, theta_0=1e-4)["theta"]
    # relative period error θ²/16 of the phase Ωt = 16
    np.testing.assert_allclose(small, large, rtol=0, atol=1e-4 * 16 * 1e-8 / 16 * 1.1)
    # with friction: e^(-ηt/2) and frequency √(Ω² - η²/4) by hand; a few roundings
    damped = Pendulum.small_angle(times, theta_0=1.0, friction=0.8)["theta"]
    omega = np.sqrt(9.81 - 0.16)
    by_hand = np.exp(-0.4 * times) * (np.cos(omega * times) + 0.4 / omega * np.sin(omega * times))
    np.testing.assert_allclose(damped, by_hand, rtol=0, atol=1e-14)


@pytest.mark.parametrize("length_dot", [0.1, 1.5, -0.04])
def test_lengthening_pendulum_is_bessel(length_dot: float) -> None:
    times, g, v = np.linspace(0, 20, 21), Decimal(GRAVITY), Decimal(length_dot)
    # θ' = ω, ω' = -g θ/l - 2 v ω/l, (1/l)' = -v (1/l)²
    rates = [{(1,): 1}, {(2, 0): -g, (2, 1): -2 * v}, {(2, 2): -v}]
    reference = taylor(times, [0.1, -0.2, 1], rates)
    exact = Pendulum.lengthening(times, length_dot=length_dot, theta_0=0.1, theta_dot_0=-0.2)
    # Bessel functions of x up to 160: a rounding of x, and of the amplitude, times the largest rate.
    np.testing.assert_allclose(exact["theta"], reference[0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(exact["theta_dot"], reference[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("theta_max", [0.1, 1.0])
def test_crouch_growth_follows_from_momentum_and_energy(theta_max: float) -> None:
    """Down from rest at l_low, stand up at the bottom keeping p = m l² θ', up to rest at l_high."""
    low, high = 1.2, 1.0
    bottom_rate = np.sqrt(2 * 9.81 / low * (1 - np.cos(theta_max)))
    after = bottom_rate * (low / high) ** 2
    risen = after**2 * high / (2 * 9.81)  # 1 - cos θ' at the next turning point
    growth = Pendulum.crouch_growth(length_low=low, length_high=high)
    assert growth == pytest.approx(risen / (1 - np.cos(theta_max)), rel=1e-14)  # a few roundings
    assert growth > 1


# ---- oscillator --------------------------------------------------------------------------------------------------

DAMPINGS = [0.0, 1e-9, 0.3, 2 - 1e-12, 2.0, 2 + 1e-9, 2.5, 40.0]  # critical at 2


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("angular_frequency", [0.0, 0.7, 1.0, 1 + 1e-9, 3.0])
@pytest.mark.parametrize("driven", ["support", "x_force"])
def test_oscillator_is_exact_to_rounding_in_every_regime(
    damping: float,
    angular_frequency: float,
    driven,
) -> None:
    phase, amplitude, times = 0.4, 0.8, np.linspace(0, 12, 13)
    sine, cosine = sine_and_cosine(phase)
    gamma, omega = Decimal(damping), Decimal(angular_frequency)
    # x' = v, v' = -x - γ v + a s + 0.25, s' = ω c, c' = -ω s; unit mass and stiffness: both inputs act alike
    rates = [{(1,): 1}, {(0,): -1, (1,): -gamma, (2,): amplitude, (): 0.25}, {(3,): omega}, {(2,): -omega}]
    reference = taylor(times, [0.3, -0.7, sine, cosine], rates, step="0.1" if damping < 10 else "0.05")
    drive: Any = {"amplitude": amplitude, "angular_frequency": angular_frequency, "phase": phase, driven: 0.25}
    exact = Oscillator.exact(times, x_0=0.3, x_dot_0=-0.7, damping=damping, driven=driven, **drive)
    # Roundings of a phase of up to 36 in terms of size up to 5 (secular growth t/2).
    np.testing.assert_allclose([exact["x"], exact["x_dot"]], reference[:2], rtol=0, atol=5e-14)


# ---- flywheel ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.0, 1e-12, 1e-3, 0.5, 30.0])
def test_flywheel_under_a_torque_approaches_its_final_rate(friction: float) -> None:
    times = np.linspace(0, 10, 11)
    rates = [{(1,): 1}, {(): 0.25, (1,): -Decimal(friction)}]
    reference = taylor(times, [1, 3], rates)
    exact = Flywheel.exact(times, angle_0=1, angle_dot_0=3, inertia=2, angle_force=0.5, friction=friction)
    # Roundings of numbers of up to 50, and of the initial rate where friction has eaten it.
    np.testing.assert_allclose(exact["angle"], reference[0], rtol=1e-14)
    np.testing.assert_allclose(exact["angle_dot"], reference[1], rtol=1e-14, atol=3e-15)
