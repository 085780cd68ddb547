"""The stiff solver: its coefficients, published digits, what it has in common with the explicit one, and its limits."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from bodies import Sledge
from driver import DISCARD, ERROR, Library
from handmade import libration
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from stiff_problems import HIRES_END, HIRES_PUBLISHED, VAN_DER_POL_END, VAN_DER_POL_PUBLISHED, Hires, VanDerPol

from liaisons import simulate
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import BouncingBall, CartesianPendulum, PendulumChain, Satellite, StringPendulum

ROUNDING = 2.0**-53


@pytest.fixture(scope="module")
def van_der_pol(folder) -> Callable[[Literal["2", "3"]], Path]:
    return lambda fmi: build(assemble(VanDerPol), folder, fmi=fmi)


# ---- the method ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def table() -> Callable[[str], NDArray]:
    """The numbers of a constant of stiff.c."""
    code = (resources.files("liaisons.fmu") / "runtime" / "stiff.c").read_text()

    def numbers(name: str) -> NDArray:
        text = re.search(rf"\b{name}[\[\]A-Z]* = ([.\d]+|\{{.*?\}}(?=;))", code, re.DOTALL | re.MULTILINE)
        assert text is not None
        return np.array([float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", text[1])])

    return numbers


def test_coefficients_are_those_of_collocation_at_radau_points(table) -> None:
    c = table("NODES")
    # Zeros of d²/dx² x² (x - 1)³, and the end of the interval.
    inner: Any = (Polynomial([0, 0, 1]) * Polynomial([-1, 1]) ** 3).deriv(2).roots()
    np.testing.assert_allclose(c, np.sort(inner), rtol=0, atol=1e-8)  # one is a double root
    np.testing.assert_allclose(10 * c[:2], [4 - 6**0.5, 4 + 6**0.5], rtol=0, atol=20 * ROUNDING)
    a = np.zeros((3, 3))
    for j in range(3):
        others = np.delete(c, j)
        a[:, j] = (Polynomial.fromroots(others) / np.prod(c[j] - others)).integ()(c)
    np.testing.assert_allclose(table("WEIGHTS").reshape(3, 3), a, rtol=0, atol=10 * ROUNDING)
    to, back = table("TO").reshape(3, 3), table("FROM").reshape(3, 3)
    real, alpha, beta = (float(table(name)[0]) for name in ("REAL", "ALPHA", "BETA"))
    blocks = np.array([[real, 0, 0], [0, alpha, beta], [0, -beta, alpha]])
    # Condition numbers of TO and a are below 20.
    np.testing.assert_allclose(to @ back, np.eye(3), rtol=0, atol=100 * ROUNDING)
    np.testing.assert_allclose(to @ blocks @ back @ a, np.eye(3), rtol=0, atol=400 * ROUNDING)


def test_error_estimate_vanishes_for_rates_of_degree_2(table) -> None:
    """h f(0) + Σ e_i z_i with z = h A f is the part of order 4."""
    c, of_rates = table("NODES"), table("ERROR") @ table("WEIGHTS").reshape(3, 3)
    np.testing.assert_allclose(of_rates @ np.vander(c, 3, increasing=True), [-1, 0, 0], rtol=0, atol=100 * ROUNDING)
    assert abs(of_rates @ c**3) > 0.1


def test_error_falls_with_the_tolerance(pendulum_library) -> None:
    """Large swings of 8 s: the error, of order 5, against the estimate, of order 4 in h and tolerance^(2/3)."""
    tolerances, errors = np.array([1e-6, 1e-8, 1e-10, 1e-12]), []
    for tolerance in tolerances:
        instance = pendulum_library.start(tolerance=tolerance, stiff_solver=1, theta_0=2.0)
        instance.follow(8.0, 1)
        errors.append(abs(instance["theta"] - libration(8.0, 2.0)[0]))
    slope, _ = np.polyfit(np.log10(tolerances), np.log10(errors), 1)
    assert slope == pytest.approx(2 / 3 * 5 / 4, abs=0.15)  # the last step scatters it by a factor of 3
    assert all(errors <= tolerances)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_van_der_pol_has_the_published_digits(van_der_pol, fmi) -> None:
    for tolerance in (1e-6, 1e-9, 1e-12):
        result = simulate(
            van_der_pol(fmi), stop_time=VAN_DER_POL_END, step_size=0.5, tolerance=tolerance, stiff_solver=1
        )
        for name, value in VAN_DER_POL_PUBLISHED.items():
            # Errors shrink along the slow branches; ten digits are printed behind the point of y_dot's fifteen.
            assert abs(result[name][-1] - value) <= max(10 * tolerance, 1e-13)
        assert not result.warnings


def test_hires_has_the_published_digits(folder) -> None:
    fmu = build(assemble(Hires), folder)
    result = simulate(fmu, stop_time=HIRES_END, step_size=HIRES_END / 4, tolerance=1e-12, stiff_solver=1)
    got = [result[name][-1] for name in HIRES_PUBLISHED]
    np.testing.assert_allclose(got, [*HIRES_PUBLISHED.values()], rtol=0, atol=1e-12)


def test_a_fast_decay_is_damped_at_once(pendulum_library) -> None:
    """L-stability: exp(-1e9 s⁻¹ t) is gone after a step of 1 s, and leaves no oscillation behind."""
    instance = pendulum_library.start(stiff_solver=1, theta_0=0.0, theta_dot_0=1.0, friction=1e9)
    instance.step(0.0, 1.0)
    # θ has moved by 1/η; p is -m g l θ/η, since the friction bears the weight.
    assert instance["theta"] == pytest.approx(1e-9, rel=1e-6)
    assert abs(instance["theta_dot"]) < 1e-8


# ---- as the explicit solver ------------------------------------------------------------------------------------


def both(library: Library, names: tuple[str, ...], end: float, points: int, **values: float) -> list[NDArray]:
    """Numbers at the points, by the explicit and by the stiff solver."""
    found = []
    for stiff in (0, 1):
        instance = library.start(tolerance=1e-10, stiff_solver=stiff, **values)
        size, rows = end / points, []
        for i in range(points):
            instance.step(i * size, size)
            rows.append(instance.get(*names))
        found.append(np.array(rows))
    return found


# At a tolerance of 1e-10 the stiff solver is off by as much; factors of 10 for motions that magnify, over 5 s.
@pytest.mark.parametrize(
    ("component", "names", "values"),
    [
        (Satellite, ("q_w", "q_x", "omega_y", "energy_balance"), {"omega_x_0": 0.3, "omega_y_0": 1.0}),
        (CartesianPendulum, ("x", "z", "lambda_1", "energy_balance"), {}),
        (BouncingBall, ("height", "height_dot", "gap_impacts", "gap_impulse", "energy_balance"), {}),
        (StringPendulum, ("x", "z", "slack_impulse", "energy_balance"), {"x_dot_0": 3.0}),
    ],
)
def test_motion_is_that_of_the_explicit_solver(library, component, names, values) -> None:
    real = tuple(name for name in names if name != "gap_impacts")
    explicit, stiff = both(library(component), real, 5.0, 25, **values)
    np.testing.assert_allclose(stiff, explicit, rtol=1e-9, atol=1e-8)
    assert np.ptp(stiff[:, 0]) > 0.1


def test_sticking_and_sliding_are_those_of_the_explicit_solver(folder) -> None:
    library = Library(build(assemble(Sledge), folder))
    names = ("x", "z", "slip_force", "gap_force", "energy_balance")
    explicit, stiff = both(library, names, 1.0, 20, z_0=0.05, x_dot_0=2.0, bounce=0.5)
    np.testing.assert_allclose(stiff, explicit, rtol=1e-8, atol=1e-8)
    assert explicit[-1, 0] > 0.1


@pytest.mark.parametrize("mode", [1, 2])
def test_inputs_move_inside_a_step(pendulum_library, mode) -> None:
    def run(stiff: int) -> NDArray:
        instance = pendulum_library.start(
            tolerance=1e-10, input_reconstruction=mode, stiff_solver=stiff, theta_0=1.0, length=1.0, length_dot=0.2
        )
        for i in range(10):
            t = 0.1 * (i + (mode == 2))
            s, c = 0.1 * np.sin(2 * t), 0.1 * np.cos(2 * t)
            instance.set(length=1.0 + s, length_dot=2 * c, length_ddot=-4 * s)
            instance.step(0.1 * i, 0.1)
        return instance.get("theta", "p_theta", "length_force", "energy_balance")

    np.testing.assert_allclose(run(1), run(0), rtol=0, atol=1e-8)


def test_a_saved_state_goes_on_to_the_last_bit(pendulum_library) -> None:
    instance = pendulum_library.start(stiff_solver=1, theta_0=1.0)
    instance.follow(0.1, 10)
    content = instance.serialize()
    other = pendulum_library.restored(content)
    for one in (instance, other):
        one.step(1.0, 0.1)
        one.step(1.1, 0.4)
    assert instance.get("theta", "energy_balance").tobytes() == other.get("theta", "energy_balance").tobytes()
    instance.deserialize(content)
    instance.step(1.0, 0.1)
    instance.step(1.1, 0.4)
    assert instance.get("theta", "energy_balance").tobytes() == other.get("theta", "energy_balance").tobytes()


# ---- limits ----------------------------------------------------------------------------------------------------


def test_the_explicit_solver_says_once_that_it_meets_stiffness(van_der_pol) -> None:
    path = van_der_pol("2")
    result = simulate(path, stop_time=0.02, step_size=0.01, tolerance=1e-6)
    (warning,) = result.warnings
    assert re.fullmatch(
        r"VanDerPol: the motion is stiff at t = 0\.0\d+: with stiff_solver = 1 it may take far fewer steps", warning
    )
    assert not simulate(path, stop_time=0.02, step_size=0.01, tolerance=1e-6, stiff_solver=1).warnings


def test_many_steps_of_a_motion_that_is_not_stiff_are_no_warning(pendulum_library) -> None:
    instance = pendulum_library.start(tolerance=1e-14, theta_0=2.0)
    instance.step(0.0, 300.0)
    assert not instance.messages


def test_two_solvers_at_once_are_refused(pendulum_library) -> None:
    message = "symplectic_steps = 3 and stiff_solver = 1: set one of them to 0 before the other"
    instance = pendulum_library.initializing(symplectic_steps=3)
    instance.set_integer("stiff_solver", 1, ERROR, message)
    instance.set_integer("symplectic_steps", 0)
    instance.set_integer("stiff_solver", 1)
    instance.set_integer("symplectic_steps", 3, ERROR, message)
    instance.exit_initialization()
    instance.step(0.0, 0.1)


@pytest.mark.variants(core=0)
def test_more_states_than_its_matrices_take_are_refused(folder) -> None:
    library = Library(build(assemble(PendulumChain, 501), folder))
    message = "stiff_solver = 1: PendulumChain has 1002 states, the stiff solver takes 1000; set 0"
    instance = library.initializing()
    instance.set_integer("stiff_solver", 1, ERROR, message)


def test_a_communication_step_that_is_much_too_long_is_named(folder) -> None:
    """Concentrations move within 0.1 s at first: in 1e12 s the solver has no step for that, in shorter ones it has."""
    instance = Library(build(assemble(Hires), folder)).start(stiff_solver=1, tolerance=1e-8)
    asks = "from t = 0 the tolerance 1e-08 asks for solver steps of less than 1e-13 of it"
    text = f"the communication step of 1e+12 s is too long: {asks}; choose a shorter one"
    instance.step(0.0, 1e12, DISCARD, f"{text}; the step from t = 0 is taken back")
    instance.step(0.0, 1e6)
    instance.step(1e6, 1e12)
