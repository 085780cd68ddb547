"""Constraints of all kinds on one generic mechanism: multipliers by two routes, projection, energy, regulation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np
import pytest
from bodies import Bead, Skate, TwiceHeldBead
from numpy.typing import NDArray

from liaisons.check import max_error
from liaisons.cosim import simulate
from liaisons.errors import SimulationError
from liaisons.fmu import build
from liaisons.language import (
    ActiveCoordinate,
    Coordinate,
    Mechanism,
    Parameter,
    constraint,
    non_holonomic,
    rheonomic_constraint,
    unchecked,
)
from liaisons.mechanics import Inertia, accelerations_by_gauss, assemble, constraints, derive

State = dict[str, float]


NUMBERS = "made of bare numbers, in SI units"


class Guided(Mechanism):
    """Five free coordinates, a metric that mixes them with an adapted active one, and one constraint of each kind."""

    friction = Parameter(0.2, "1/s", "friction", minimum=0)
    a = Coordinate("m", "free", start=1.0)
    b = Coordinate("m", "free")
    c = Coordinate("m", "free")
    d = Coordinate("m", "free", start=1.0)
    f = Coordinate("m", "free")
    slide = ActiveCoordinate("m", "active, adapted")

    @constraint("m2", "a curve that the active coordinate moves", unchecked=NUMBERS)
    def curve(self) -> ca.SX:
        return self.a**2 + self.b**2 + 0.3 * self.c * self.slide - 1

    @non_holonomic("m2/s2", "neither linear nor homogeneous in the rates", unchecked=NUMBERS)
    def steering(self) -> ca.SX:
        return self.dot(self.f) * (1 + 0.2 * self.dot(self.b)) - self.a * self.dot(self.c) + 0.3 * self.b

    @rheonomic_constraint("m", "distance", start=1.0, above=0, unchecked=NUMBERS)
    def reach(self) -> ca.SX:
        return ca.sqrt(self.b**2 + self.c**2 + self.d**2) + 0.1 * self.slide

    @unchecked(NUMBERS)
    def kinetic_energy(self) -> ca.SX:
        a, b, c, d, f = (self.dot(q) for q in (self.a, self.b, self.c, self.d, self.f))
        mixed = (a + ca.cos(self.b) * c + self.dot(self.slide)) ** 2 + (b - self.a * f) ** 2
        return mixed / 2 + (0.5 * a**2 + b**2 + c**2 + 0.7 * d**2 + f**2) / 2

    @unchecked(NUMBERS)
    def potential_energy(self) -> ca.SX:
        return self.a * self.c + ca.sin(self.d) + self.b * self.slide

    def friction_coefficient(self) -> ca.SX:
        return self.friction

    @unchecked(NUMBERS)
    def dissipation_function(self) -> ca.SX:
        return 0.3 * (self.dot(self.c) - self.dot(self.slide)) ** 2 + 0.2 * self.dot(self.d) ** 4


EQUATIONS = derive(Guided)
METRIC = Inertia(EQUATIONS.mass_matrix, EQUATIONS.mass_matrix)
MODEL = assemble(Guided)
FREE = [q.name for q in Guided.coordinates]
INPUTS = [variable.name for variable in MODEL.inputs]
KEPT = ["curve", "steering", "reach"]


def numbers(expression: ca.SX, state: State) -> NDArray:
    function = ca.Function("numbers", list(EQUATIONS.symbols.values()), [ca.densify(expression)])
    return np.asarray(function(*(state.get(name, 0.0) for name in EQUATIONS.symbols)))


def random_state(seed: int) -> State:
    """Everything moves, nothing is consistent."""
    rng = np.random.default_rng(seed)
    state = {name: float(rng.uniform(-0.3, 0.3)) for name in EQUATIONS.symbols}
    return state | {"a": 0.9, "d": 1.1, "friction": 0.2, "reach": float(rng.uniform(0.9, 1.3))}


def vectors(state: State) -> tuple[NDArray, NDArray, NDArray]:
    """y, u, k of the model at a state."""
    p = EQUATIONS.evaluate("momenta", **state)
    k = [state.get(variable.name, variable.start) for variable in MODEL.parameters]
    return (
        np.array([*(state[q] for q in FREE), *p, 0, 0]),
        np.array([state.get(name, 0.0) for name in INPUTS]),
        np.array(k),
    )


def project(y: NDArray, u: NDArray, k: NDArray) -> NDArray:
    assert MODEL.project is not None
    return np.asarray(MODEL.project(0, y, u, k))[:, 0]


def consistent_state(seed: int) -> State:
    """A random state on all constraints, far from the start: by repeated projection."""
    state = random_state(seed)
    y, u, k = vectors(state)
    for _ in range(5):
        y = project(y, u, k)
    at = state | dict(zip(FREE, y[:5], strict=True))
    p = {f"p_{q}": value for q, value in zip(FREE, y[5:10], strict=True)}
    rates = EQUATIONS.evaluate("velocities", **(at | p))
    return at | {f"{q}_dot": value for q, value in zip(FREE, rates, strict=True)}


def residuals(y: NDArray, u: NDArray, k: NDArray) -> NDArray:
    """What is not kept of positions and rates."""
    kept = EQUATIONS.constraints
    all_of_them = EQUATIONS.in_phase_space(ca.vertcat(kept.residuals, kept.rate_residuals))
    state = dict(zip([*FREE, *(f"p_{q}" for q in FREE)], y[:10], strict=True)) | dict(zip(INPUTS, u, strict=True))
    return numbers(all_of_them, state | {"friction": k[0]})[:, 0]


# ---- multipliers by d'Alembert and by Gauss ----------------------------------------------------------------------


def test_dalembert_gauss_and_the_null_space_give_one_motion(seed: int) -> None:
    """K eq. 7-9 against K eq. 107-113, and both against NumPy, which knows of no multiplier; μ = -λ.

    K eq. 113 prints A ẍ = f + Cᵀ μ; the minimum of eq. 112 has the minus: with the printed sign C ẍ ≠ c (KA5).
    """
    state = random_state(seed)
    A, C = numbers(EQUATIONS.mass_matrix, state), numbers(EQUATIONS.constraints.matrix, state)
    f, c = numbers(EQUATIONS.forces, state)[:, 0], numbers(EQUATIONS.constraints.targets, state)[:, 0]
    ways = accelerations_by_gauss(EQUATIONS.mass_matrix, EQUATIONS.forces, EQUATIONS.constraints)
    by_gauss, mu = (numbers(way, state)[:, 0] for way in ways)
    lambdas = constraints.multipliers(METRIC, EQUATIONS.forces, EQUATIONS.constraints)
    by_dalembert = EQUATIONS.evaluate("accelerations", **state)
    # Least constraint: ẍ = x_0 + N y with C x_0 = c, C N = 0, and ½ |ẍ - A⁻¹ f|² in the metric A least.
    x_0, N = np.linalg.lstsq(C, c)[0], np.linalg.svd(C)[2][3:].T
    least = x_0 + N @ np.linalg.solve(N.T @ A @ N, N.T @ (f - A @ x_0))
    # Linear systems of condition 1e3 at most, numbers of order 100 (the regulation of an inconsistent state).
    size = 1 + np.abs(least).max()
    np.testing.assert_allclose(by_gauss, least, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(by_dalembert, least, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(mu, -numbers(lambdas, state)[:, 0], rtol=0, atol=1e-11 * size)
    assert np.abs(C @ np.linalg.solve(A, f + C.T @ mu) - c).max() > 1


# ---- the motion stays on the constraints -------------------------------------------------------------------------


def written_by_hand(q: NDArray, v: NDArray, slide: float) -> NDArray:
    """The three constraint functions in NumPy: curve, steering, π."""
    a, b, c, d, _ = q
    return np.array(
        [
            a**2 + b**2 + 0.3 * c * slide - 1,
            v[4] * (1 + 0.2 * v[1]) - a * v[2] + 0.3 * b,
            np.sqrt(b**2 + c**2 + d**2) + 0.1 * slide,
        ]
    )


def test_accelerations_keep_the_constraints(seed: int) -> None:
    """Along a Taylor curve with these accelerations curve'' = 0, steering' = 0, π'' = σ''."""
    n = consistent_state(seed)
    q, v = (np.array([n[f"{name}{end}"] for name in FREE]) for end in ("", "_dot"))
    a = EQUATIONS.evaluate("accelerations", **n)

    def along(t: float) -> NDArray:
        slide = n["slide"] + n["slide_dot"] * t + n["slide_ddot"] * t**2 / 2
        return written_by_hand(q + v * t + a * t**2 / 2, v + a * t, slide)

    h = 1e-3  # central differences: truncation h² = 1e-6 times third derivatives of order 10
    before, here, after = along(-h), along(0.0), along(h)
    second, first = (after - 2 * here + before) / h**2, (after - before) / (2 * h)
    np.testing.assert_allclose(here, [0, 0, n["reach"]], rtol=0, atol=1e-14)  # projected: rounding
    np.testing.assert_allclose(second[[0, 2]], [0, n["reach_ddot"]], rtol=0, atol=1e-4)
    np.testing.assert_allclose(first, [0, 0, n["reach_dot"]], rtol=0, atol=1e-5)


def test_energy_changes_by_the_power_of_the_ports_less_what_is_dissipated(seed: int) -> None:
    """The passive curve, though the operator moves it, does no work of its own: the operator does."""
    n = consistent_state(seed)
    m = EQUATIONS.mechanism
    rate = numbers(EQUATIONS.in_motion(m.dot(EQUATIONS.energy)), n)[0, 0]
    balance = EQUATIONS.evaluate("power", **n) - EQUATIONS.evaluate("dissipation", **n)
    assert rate == pytest.approx(balance[0], rel=1e-11, abs=1e-11)  # a linear system of condition 1e3


def test_away_from_the_constraints_the_residual_dies_out() -> None:
    """r'' + 2 α r' + α² r = 0, and ρ' + α ρ = 0: what model exchange lives on between projections."""
    n, alpha = random_state(3), constraints.STABILISATION
    m, kept = EQUATIONS.mechanism, EQUATIONS.constraints
    r, r_dot = numbers(kept.residuals, n)[:, 0], numbers(kept.rate_residuals, n)[:, 0]
    found = numbers(EQUATIONS.in_motion(m.dot(kept.rate_residuals)), n)[:, 0]
    # rate residuals have σ' in them, of which dot() takes the derivative too
    expected = np.where([True, False, True], -2 * alpha * r_dot - alpha**2 * r, -alpha * r_dot)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)  # the linear system
    assert np.abs(r).min() > 1e-3  # it was indeed away


# ---- projection --------------------------------------------------------------------------------------------------


def test_projection_ends_on_the_constraints_and_stays_there(seed: int) -> None:
    y, u, k = vectors(consistent_state(seed))
    # The error of a step at the loosest tolerance: Newton's three rounds leave its eighth power, below rounding.
    perturbed = y + np.random.default_rng(seed).normal(size=y.size) * ([1e-3] * 10 + [0, 0])
    assert np.abs(residuals(perturbed, u, k)).max() > 1e-4
    there = project(perturbed, u, k)
    np.testing.assert_allclose(residuals(there, u, k), 0, rtol=0, atol=4e-15)  # a few roundings of numbers of order 1
    np.testing.assert_allclose(project(there, u, k), there, rtol=0, atol=4e-15)  # the same
    np.testing.assert_allclose(project(y, u, k), y, rtol=0, atol=4e-15)  # what is consistent stays


def test_projection_goes_the_shortest_way_in_the_metric_of_the_masses(seed: int) -> None:
    """The push is A⁻¹ Cᵀ ν: across every motion that the constraints allow, so that it does no virtual work."""
    n = consistent_state(seed)
    y, u, k = vectors(n)
    size = 1e-5
    off = y + size * np.random.default_rng(seed).normal(size=y.size) * ([1] * 5 + [0] * 7)
    A = numbers(EQUATIONS.mass_matrix, n)
    C = numbers(EQUATIONS.constraints.matrix, n)[list(EQUATIONS.constraints.holonomic)]
    allowed = np.linalg.svd(C)[2][2:].T
    push = (project(off, u, k) - off)[:5]
    assert np.abs(push).max() > 1e-6
    np.testing.assert_allclose(
        allowed.T @ A @ push, 0, rtol=0, atol=100 * size**2
    )  # curvature: second order in the size


# ---- a skate on a slope: a non-holonomic constraint with a closed form -------------------------------------------


@pytest.fixture(scope="module")
def skate(tmp_path_factory) -> Callable[[Literal["native", "python"]], Path]:
    directory = tmp_path_factory.mktemp("skate")
    return lambda backend: build(assemble(Skate), directory, backend=backend)


def test_a_spinning_skate_let_go_on_a_slope_runs_on_a_cycloid_and_never_gets_down(skate, backend) -> None:
    """x = (g/2ω²) sin² ωt, y = (g/2ω²) (ωt - ½ sin 2ωt): along the slope instead of down it."""
    result = simulate(skate(backend), stop_time=40.0, step_size=0.1, tolerance=1e-10)
    phase, size = 1.5 * result.time, 2.0 / (2 * 1.5**2)
    # κ grows in proportion to time, 40; ten tolerances.
    assert max_error(result["x"], size * np.sin(phase) ** 2) <= 1e-7
    assert max_error(result["y"], size * (phase - np.sin(2 * phase) / 2)) <= 1e-7
    assert max_error(result["edge_residual"], 0.0) <= 1e-14  # projected: rounding of speeds of order 1
    # The edge is linear in the rates: its force does no work but along what a solver step strays, ten tolerances.
    assert max_error(result["energy"], 0.3 * 1.5**2 / 2) <= 1e-8
    assert max_error(result["dissipated"], 0.0) <= 1e-9


def test_a_start_that_breaks_a_constraint_is_refused_with_its_name_and_residual(skate, backend) -> None:
    with pytest.raises(SimulationError, match=r"edge \(speed across the edge\) must be kept to 1e-06 m/s.*\(-0\.5\)"):
        simulate(skate(backend), stop_time=1.0, step_size=0.1, y_dot_0=0.5)


# ---- constraints that say the same ------------------------------------------------------------------------------


def test_redundant_constraints_change_no_motion_and_share_their_force(number) -> None:
    state = {"x": 0.6, "z": 0.8, "x_dot": -0.8, "z_dot": 0.6}
    once, twice = derive(Bead), derive(TwiceHeldBead)
    same = (e.evaluate("accelerations", **state) for e in (twice, once))
    np.testing.assert_allclose(*same, rtol=0, atol=1e-12)  # condition 1e3, accelerations of order 1
    (plane, circle), two = (number(e, e.multipliers, state) for e in (once, twice))
    # The larger a constraint's usual gradient, the smaller its share: squares 4 (x² + z²) + 4 + 4 of the circle's
    # gradient and its changes, 4 more of the sphere's.  Rounding of forces of 10 over the regularisation, 1e-10 of 16.
    shares = [plane, circle * 16 / 28, circle * 12 / 28]
    np.testing.assert_allclose(two, shares, rtol=0, atol=1e-5)


def test_momenta_that_break_a_constraint_die_out(number) -> None:
    """p' = ... - 2α (what p has across the constraints): model exchange is not projected."""
    equations = derive(Bead)
    alpha = constraints.STABILISATION
    state = {"x": 1.0, "p_x": 0.3, "p_y": -0.2, "p_z": 1.0}
    back, velocities = (number(equations, x, state) for x in (equations.constraint_stabilization, equations.velocities))
    np.testing.assert_allclose(back, [-2 * alpha * 0.3, 2 * alpha * 0.2, 0.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(velocities, [0.0, 0.0, 1.0], rtol=0, atol=1e-14)
