"""The symplectic solver: its coefficients, order and symmetry, what it keeps in long runs, and where it gives up."""

from __future__ import annotations

import re
from importlib import resources
from itertools import pairwise

import numpy as np
import pytest
from driver import Instance, Library
from handmade import libration
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from liaisons.models import CartesianPendulum, Satellite

ROUNDING = 2.0**-53
STATES = ("theta", "p_theta")


def begin(library: Library, steps: int, tolerance: float | None = None, **values: float) -> Instance:
    """An initialized instance that makes so many symplectic steps in each communication step."""
    return library.start(tolerance=tolerance, symplectic_steps=steps, **values)


# ---- the method ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def code() -> str:
    return (resources.files("liaisons.fmu") / "runtime" / "symplectic.c").read_text()


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", text)]


def test_coefficients_are_those_of_collocation_at_gauss_points(code) -> None:
    points, weights = legendre.leggauss(3)
    c, b = (1 + points) / 2, weights / 2
    # a_ij: integral from 0 to c_i of the j-th Lagrange polynomial; mu_ij = a_ij / b_j
    a = np.zeros((3, 3))
    for j in range(3):
        others = np.delete(c, j)
        integral = (Polynomial.fromroots(others) / np.prod(c[j] - others)).integ()
        a[:, j] = integral(c)
    alpha, beta = numbers(code[code.index("ALPHA =") : code.index("enum { STAGES")])
    half = np.full((3, 3), 0.5)
    antisymmetric = np.array([[0, -alpha, -beta], [alpha, 0, -alpha], [beta, alpha, 0]])
    np.testing.assert_allclose(half + antisymmetric, a / b, rtol=0, atol=20 * ROUNDING)  # some ten operations above
    np.testing.assert_allclose(numbers(code[code.index("NODES[STAGES]") :].split(";")[0]), c, rtol=0, atol=4 * ROUNDING)


def test_guess_is_exact_for_polynomials_of_degree_5(code) -> None:
    rows = np.reshape(numbers(code[code.index("EXTRAPOLATION[STAGES]") :].split(";")[0]), (3, 6))
    c = (1 + legendre.leggauss(3)[0]) / 2
    known = np.concatenate([c - 1, c - 2])
    for degree in range(6):
        # numbers up to 444, times powers of up to 1.9 in size: 6 products of up to 1e4 rounded
        np.testing.assert_allclose(rows @ known**degree, c**degree, rtol=0, atol=6e4 * ROUNDING)


def test_order(pendulum_library) -> None:
    """Error of the angle over 8 s of a large swing against the step, from elliptic functions: slope 6."""
    counts, errors = np.array([40, 80, 160]), []  # steps of 0.2 to 0.05 s: a radian to a sixth of one
    for count in counts:
        instance = begin(pendulum_library, int(count), theta_0=2.0)
        instance.follow(8.0, 1)
        errors.append(abs(instance["theta"] - libration(8.0, 2.0)[0]))
    slope, _ = np.polyfit(np.log(1.0 / counts), np.log(errors), 1)
    # The next power of the step adds (a third)² of itself to the error of the middle step: a tenth in the slope.
    assert slope == pytest.approx(6.0, abs=0.3)


def test_motion_runs_backwards(pendulum_library) -> None:
    """A symmetric method retraces its steps when all velocities are turned round, whatever the step."""
    there = begin(pendulum_library, 1, theta_0=2.0)
    there.follow(0.2, 100)
    theta, theta_dot = there.get("theta", "theta_dot")
    back = begin(pendulum_library, 1, theta_0=theta, theta_dot_0=-theta_dot)
    back.follow(0.2, 100)
    # 200 steps with rounding errors of numbers of size 6, each of which grows with the time (as shear does): 200² / 2
    np.testing.assert_allclose(back.get("theta", "theta_dot"), [2.0, 0.0], rtol=0, atol=2e4 * 6 * ROUNDING)
    assert abs(theta - libration(20.0, 2.0)[0]) > 1e-7  # so large are the steps that the motion itself is not exact


def test_areas_in_phase_space_stay(pendulum_library) -> None:
    """det ∂(θ, p)(t)/∂(θ_0, p_0) = 1 for the map itself, though its steps are far too large for the motion."""
    by, start = 1e-4, {"theta_0": 2.0, "theta_dot_0": 0.5}

    def end(steps: int, name: str, shift: float) -> NDArray:
        instance = begin(pendulum_library, steps, 1e-2, **(start | {name: start[name] + shift}))
        instance.follow(0.4, 10)
        return instance.get(*STATES)

    def area(steps: int) -> float:
        columns = [(end(steps, name, by) - end(steps, name, -by)) / (2 * by) for name in start]
        return float(np.linalg.det(np.array(columns)))

    # Central differences: difference² times third derivatives, which reach 100 after four seconds.
    assert area(1) == pytest.approx(1.0, abs=1e-6)
    assert abs(area(0) - 1.0) > 1e-5  # the other solver, at a tolerance that gives similar errors


# ---- long runs -------------------------------------------------------------------------------------------------


def test_energy_after_a_million_steps(pendulum_library) -> None:
    """What the project promises: 1e-11 J; by rounding alone it is about 1e-16 * 10 J * √1e6 = 1e-12 J."""
    instance = begin(pendulum_library, 1000, theta_0=1.0)
    start = instance["energy"]
    instance.follow(10.0, 1000)
    assert abs(instance["energy"] - start) <= 1e-11
    assert abs(instance["energy_balance"]) <= 1e-11


def test_a_turning_body_keeps_energy_and_angular_momentum(library) -> None:
    """Both are quadratic, which the method keeps exactly; the quaternion's norm, too."""
    start = {"omega_x_0": 0.1, "omega_y_0": 1.0, "omega_z_0": 0.1}  # about the intermediate axis: it tumbles
    instance = begin(library(Satellite), 100, **start)
    names = ("energy", "H_x", "H_y", "H_z")
    before = instance.get(*names)
    instance.follow(1.0, 1000)
    # 1e5 steps, rounding errors of numbers of size 12 that add up at random: 12 * √1e5, and some to spare
    np.testing.assert_allclose(instance.get(*names), before, rtol=0, atol=10 * 12 * 1e5**0.5 * ROUNDING)
    norm = np.linalg.norm(instance.get("q_w", "q_x", "q_y", "q_z"))
    assert norm == pytest.approx(1.0, abs=4 * ROUNDING)


def test_constraints_hold(library) -> None:
    instance = begin(library(CartesianPendulum), 10)
    start = instance["energy"]
    instance.follow(0.1, 1000)
    assert np.abs(instance.get("rod_residual", "plane_residual")).max() <= 8 * ROUNDING
    # Putting states back onto the constraint is no symplectic map: what it takes adds up, 1e4 steps of one rounding.
    assert abs(instance["energy"] - start) <= 1e4 * ROUNDING


# ---- inputs, events, communication steps -----------------------------------------------------------------------


def lengths(t: float) -> dict[str, float]:
    """Of a pumped swing, with its derivatives."""
    rate = 6.26
    sine, cosine = 0.1 * np.sin(rate * t), 0.1 * np.cos(rate * t)
    return {"length": 1 + sine, "length_dot": rate * cosine, "length_ddot": -(rate**2) * sine}


def pumped(library: Library, steps: int, tolerance: float | None = None) -> Instance:
    """After 10 s in communication steps of 0.1 s, inputs interpolated."""
    instance = begin(library, steps, tolerance, input_reconstruction=2, theta_0=0.5, friction=0.1, **lengths(0.0))
    instance.follow(0.1, 100, lengths, ahead=True)
    return instance


def test_moving_inputs(pendulum_library) -> None:
    """Both solvers follow the same polynomials inside a communication step."""
    ours, other = pumped(pendulum_library, 10), pumped(pendulum_library, 0, 1e-13)
    names = (*STATES, "work", "dissipated")
    # Steps of 10 ms: (0.01 * 6.3)^6 = 6e-8 of the motion, times the error constant of the method, 1/100800
    # (of a harmonic oscillator), a thousand times, grown tenfold by the pumping.
    np.testing.assert_allclose(ours.get(*names), other.get(*names), rtol=0, atol=1e-8)
    assert abs(ours["energy_balance"]) <= 1e-8


def test_uneven_communication_steps(pendulum_library) -> None:
    """The guess from the last two steps is worse then, the result is not."""
    times = np.cumsum([0.0, *np.resize([0.1, 0.03, 0.25], 60)])
    instance = begin(pendulum_library, 10, theta_0=1.0)
    for begins, ends in pairwise(times):
        instance.step(begins, ends - begins)
    # Steps of up to 25 ms: (0.025 * 3.1)^6 / 100800 = 2e-12 a radian, 20 of which pass
    assert instance["theta"] == pytest.approx(libration(times[-1], 1.0)[0], abs=1e-9)


@pytest.mark.parametrize("steps", [0, 1, 3])
@pytest.mark.parametrize("size", [0.1, 1e-10], ids=["inside a step", "at a communication point"])
def test_the_work_of_a_rate_that_jumps_is_booked(pendulum_library, steps: int, size: float) -> None:
    """A bob that hangs is pulled up: work m l'^2/2 - m g (l - 1), however fast; interpolation meets rate and length."""
    instance = pendulum_library.start(
        tolerance=1e-12, symplectic_steps=steps, input_reconstruction=2, theta_0=0.0, length=1.0
    )
    instance.step(0.0, 0.5)
    shorter, rate, gravity = 1.0 - 0.03 * size, -2.0, instance["gravity"]
    instance.set(length=shorter, length_dot=rate)
    instance.step(0.5, size)
    # The power is a polynomial of degree 7 and 4: exact with five points; the solver's tolerance, otherwise.
    assert instance["work"] == pytest.approx(rate**2 / 2 - gravity * (shorter - 1), abs=1e-11)
    assert instance["energy_balance"] == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("steps", [1, 2, 4])
def test_the_balance_of_a_swing_whose_length_begins_to_move_inside_a_step(pendulum_library, steps: int) -> None:
    instance = pendulum_library.start(symplectic_steps=steps, input_reconstruction=2, theta_0=1.0)
    instance.follow(0.1, 5)
    instance.set(length=1.0, length_dot=1.0)
    instance.step(0.5, 0.1)
    # By three points it is off by 15 % of m l'^2/2 with one step; what is left is of fourth order in the swing.
    assert abs(instance["energy_balance"]) < 1e-3 / steps**3
