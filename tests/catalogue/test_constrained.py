"""CartesianPendulum: constraints and multipliers against Newton's law, against the angle, and against the two texts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hand_derivations import applied
from numpy.typing import NDArray
from on_paper import BACKENDS, State, Values, algebra, assert_follows, equations_of, run, unloaded, wave
from scipy.integrate import solve_ivp

from liaisons.check import max_error
from liaisons.cosim import Result, simulate
from liaisons.mechanics import accelerations_by_gauss
from liaisons_catalogue.cartesian_pendulum import CartesianPendulum
from liaisons_catalogue.pendulum import Pendulum

EQUATIONS = equations_of(CartesianPendulum)
CONDITION = 1e-11  # rounding of a linear system of two equations, numbers of order 100


def place(angle: float, rod: float, height: float) -> tuple[float, float]:
    return rod * np.sin(angle), height - rod * np.cos(angle)


def consistent(seed: int, *, moving: bool) -> State:
    """A random state on the constraints, loads and drives included; the rod moves or does not."""
    rng = np.random.default_rng(seed)
    n = {name: float(rng.normal()) for name in EQUATIONS.symbols}
    n |= {"mass": 1.7, "gravity": 9.1, "height": 0.4, "rod": float(rng.uniform(0.5, 2)), "y": 0.0, "y_dot": 0.0}
    if not moving:
        n |= dict.fromkeys(("rod_dot", "rod_ddot"), 0.0)
    angle, rate = rng.uniform(-3, 3), rng.normal()
    n["x"], n["z"] = place(angle, n["rod"], n["height"])
    along, across = np.array([np.sin(angle), -np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])
    n["x_dot"], n["z_dot"] = n["rod_dot"] * along + n["rod"] * rate * across
    return State(CartesianPendulum, n)


def rod_and_velocity(n: State) -> tuple[NDArray, NDArray]:
    return np.array([n.x, 0, n.z - n.height]), np.array([n.x_dot, 0, n.z_dot])


# ---- Newton's law and the formulas of the text -------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_bob_moves_by_newtons_law_on_a_rod_that_moves(seed: int) -> None:
    """Along and across the rod, m (l'' - l θ'²) and m (l θ'' + 2 l' θ'): the other way to describe it."""
    n = consistent(seed, moving=True)
    d, v = rod_and_velocity(n)
    along = d / n.rod
    turn = np.cross(along, v)[1] / n.rod
    in_plane = (applied(n, *"xyz") - [0, 0, n.mass * n.gravity]) * [1, 0, 1]
    rod_force = n.mass * (n.rod_ddot - n.rod * turn**2) - in_plane @ along
    assert n("accelerations") == algebra((in_plane + rod_force * along) / n.mass, CONDITION)
    assert n("momentum_rates") == algebra(in_plane + rod_force * along, CONDITION)
    assert n("operator_forces") == algebra(rod_force, CONDITION)


@pytest.mark.parametrize("seed", range(10))
def test_multipliers_are_those_of_example_1_and_gausss_those_of_example_9(seed: int) -> None:
    """λ_1 = -m (g (l - z) + v²)/2l², λ_2 = 0, with the rod as long as the pivot is high."""
    n = consistent(seed, moving=False) | unloaded(CartesianPendulum)
    n.update(z=n.z + n.rod - n.height, height=n.rod)
    bracket = n.mass * (n.gravity * (n.rod - n.z) + n.x_dot**2 + n.z_dot**2) / n.rod**2
    assert n("lambda_1") == algebra(-bracket / 2, CONDITION)
    assert n("lambda_2") == algebra(0, CONDITION)
    accelerations, mu = accelerations_by_gauss(EQUATIONS.mass_matrix, EQUATIONS.forces, EQUATIONS.constraints)
    # Kneller's g_1 is |d| times the second derivative of |d|: its multiplier is that of the rod over l.
    assert n(mu[1]) / n.rod == algebra(bracket, CONDITION)
    explicit = [-n.x * bracket, 0, -n.mass * n.gravity + (n.rod - n.z) * bracket]
    assert n(accelerations) == algebra(np.array(explicit) / n.mass, CONDITION)


@pytest.mark.parametrize("seed", range(5))
def test_ka6_the_printed_mu_1_is_half_of_what_its_own_constraint_asks_for(seed: int) -> None:
    """K Ex. 9 with g_1 = x x'' + y y'' + (z - l) z'' + v²: the printed μ_1 leaves g_1 ≠ 0."""
    n = consistent(seed, moving=False)
    d, v = rod_and_velocity(n)
    bracket = n.mass * (-n.gravity * d[2] + v @ v) / n.rod**2

    def g_1(mu_1: float) -> float:
        return float(d @ (np.array([0, 0, -n.gravity]) - mu_1 / n.mass * d) + v @ v)

    assert g_1(bracket) == algebra(0, CONDITION)
    assert abs(g_1(bracket / 2)) > 0.1  # as printed


@pytest.mark.parametrize("seed", range(5))
def test_kc2_equation_9_as_printed_would_not_follow_a_rod_that_moves(seed: int) -> None:
    """K eq. 9 lacks 2 Σ r'·∂_t∂_r σ + ∂_t² σ: with σ = |d|² - l² it says d·r'' + r'² = 0 instead of l l'' + l'²."""
    n = consistent(seed, moving=True)
    d, v = rod_and_velocity(n)
    needed = n.rod * n.rod_ddot + n.rod_dot**2
    assert d @ n("accelerations") + v @ v == algebra(needed, CONDITION)
    assert abs(needed) > 1e-3  # what is printed as 0


def without_regulation(squared_length: Any) -> Any:
    """The explicit motion of K Ex. 1 with |d|² or l² in the denominator; l = m = 1, g = 9.81, (x, z, x', z')."""

    def rates(_: float, y: NDArray) -> NDArray:
        d, v = np.array([y[0], y[1] - 1]), y[2:]
        lambda_1 = -(-9.81 * d[1] + v @ v) / (2 * squared_length(d))
        return np.array([*v, *(2 * lambda_1 * d + [0, -9.81])])

    return rates


def sigma_1(y: NDArray) -> NDArray:
    return y[0] ** 2 + (y[1] - 1) ** 2 - 1


DISTURBED = np.array([*place(0.5, 1.0, 1.0), 1e-6, 0.0])  # off by σ_1' = 2e-6 sin 0.5


def test_kc1_multipliers_keep_what_they_find_the_residual_grows_linearly() -> None:
    """No function of regulation, as the text says: σ_1'' = 0 with the multipliers that eq. 9 gives."""
    times = np.linspace(0, 10, 11)
    y = solve_ivp(without_regulation(lambda d: d @ d), (0, 10), DISTURBED, "DOP853", times, rtol=1e-12, atol=1e-14).y
    np.testing.assert_allclose(sigma_1(y), 2e-6 * np.sin(0.5) * times, rtol=0, atol=1e-9)  # 100 solver tolerances


def test_kc1_as_printed_with_l_squared_the_residual_oscillates() -> None:
    """The printed motion has σ_1'' = (4 λ_1/m) σ_1: bounded where the rod pulls; exactly, at any state."""
    rates = without_regulation(lambda _: 1.0)
    for seed in range(5):
        y = np.random.default_rng(seed).normal(size=4)
        d, v = np.array([y[0], y[1] - 1]), y[2:]
        second = 2 * (d @ rates(0.0, y)[2:] + v @ v)
        lambda_1 = -(9.81 * (1 - y[1]) + v @ v) / 2
        assert second == algebra(4 * lambda_1 * sigma_1(y), CONDITION)
    times = np.linspace(0, 10, 201)
    y = solve_ivp(rates, (0, 10), DISTURBED, "DOP853", times, rtol=1e-12, atol=1e-14).y
    drift = 2e-6 * np.sin(0.5)
    assert np.abs(sigma_1(y)).max() < drift  # about drift/√(2 g/l) where the other grows to 10 times the drift
    assert np.any(sigma_1(y)[100:] < -drift / 20)  # it does oscillate


# ---- FMUs: two descriptions, one motion --------------------------------------------------------------------------


USUAL: Values = {"step_size": 0.05, "tolerance": 1e-12}
STATES = {"x": "bob_x", "z": "bob_z", "x_dot": "bob_x_dot", "z_dot": "bob_z_dot"}


def cartesian_start(theta: float, theta_dot: float = 0.0) -> Values:
    x, z = place(theta, 1.0, 1.0)
    return {"x_0": x, "z_0": z, "x_dot_0": np.cos(theta) * theta_dot, "z_dot_0": np.sin(theta) * theta_dot}


def assert_same_motion(cartesian: Result, angle: Result) -> None:
    # Asked for: 1e-9.  Solver tolerance 1e-12, κ = 100 over 20 s.
    assert_follows(cartesian, {name: angle[other] for name, other in STATES.items()}, 1e-9)
    others = {name: name for name in ("kinetic_energy", "potential_energy", "work")} | {"rod_force": "length_force"}
    for name, other in others.items():
        scale = max(1.0, float(np.max(np.abs(angle[other]))))
        assert max_error(cartesian[name], angle[other]) <= 1e-9 * scale, name  # relative: forces of 60 N
    assert max_error(cartesian["energy_balance"], 0.0) <= 1e-9


both_backends = pytest.mark.parametrize("backend", BACKENDS)


@both_backends
def test_they_agree_while_an_operator_moves_the_rod(fmu, backend: str) -> None:
    sigma = wave(1.1, -0.1, 6.0, np.pi / 2)  # 1 + 0.2 sin² 3t
    settings: Values = USUAL | {"step_size": 0.02}
    cartesian = run(fmu(CartesianPendulum, backend), **settings, **cartesian_start(1.0), inputs={"rod": sigma})
    angle = run(fmu(Pendulum), **settings, theta_0=1.0, pivot_z=1.0, inputs={"length": sigma})
    assert_same_motion(cartesian, angle)
    assert max_error(cartesian["rod_residual"], 0.0) <= 1e-15  # a rounding: projected


@both_backends
def test_a_jump_of_the_rods_rate_is_an_impulse_along_it(fmu, backend: str) -> None:
    """What p_θ does by itself in the angle has to come from the projection here: the rod's rate jumps, θ' does not."""

    def sigma(t: float) -> tuple[float, float, float]:
        pulled = -0.4 if 1.0 <= t < 1.5 else 0.0
        return 1 - 0.4 * min(max(t - 1.0, 0.0), 0.5), pulled, 0.0

    times: Values = {"times": np.arange(0, 10.25, 0.25), "tolerance": 1e-12}
    cartesian = simulate(fmu(CartesianPendulum, backend), **cartesian_start(1.0), inputs={"rod": sigma}, **times)
    angle = simulate(fmu(Pendulum), theta_0=1.0, pivot_z=1.0, inputs={"length": sigma}, **times)
    # At a jump the outputs show the state before the impulse, which only the next step books here.
    smooth = np.flatnonzero(~np.isin(cartesian.time, (1.0, 1.5)))
    for name, other in (STATES | {"work": "work"}).items():
        assert max_error(cartesian[name][smooth], angle[other][smooth]) <= 1e-9, name
    assert np.ptp(angle["energy"]) > 0.1  # the pull did something


def test_closed_form_has_the_multiplier_that_newton_asks_for() -> None:
    """Along the rod, m v²/l = T - m g cos θ, and T = -2 l λ_1."""
    mass, rod, height, gravity = 2.0, 1.3, 1.7, 9.0
    at = {"mass": mass, "rod": rod, "height": height, "gravity": gravity}
    exact = CartesianPendulum.exact(np.linspace(0, 2, 9), theta_0=1.0, theta_dot_0=0.5, **at)
    pull = mass * (exact["x_dot"] ** 2 + exact["z_dot"] ** 2 + gravity * (height - exact["z"])) / rod
    np.testing.assert_allclose(-2 * rod * exact["lambda_1"], pull, rtol=1e-12)  # roundings of elliptic functions
