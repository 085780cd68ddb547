"""IsokineticOscillator and NoseHooverOscillator: oscillators at a temperature (K Ex. 10 and 4.2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from on_paper import BACKENDS, Values, algebra, assert_follows, equations_of, random_states, run, unloaded, vector
from scipy.integrate import quad, solve_ivp
from scipy.optimize import root_scalar

from liaisons.check import max_error
from liaisons.mechanics import gauss
from liaisons.models.isokinetic_oscillator import IsokineticOscillator
from liaisons.models.nose_hoover_oscillator import NoseHooverOscillator
from liaisons.models.oscillator import Oscillator


def isokinetic(y: NDArray, n: Values) -> NDArray:
    """Rates of K Ex. 10 in NumPy, with m v² for the printed 3 k_B T."""
    r, v = y[:3], y[3:]
    mu = -n["stiffness"] * (r @ v) / (n["mass"] * (v @ v))
    return np.array([*v, *(-n["stiffness"] / n["mass"] * r - mu * v)])


def integrated(rates: Callable[[NDArray], NDArray], start: ArrayLike, times: NDArray) -> NDArray:
    return solve_ivp(lambda _, y: rates(y), times[[0, -1]], start, "DOP853", times, rtol=1e-13, atol=1e-15).y


# ---- the formulas of the text ------------------------------------------------------------------------------------


def test_isokinetic_oscillator_is_example_10() -> None:
    equations = equations_of(IsokineticOscillator)
    accelerations, mu = gauss(equations.mass_matrix, equations.forces, equations.constraints)
    for n in random_states(IsokineticOscillator, 10, **unloaded(IsokineticOscillator)):
        r, v = vector(n), vector(n, "{}_dot")
        v *= np.sqrt(3 * n.thermal_energy / n.mass) / np.linalg.norm(v)  # the speed fits the temperature
        n.update(zip(("x_dot", "y_dot", "z_dot"), v, strict=True))
        printed = -n.stiffness * (r @ v) / (3 * n.thermal_energy)
        expected = isokinetic(np.array([*r, *v]), n)[3:]
        assert n("mu") == algebra(printed)
        assert n("accelerations") == algebra(expected)
        assert n(accelerations) == algebra(expected)  # the other code path
        assert n(mu) == algebra(printed)
        # The thermostat takes out m v² μ, which the energy balance books as dissipated.
        assert n("dissipation") == algebra(3 * n.thermal_energy * printed)


def test_kc10_with_the_printed_mu_an_error_of_the_constraint_grows_with_the_potential() -> None:
    """(κ - 3 k_B T/2) exp(-2V/3 k_B T) is constant: on the way out an error is multiplied by exp(2ΔV/3 k_B T)."""

    def printed(y: NDArray) -> NDArray:
        r, v = y[:3], y[3:]
        return np.array([*v, *(-r + (r @ v) / 3 * v)])  # m = K = k_B T = 1

    y = integrated(printed, [0.5, 0, 0, *3 * [1 + 1e-9]], np.linspace(0, 1.5, 16))
    V, excess = np.sum(y[:3] ** 2, axis=0) / 2, (np.sum(y[3:] ** 2, axis=0) - 3) / 2
    # The excess of 3e-9 J is known to 1e-14: roundings of an energy of 1.5 J, and 100 of them on the way.
    np.testing.assert_allclose(excess * np.exp(-2 * (V - V[0]) / 3), excess[0], rtol=1e-4)
    assert excess[-1] > 5 * excess[0]


def test_any_speed_is_kept_with_m_v_squared_in_the_denominator() -> None:
    start = [0.5, 0, 0, 1.1, 1.1, 1.1]  # 10 % too fast for k_B T = 1
    y = integrated(lambda y: isokinetic(y, {"mass": 1.0, "stiffness": 1.0}), start, np.linspace(0, 1.5, 16))
    np.testing.assert_allclose(np.sum(y[3:] ** 2, axis=0), 3 * 1.1**2, rtol=1e-12)  # ten solver tolerances


# ---- isokinetic: the closed form ---------------------------------------------------------------------------------

ORBITS: dict[str, Values] = {
    "default": {},
    "wide": {"x_0": 0.2, "x_dot_0": 0.1, "y_dot_0": 1.4106735979665885, "z_dot_0": 1.0},
    "oblique": {"x_0": 0.7, "y_0": 0.4, "z_0": 0.5, "x_dot_0": -1.0, "y_dot_0": 1.0, "z_dot_0": -1.0, "mass": 2.0}
    | {"thermal_energy": 2.0, "stiffness": 1.5},
    "straight": {"x_0": 0.5, "y_0": 0.5, "z_0": 0.5},
    "free": {"stiffness": 0.0},
}


@pytest.mark.parametrize("start", ORBITS.values(), ids=ORBITS)
def test_closed_form_solves_the_equations_of_motion(start: Values) -> None:
    """Against an integration with the corrected μ, which is not unstable."""
    times = np.linspace(0, 6, 13)  # along the straight way V grows to 60 J
    exact = IsokineticOscillator.exact(times, **start)
    n = {"mass": 1.0, "stiffness": 1.0} | start
    names = ("x", "y", "z", "x_dot", "y_dot", "z_dot")
    y_0 = [exact[name][0] for name in names]
    given = {"x_0": 1.0, "y_0": 0.0, "z_0": 0.0, "x_dot_0": 1.0, "y_dot_0": 1.0, "z_dot_0": 1.0} | start
    # Close to a turning point the phase comes from the difference of w and w_1, relative error ε w/(w - w_1).
    np.testing.assert_allclose(y_0, [given[f"{name}_0"] for name in names], rtol=0, atol=1e-12)
    reference = integrated(lambda y: isokinetic(y, n), y_0, times)
    # Integration at 1e-13 over 6 s; κ = 100 where the orbit passes close to the origin.
    np.testing.assert_allclose([exact[name] for name in names], reference, rtol=0, atol=1e-11)


def test_turning_points_time_and_angle_between_them_are_the_quadratures() -> None:
    """By SciPy's root finder and adaptive quadrature in r, singular at both ends; m = k_B T = K = 1, a = 1/3."""
    r_0, speed = np.array([1.0, 0, 0]), np.sqrt(3)
    c = np.linalg.norm(np.cross(r_0, [1, 1, 1])) * np.exp(-1 / 6) / speed

    def radial(r: float) -> float:
        return 1 - c**2 * np.exp(r**2 / 3) / r**2

    inner, outer = (
        float(root_scalar(radial, bracket=ends, xtol=1e-15).root) for ends in ((0.1, 3**0.5), (3**0.5, 9.0))
    )
    half, middle = (outer - inner) / 2, (outer + inner) / 2

    def over(weight: Any) -> float:
        def integrand(s: float) -> float:  # r = middle + half sin s takes the singular ends out
            r = middle + half * np.sin(s)
            return weight(r) * half * np.cos(s) / (speed * np.sqrt(radial(r)))

        return quad(integrand, -np.pi / 2 + 1e-6, np.pi / 2 - 1e-6, epsabs=1e-10)[0]

    found = IsokineticOscillator.turning_points(position=r_0, velocity=[1, 1, 1])
    angle = over(lambda r: c * speed * np.exp(r**2 / 6) / r**2)
    # Ends of 1e-6 rad cut off, where the integrands are about 2.
    np.testing.assert_allclose(found, [inner, outer, over(lambda _: 1.0), angle], rtol=0, atol=1e-5)
    np.testing.assert_allclose(found[:2], [inner, outer], rtol=1e-13)  # a root's roundings


# ---- isokinetic: FMUs --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", ["default", "wide", "oblique", "free"])
def test_isokinetic_fmu_follows_its_closed_form(fmu, name: str, backend: str) -> None:
    start: Any = ORBITS[name]
    result = run(fmu(IsokineticOscillator, backend), **start)
    assert_follows(result, IsokineticOscillator.exact(result.time, **start), 1e-7)  # κ = 100 over 20 s, ten tolerances
    assert max_error(result["kinetic_residual"], 0.0) <= 1e-14  # projected: a few roundings of 3 J
    assert max_error(result["energy_balance"], 0.0) <= 1e-7


def test_isokinetic_invariants_for_a_long_time(fmu) -> None:
    """Speed, L exp(-V/3 k_B T) and the plane, over 1600 periods."""
    result = run(fmu(IsokineticOscillator), stop_time=1e4, step_size=1.0, tolerance=1e-11)
    r, v = vector(result), vector(result, "{}_dot")
    assert max_error(np.sum(v**2, axis=0), 3.0) <= 1e-14  # |v| is the constraint: projected
    moment = np.cross(r, v, axis=0) * np.exp(-np.sum(r**2, axis=0) / 6)
    # 10 tolerances × time, PHYSICS' rule for first integrals.
    assert max_error(moment, np.repeat(moment[:, :1], result.time.size, axis=1)) <= 10 * 1e-11 * 1e4
    # The plane is that of the two vectors at the start; their drift across it is rounding alone: all forces lie in it.
    normal = moment[:, 0] / np.linalg.norm(moment[:, 0])
    assert max_error(normal @ r, 0.0) <= 1e-11
    assert np.ptp(result["energy"]) > 1  # while this one is not conserved


def test_isokinetic_circle(fmu) -> None:
    """r = √(3 k_B T/K) at the rate √(K/m); the circle is stable, dr/dt² has the minimum there."""
    radius, n = np.sqrt(3 * 0.7 / 2.0), {"mass": 1.5, "stiffness": 2.0, "thermal_energy": 0.7}
    rate = np.sqrt(2.0 / 1.5)
    start: Any = {"x_0": radius, "x_dot_0": 0.0, "y_dot_0": radius * rate, "z_dot_0": 0.0}
    result = run(fmu(IsokineticOscillator), **n, **start)
    phase = rate * result.time
    exact = {"x": radius * np.cos(phase), "y": radius * np.sin(phase), "mu": 0.0}
    assert_follows(result, exact, 1e-8)  # a hundred tolerances


def test_isokinetic_without_angular_momentum_is_uniform_although_that_is_the_unstable_case(fmu) -> None:
    """Straight out from the origin for 100 s, V = 15 000 J: with the printed μ errors grow by exp(10 000)."""
    result = run(fmu(IsokineticOscillator), x_0=0.5, y_0=0.5, z_0=0.5, stop_time=100.0)
    assert_follows(result, dict.fromkeys("xyz", 0.5 + result.time), 1e-9)  # 100 m and its roundings


# ---- Nosé and Hoover ---------------------------------------------------------------------------------------------


def nose_hoover(y: NDArray) -> NDArray:
    """q, q', ξ, η of the default oscillator, in NumPy."""
    return np.array([y[1], -y[0] - y[2] * y[1], y[1] ** 2 - 1, y[2]])


@pytest.mark.parametrize("backend", BACKENDS)
def test_nose_hoover_fmu_follows_a_high_order_integration(fmu, backend: str) -> None:
    result = run(fmu(NoseHooverOscillator, backend), q_dot_0=0.5, xi_0=0.3)
    reference = integrated(nose_hoover, [1, 0.5, 0.3, 0], result.time)
    # on a torus: κ = 100 over 20 s, ten tolerances
    assert_follows(result, dict(zip(("q", "q_dot", "xi", "eta"), reference, strict=True)), 1e-7)


@pytest.mark.parametrize("start", [{"q_0": 1.0}, {"q_0": 0.0, "q_dot_0": 5.0}], ids=["torus", "chaotic sea"])
def test_nose_hoover_extended_energy_is_constant(fmu, start: Any) -> None:
    """Over 1000 s, where trajectories of the second start cannot be compared any more."""
    result = run(fmu(NoseHooverOscillator), stop_time=1000.0, **start)
    scale = float(np.max(np.abs(result["energy"])))
    assert max_error(result["extended_energy"], result["extended_energy"][0]) <= 10 * 1e-10 * scale * 1000
    extended = result["energy"] + result["xi"] ** 2 / 2 + result["eta"]
    np.testing.assert_allclose(result["extended_energy"], extended, rtol=1e-14)  # the sum itself: roundings
    # What friction takes, the thermostat has: Q ξ²/2 + k_B T η.
    given = result["xi"] ** 2 / 2 + result["eta"] - start.get("xi_0", 0.0) ** 2 / 2
    assert max_error(result["dissipated"], given) <= 10 * 1e-10 * scale * 1000
    assert np.ptp(result["energy"]) > 0.5  # the oscillator's own is not


def test_nose_hoover_keeps_the_temperature_on_the_average(fmu) -> None:
    """(1/τ) ∫ (m q'² - k_B T) dt = Q (ξ(τ) - ξ(0))/τ: the mean kinetic energy tends to k_B T/2 as 1/τ."""
    result = run(fmu(NoseHooverOscillator), q_0=2.5, stop_time=1000.0, step_size=0.01)
    mean = np.trapezoid(2 * result["kinetic_energy"] - 1.0, result.time) / 1000
    # Trapezoids of 0.01 s: h²/12 of the derivative's change, 1e-5 · 10 over 1000 s.
    assert mean == pytest.approx((result["xi"][-1] - result["xi"][0]) / 1000, abs=1e-6)
    assert abs(mean) <= 2 * np.abs(result["xi"]).max() / 1000


def test_nose_hoover_with_a_heavy_thermostat_is_the_damped_oscillator(fmu) -> None:
    start: Any = {"q_0": 1.0, "q_dot_0": -0.4}
    result = run(fmu(NoseHooverOscillator), thermostat_mass=1e15, xi_0=0.3, **start)
    exact = Oscillator.exact(result.time, x_0=1.0, x_dot_0=-0.4, damping=0.3)
    assert max_error(result["q"], exact["x"]) <= 1e-8  # a hundred tolerances; ξ moves by 1e-14


def test_nose_hoover_shrinks_phase_space_by_the_friction(fmu) -> None:
    """det ∂(q, p, ξ)/∂(q_0, p_0, ξ_0) = exp(-η), by central differences of FMU runs."""
    h, centre = 1e-4, np.array([1.0, 0.5, 0.3])

    def end(start: NDArray) -> NDArray:
        starts: Any = dict(zip(("q_0", "q_dot_0", "xi_0"), start, strict=True))
        result = run(fmu(NoseHooverOscillator), stop_time=5.0, tolerance=1e-12, **starts)
        return np.array([result[name][-1] for name in ("q", "p_q", "xi", "eta")])

    flow = np.array([(end(centre + h * e) - end(centre - h * e))[:3] / (2 * h) for e in np.eye(3)])
    shrunk = np.exp(-end(centre)[3])
    # Differences: h² = 1e-8 times third derivatives of order 100.
    assert np.linalg.det(flow) == pytest.approx(shrunk, rel=1e-5)
    assert abs(shrunk - 1) > 0.05
