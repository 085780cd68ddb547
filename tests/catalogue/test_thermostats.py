"""IsokineticOscillator and NoseHooverOscillator: oscillators at a temperature (K Ex. 10, K 4.2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from on_paper import Values, algebra, equations_of, random_states, run, unloaded, vector
from scipy.integrate import quad, solve_ivp
from scipy.optimize import root_scalar

from liaisons.check import max_error
from liaisons.mechanics import accelerations_by_gauss
from liaisons_catalogue.isokinetic_oscillator import IsokineticOscillator
from liaisons_catalogue.nose_hoover_oscillator import NoseHooverOscillator
from liaisons_catalogue.oscillator import Oscillator


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
    accelerations, mu = accelerations_by_gauss(equations.mass_matrix, equations.forces, equations.constraints)
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


# ---- Nosé and Hoover ---------------------------------------------------------------------------------------------


def test_nose_hoover_with_a_heavy_thermostat_is_the_damped_oscillator(fmu) -> None:
    start: Any = {"q_0": 1.0, "q_dot_0": -0.4}
    result = run(fmu(NoseHooverOscillator), thermostat_mass=1e15, xi_0=0.3, **start)
    exact = Oscillator.exact(result.time, x_0=1.0, x_dot_0=-0.4, damping=0.3)
    assert max_error(result["q"], exact["x"]) <= 1e-8  # a hundred tolerances; ξ moves by 1e-14
