"""What is known beyond the motion itself: each closed form against quadrature, integration or geometry of its own."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hand_derivations import QUATERNION, Curve, ellipse, fourier, rotation, tensor
from numpy.typing import NDArray
from on_paper import TURN, State, breathing_pendulum, cross, derivative, dot, smooth_step
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, fminbound
from scipy.spatial.transform import Rotation

from liaisons.errors import ValidityError
from liaisons.models import (
    CircularHoop,
    DrivenChain,
    EllipticHoop,
    FourierHoop,
    KeplerOrbit,
    Pendulum,
    Satellite,
    SpatialCat,
    Swing,
)

GRAVITY = 9.81


def integrated(rates: Callable, times: NDArray, start: list[float], tolerance: float = 1e-12) -> NDArray:
    """By another method than the references use."""
    return solve_ivp(rates, (times[0], times[-1]), start, "Radau", times, rtol=tolerance, atol=tolerance * 1e-2).y


# ---- pendulum ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("theta", "theta_dot"), [(2.0, 0.0), (0.3, -1.0), (0.5, 12.0), (7.0, -20.0)])
def test_action_is_the_area_of_the_orbit(theta: float, theta_dot: float) -> None:
    mass, length, gravity = 1.7, 0.6, 3.0
    energy = theta_dot**2 / 2 - gravity / length * np.cos(theta)
    swings = energy < gravity / length
    end = np.arccos(-energy * length / gravity) if swings else np.pi

    def momentum(s: float) -> float:  # θ = end sin s takes the root out of the turning points
        rate = np.sqrt(max(0.0, 2 * (energy + gravity / length * np.cos(end * np.sin(s)))))
        return mass * length**2 * rate * end * np.cos(s)

    area = quad(momentum, -np.pi / 2, np.pi / 2, epsabs=1e-12)[0] * (2 if swings else 1)
    found = Pendulum.action([theta, -theta], theta_dot, length, mass=mass, gravity=gravity)
    np.testing.assert_allclose(found, area / TURN, rtol=1e-10)  # of the quadrature


def test_crouch_schedule_meets_the_lowest_and_the_turning_points() -> None:
    lengths = {"length_low": 1.2, "length_high": 0.9}
    instants, amplitudes = Pendulum.crouch_schedule(3, theta_0=0.4, gravity=GRAVITY, **lengths)
    theta, momentum = 0.4, 0.0
    for k, (begin, end) in enumerate(pairwise([0.0, *instants])):
        length = lengths["length_low" if k % 2 == 0 else "length_high"]
        rates = lambda _, y, length=length: [y[1] / length**2, -GRAVITY * length * np.sin(y[0])]  # noqa: E731
        theta, momentum = integrated(rates, np.array([begin, end]), [theta, momentum])[:, -1]
        # At the bottom θ = 0, at a turning point p = 0 and |θ| the next amplitude: a hundred tolerances.
        assert abs(theta if k % 2 == 0 else momentum) <= 1e-9
        if k % 2:
            assert abs(theta) == pytest.approx(amplitudes[(k + 1) // 2], abs=1e-12)
    with pytest.raises(ValidityError, match="over the top"):
        Pendulum.crouch_schedule(30, theta_0=0.4, **lengths)


def test_pumped_is_the_taylor_series() -> None:
    times = np.linspace(0, 10, 21)
    theta, p = breathing_pendulum(times)
    found = Pendulum.pumped(times, theta_0=1.0, gravity=9.8125, amplitude=0.1, angular_frequency=2.0)
    np.testing.assert_allclose(found["theta"], theta, rtol=0, atol=1e-11)  # 1e-13, κ of ten
    np.testing.assert_allclose((1 + 0.1 * np.sin(2 * times)) ** 2 * found["theta_dot"], p, rtol=0, atol=1e-11)


def test_pumping_rate_is_the_leading_term_of_floquets_exponent() -> None:
    length, omega = 0.7, np.sqrt(GRAVITY / 0.7)
    errors = []
    for depth in (0.04, 0.02):

        def rates(t: float, y: NDArray, depth: float = depth) -> NDArray:
            l, rate = 1 + depth * np.sin(2 * omega * t), 2 * omega * depth * np.cos(2 * omega * t)  # noqa: E741
            return np.array(
                [y[1], -(omega**2 * y[0] + 2 * rate * y[1]) / l, y[3], -(omega**2 * y[2] + 2 * rate * y[3]) / l]
            )

        end = integrated(rates, np.array([0, np.pi / omega]), [1, 0, 0, 1])[:, -1]
        exponent = np.log(np.max(np.abs(np.linalg.eigvals(end.reshape(2, 2))))) * omega / np.pi
        errors.append(abs(Pendulum.pumping_rate(depth, length=length) / exponent - 1))
    assert errors[0] < 0.04  # the next term is of relative size depth
    assert errors[1] < errors[0]


@pytest.mark.parametrize(("gravity", "amplitude", "frequency"), [(9.81, 0.2, 7.0), (-9.81, 0.1, 50.0), (3.0, 0.5, 3.0)])
def test_shaken_trace_is_that_of_the_whole_pendulum(gravity: float, amplitude: float, frequency: float) -> None:
    """Newton's law for the bob, sin and all, beside either position: l θ'' = -(g + z'') sin θ."""
    near, length = 1e-5, 0.8

    def rates(t: float, y: NDArray) -> list[float]:
        pull = gravity - amplitude * frequency**2 * np.sin(frequency * t)
        return [y[1], -pull * np.sin(y[0]) / length]

    period = np.array([0, TURN / frequency])
    trace = sum(integrated(rates, period, [near * (i == 0), near * (i == 1)])[i, -1] for i in (0, 1)) / near
    found = Pendulum.shaken_trace(gravity=gravity, length=length, amplitude=amplitude, angular_frequency=frequency)
    assert found == pytest.approx(trace, abs=1e-7)  # near², and tolerance over near
    slow = Pendulum.shaken_trace(gravity=9.81, amplitude=0.0, angular_frequency=frequency)
    assert slow == pytest.approx(2 * np.cos(TURN * np.sqrt(9.81) / frequency), abs=1e-11)  # free swings


def test_swings_on_a_shaken_pivot_are_bounded_where_the_trace_is_below_two() -> None:
    shaken = {"angular_frequency": 3.0, "length": 0.7}
    amplitudes = np.array([0.1, 0.6])
    edges = Pendulum.shaken_edges(amplitudes, count=2, **shaken)
    assert edges.shape == (5, 2)
    for sign, row in zip((1, -1, -1, 1, 1), edges, strict=True):
        for gravity, amplitude in zip(row, amplitudes, strict=True):
            trace = Pendulum.shaken_trace(gravity=gravity, amplitude=amplitude, **shaken)
            assert trace == pytest.approx(2 * sign, abs=1e-8)  # SciPy's values, and the integration
    gravity, amplitude = np.meshgrid(np.linspace(-5, 30, 11), [0.05, 0.3, 0.9])
    traces = [
        [Pendulum.shaken_trace(gravity=g, amplitude=a, **shaken) for g, a in zip(*rows, strict=True)]
        for rows in zip(gravity, amplitude, strict=True)
    ]
    found = Pendulum.shaken_is_bounded(gravity, amplitude, **shaken)
    np.testing.assert_array_equal(found, np.abs(traces) < 2)
    assert 5 < np.sum(found) < 28  # both happen


def test_upright_well_is_that_of_the_averaged_potential() -> None:
    gravity, length, amplitude, frequency = 5.0, 0.8, 0.02, 400.0
    omega, edge = Pendulum.upright_well(amplitude, frequency, gravity=gravity, length=length)

    def potential(phi: float) -> float:
        return gravity * length * np.cos(phi) + (amplitude * frequency * np.sin(phi)) ** 2 / 4

    highest = fminbound(lambda phi: -potential(phi), 0, np.pi, xtol=1e-9)
    assert edge == pytest.approx(highest, abs=1e-6)  # a maximum, found to the root of the rounding
    assert omega == pytest.approx(np.sqrt((potential(1e-3) - potential(0)) * 2e6) / length, rel=1e-5)  # φ² = 1e-6
    trace = Pendulum.shaken_trace(gravity=-gravity, length=length, amplitude=amplitude, angular_frequency=frequency)
    assert np.arccos(trace / 2) * frequency / TURN == pytest.approx(omega, rel=amplitude / length)  # the next order
    least = Pendulum.upright_from(amplitude, gravity=gravity, length=length)
    assert Pendulum.upright_well(amplitude, least * 1.001, gravity=gravity, length=length)[1] < 0.1
    with pytest.raises(ValidityError, match="holds nothing up"):
        Pendulum.upright_well(amplitude, least * 0.999, gravity=gravity, length=length)


# ---- swing ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("to", [1.2, -2.0, 3.5, 20.0])
def test_lift_is_the_integral_of_the_connection(to: float) -> None:
    m_1, m_2, l, b = 15.0, 30.0, 1.7, 0.6  # noqa: E741

    def connection(psi: float) -> float:
        seat, torso = l + 0j, l + b * np.exp(1j * psi)  # θ turns both, ψ the torso about the seat
        J = m_2 * cross(torso, 1j * b * np.exp(1j * psi))
        return J / (m_1 * abs(seat) ** 2 + m_2 * abs(torso) ** 2)

    found = Swing.lift(to, lean=0.4, mass_seat=m_1, mass_torso=m_2, rope=l, torso_length=b)
    assert found == pytest.approx(-quad(connection, 0.4, to, epsabs=1e-12)[0], abs=1e-10)  # of the quadrature


def test_leaning_moves_by_the_derived_equations() -> None:
    body, lean = {"mass_seat": 15.0, "torso_length": 0.6, "rope": 1.7}, {"amplitude": 0.7, "angular_frequency": 2.5}
    start = {"theta_0": 0.3, "theta_dot_0": -0.2, "lean": 2.0, **body, **lean}
    assert Swing.leaning(0.0, **start)["theta"] == 0.3

    def motion(t: float) -> NDArray:
        return np.array(list(Swing.leaning(t, **start).values()))

    assert derivative(lambda t: motion(t + 0.1), 0.0)[0] == pytest.approx(derivative(motion, 0.1)[0])
    for t in (0.3, 2.0):
        phase = 2.5 * t
        posture = {"lean": 2.0 + 0.7 * np.sin(phase), "lean_dot": 0.7 * 2.5 * np.cos(phase)}
        state = State(Swing, body | posture | dict(zip(("theta", "p_theta"), motion(t), strict=True)))
        rate = state("velocities")
        expected = [rate, (state | {"theta_dot": rate})("momentum_rates")]
        np.testing.assert_allclose(derivative(motion, t), expected, rtol=1e-8)  # h¹⁰, and 1e-13 of p over h
    near, further = (motion(t)[0] for t in (1e-4, 2e-4))
    assert (4 * near - further - 3 * 0.3) / 2e-4 == pytest.approx(-0.2, abs=1e-6)  # the start rate, second order


# ---- satellite and cats --------------------------------------------------------------------------------------------

ODD = {"J_xy": 1.0, "J_xz": -0.5, "J_yz": 0.3}


def test_satellite_steered_by_one_wheel_after_another_makes_a_product_of_turns() -> None:
    """sin² pulses of 5 s: each wheel turns by 2.5 s times its rate."""

    def wheels(t: float) -> NDArray:
        return np.sin(np.pi * t / 5) ** 2 * np.array([40.0 * (t < 5), -30.0 * (t >= 5), 0.0])

    first = Rotation.from_rotvec([0.3, -0.2, 0.9])
    start = dict(zip((f"{q}_0" for q in QUATERNION), first.as_quat(scalar_first=True), strict=True))
    found = Satellite.steered([10.0], wheels=wheels, **ODD, **start)
    turns = (
        Rotation.from_rotvec(-0.1 * 2.5 * size * np.linalg.inv(tensor(ODD))[:, k]) for k, size in ((0, 40), (1, -30))
    )
    expected = first
    for turn in turns:
        expected = expected * turn
    assert (rotation(found).inv() * expected).magnitude() <= 1e-10  # 1e-13 a step


def test_bend_for_is_the_inverse_of_turn() -> None:
    assert SpatialCat.bend_for(np.pi) == pytest.approx(2 * np.arccos((np.sqrt(84) - 2) / 8), rel=1e-14)  # 4c² + 2c = 5
    halves = {"inertia_transverse": 0.3, "inertia_axial": 0.05}
    for turn in (0.5, np.pi, 6.0):
        root = brentq(lambda bend, turn=turn: SpatialCat.turn(bend, **halves) - turn, 0, np.pi, xtol=1e-14)
        assert SpatialCat.bend_for(turn, **halves) == pytest.approx(root, abs=1e-13)  # the root's
    with pytest.raises(ValidityError, match="turn = 7"):
        SpatialCat.bend_for(7.0)


def test_bisector_lies_between_the_axes() -> None:
    bend, azimuth = np.array([0.3, 1.5, 2.9]), np.array([-1.0, 0.4, 5.0])
    b = (Rotation.from_euler("Z", azimuth[:, None]) * Rotation.from_euler("X", bend[:, None])).apply([0, 0, 1])
    between = b + np.array([0, 0, 1])
    found = SpatialCat.bisector(bend, azimuth)
    np.testing.assert_allclose(
        found, between / np.linalg.norm(between, axis=1)[:, None], rtol=0, atol=1e-14
    )  # roundings


# ---- hoops ---------------------------------------------------------------------------------------------------------


TURNS = {
    "circle": (
        ellipse({"semi_axis_a": 1.3, "semi_axis_b": 1.3, "centre_x": 0.4, "centre_y": 0}),
        CircularHoop.slow_turn(radius=1.3, offset=0.4),
    ),
    "ellipse": (
        ellipse(oval := {"semi_axis_a": 2.0, "semi_axis_b": 1.2, "centre_x": 0.3, "centre_y": -0.2}),
        EllipticHoop.slow_turn(**oval),
    ),
    "bent": (fourier(bent := {"radius": 1.2, "cos_1": 0.25, "sin_2": 0.15}), FourierHoop.slow_turn(**bent)),
}


def shifts(curve: Curve, u: NDArray, duration: float, *, abrupt: bool) -> NDArray:
    """Of beads at unit speed in one turn of the hoop, by Newton's law along the tangent in the turning frame."""
    smooth = smooth_step(TURN, 0.0, duration)

    def motion(t: float, y: NDArray) -> NDArray:
        u, u_dot, _ = y.reshape(3, -1)
        beta_dot, beta_ddot = (TURN / duration, 0.0) if abrupt else smooth(t)[1:]
        position, first, second = curve(u)
        without = second * u_dot**2 + 2j * beta_dot * first * u_dot + (1j * beta_ddot - beta_dot**2) * position
        return np.concatenate([u_dot, -dot(first, without) / np.abs(first) ** 2, np.abs(first) * u_dot])

    position, first, _ = curve(u)
    across = cross(position, first) / np.abs(first)
    along = 1 - abrupt * TURN / duration * across  # p_ξ is kept when the rate jumps
    start = np.concatenate([u, along / np.abs(first), 0 * u])
    return solve_ivp(motion, (0, duration), start, "DOP853", rtol=1e-9, atol=1e-10).y[2 * u.size :, -1] - duration


@pytest.mark.parametrize(("curve", "turn"), TURNS.values(), ids=TURNS)
def test_slow_turn_shifts_the_bead_by_area_over_length_and_the_remainder(curve: Curve, turn: Any) -> None:
    fine = TURN * np.arange(4096) / 4096
    position, first, _ = curve(fine)
    length, area = TURN * np.mean(np.abs(first)), np.pi * np.mean(cross(position, first))
    assert turn.length == pytest.approx(length, rel=1e-13)  # the trapezoidal rule of analytic functions
    assert turn.shift == pytest.approx(-4 * np.pi * area / length, rel=1e-13)
    np.testing.assert_allclose(turn.r_squared(fine), np.abs(position) ** 2, rtol=1e-13)
    spread = turn.spread(5)
    gaps = [quad(lambda u: abs(curve(u)[1]), *ends, epsabs=1e-12)[0] for ends in pairwise(spread)]
    np.testing.assert_allclose(gaps, length / 5, rtol=1e-11)
    u, duration = np.array([0.2, 1.9, 4.4]), 150.0
    found, predicted = shifts(curve, u, duration, abrupt=False) - turn.shift, turn.smooth_remainder(duration, u)
    assert np.max(np.abs(found - predicted)) <= 0.15 * np.max(np.abs(predicted))  # the next order, 6π<a>/vT = 0.15
    beads = turn.spread(32)
    jumped = shifts(curve, beads, duration, abrupt=True)
    assert np.max(np.abs(jumped + TURN * turn.lever_arm(beads))) <= 1.2 * turn.abrupt_bound(duration)
    remainder = turn.abrupt_mean_remainder(duration)
    assert np.mean(jumped) - turn.shift == pytest.approx(remainder, rel=0.4)  # the next order, 2π r³/vT and its slopes


def test_dynamic_field_is_odd_even_and_all_of_the_derived_equations() -> None:
    hoop = {"mass": 1.4, "radius": 1.3, "offset": 0.4}
    xi, p, Y = 0.7, 1.1, 1.6
    here, back, fast = (CircularHoop.dynamic_field(xi, p, Y * factor, **hoop) for factor in (1, -1, 3))
    for name, (odd, even) in {"D_0": (0, 1), "H(Y)": (-1, 0), "-X_K": (0, 9)}.items():
        np.testing.assert_allclose(back[name], (odd or 1) * here[name], rtol=1e-14)
        np.testing.assert_allclose(fast[name], (even or 3) * here[name], rtol=1e-14)
    a = 1.3 + 0.4 * np.cos(0.7 / 1.3)
    state = State(CircularHoop, hoop | {"xi": xi, "p_xi": p, "xi_dot": p / 1.4 - a * Y, "beta_dot": Y})
    derived = [state(name) for name in ("velocities", "momentum_rates")]
    np.testing.assert_allclose(sum(here.values()), derived, rtol=1e-12)  # algebra


@pytest.mark.variants(core=0)
def test_hoop_on_a_free_shaft_keeps_angular_momentum_and_energy_and_obeys_newton_along_the_tangent() -> None:
    hoop = {"mass": 1.4, "radius": 1.3, "offset": 0.4, "hoop_inertia": 0.2}
    start = {"xi_0": 0.5, "xi_dot_0": 1.5, "beta": 0.2, "beta_dot": -0.4, "shaft_inertia": 0.3}

    def motion(t: float) -> NDArray:
        found = CircularHoop.on_a_free_shaft(t, **hoop, **start)
        return np.array([found["xi"], found["beta"]])

    def bead(t: float) -> NDArray:
        xi, beta = motion(t)
        return np.exp(1j * beta) * (0.4 + 1.3 * np.exp(1j * xi / 1.3))

    at_start = CircularHoop.on_a_free_shaft(0.0, **hoop, **start)
    for t in (0.3, 2.0, 5.0):
        velocity, beta_dot = derivative(bead, t), derivative(motion, t)[1]
        moment = 1.4 * cross(bead(t), velocity) + 0.5 * beta_dot
        energy = 0.7 * abs(velocity) ** 2 + 0.25 * beta_dot**2
        assert moment == pytest.approx(at_start["p_beta"], rel=1e-9)  # differences: h¹⁰, and 1e-13/h
        assert energy == pytest.approx(at_start["energy"], rel=1e-9)
        xi, beta = motion(t)
        push = dot(1j * np.exp(1j * (beta + xi / 1.3)), derivative(lambda s: derivative(bead, s), t))
        assert push == pytest.approx(0.0, abs=1e-7)  # differences of differences
        assert at_start["p_xi"] == pytest.approx(1.4 * (1.5 + (1.3 + 0.4 * np.cos(0.5 / 1.3)) * -0.4))


# ---- chain and orbit -----------------------------------------------------------------------------------------------


def test_forerunner_bounds_the_answer_of_a_chain_to_a_step() -> None:
    """By the exponential of the matrix of a chain whose far end no wave reaches."""
    n, rate = 30, 1.5
    matrix = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-(rate**2) * matrix, np.zeros((n, n))]])
    still = np.concatenate([np.ones(n), np.zeros(n)])  # where a unit push ends; the rest is a free motion towards it
    for j in (6, 12):
        for t in 0.8 * j / rate * np.array([0.3, 1.0]):
            found = still[j - 1] - (expm(system * t) @ still)[j - 1]
            bound = float(DrivenChain.forerunner(t, j, stiffness=2 * rate**2, mass=2.0))
            assert found <= bound + 1e-14
            assert found >= 0.5 * bound or bound < 1e-12  # and it is no larger than it must be
    with pytest.raises(ValidityError, match="the push is there"):
        DrivenChain.forerunner(4.0, 4)


def test_keplers_equation_and_the_start_at_the_pericentre() -> None:
    a, e, mu = 1.7, 0.6, 2.3
    start = KeplerOrbit.pericentre(semi_axis=a, eccentricity=e, mu=mu)
    E = np.linspace(0, 12, 25)
    orbit = KeplerOrbit.exact(KeplerOrbit.time(E, semi_axis=a, eccentricity=e, mu=mu), mu=mu, **start)
    np.testing.assert_allclose(orbit["x"], a * (np.cos(E) - e), rtol=0, atol=1e-13)  # a phase of 12, some roundings
    np.testing.assert_allclose(orbit["y"], a * np.sqrt(1 - e**2) * np.sin(E), rtol=0, atol=1e-13)
