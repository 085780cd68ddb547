"""FreeParticle, ChargedParticle and KeplerOrbit, from Newton's law to FMUs."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hand_derivations import applied, lorentz_force
from numpy.typing import NDArray
from on_paper import (
    State,
    Values,
    algebra,
    curl,
    defaults,
    mechanism,
    random_states,
    taylor,
    unloaded,
    vector,
)

from liaisons_catalogue.charged_particle import ChargedParticle
from liaisons_catalogue.free_particle import FreeParticle
from liaisons_catalogue.kepler_orbit import KeplerOrbit
from liaisons_catalogue.solutions.stumpff import stumpff

# ---- the formulas of the texts -----------------------------------------------------------------------------------


def test_charged_particle_has_the_lagrangian_and_the_momenta_of_kneller() -> None:
    for n in random_states(ChargedParticle):
        r, v, B, E = (vector(n, form) for form in ("{}", "{}_dot", "B_{}", "E_{}"))
        A = np.cross(B, r) / 2  # K eq. 26
        L = n.mass / 2 * v @ v - n.charge * (-E @ r - v @ A)  # K eq. 24
        assert n("lagrangian") == algebra(L)
        assert n("momenta") == algebra(n.mass * v + n.charge * A)  # K Ex. 7
        assert [n(f"kinetic_momentum_{axis}") for axis in "xyz"] == algebra(n.mass * v)
        assert n("energy") == algebra(n("momenta") @ v - L)  # the magnetic field is not in it


CHARGE = mechanism(ChargedParticle)
GUIDING_CENTRE = ca.vertcat(CHARGE.guiding_centre_x, CHARGE.guiding_centre_y, CHARGE.guiding_centre_z)


def test_guiding_centre_drifts_with_e_cross_b_whatever_the_charge() -> None:
    for n in random_states(ChargedParticle, **unloaded(ChargedParticle)):
        B, E, v = vector(n, "B_{}"), vector(n, "E_{}"), vector(n, "{}_dot")
        arm = n(GUIDING_CENTRE - CHARGE._r)
        drift = ChargedParticle.drift(**{f"{F}_{axis}": n[f"{F}_{axis}"] for F in "BE" for axis in "xyz"})
        # Seen from the drift: across B, at v_⊥/Ω from the particle, in the direction in which the magnetic force pulls.
        seen = v - drift
        across = seen - B * (seen @ B) / (B @ B)
        radius = n.mass * np.linalg.norm(across) / (abs(n.charge) * np.linalg.norm(B))
        pull = n.charge * np.cross(seen, B)
        assert arm == algebra(radius * pull / np.linalg.norm(pull))
        rate = n(CHARGE.dot(GUIDING_CENTRE))
        assert rate - B * (rate @ B) / (B @ B) == algebra(drift)
        assert drift == algebra(np.cross(E, B) / (B @ B))


def test_guiding_centre_without_a_field_is_the_particle() -> None:
    for n in random_states(ChargedParticle, 3, B_x=0.0, B_y=0.0, B_z=0.0):
        np.testing.assert_array_equal(n(GUIDING_CENTRE), vector(n))


def test_eccentricity_vector_is_that_of_laplace_and_runge() -> None:
    """((v² - μ/r) r - (r·v) v)/μ by hand, and constant along the motion, as is the angular momentum."""
    m = mechanism(KeplerOrbit)
    e = ca.vertcat(m.eccentricity_x, m.eccentricity_y)
    for n in random_states(KeplerOrbit, **unloaded(KeplerOrbit)):
        r, v = vector(n, axes="xy"), vector(n, "{}_dot", "xy")
        assert n(e) == algebra(((v @ v - n.mu / np.hypot(*r)) * r - (r @ v) * v) / n.mu)
        assert n("angular_momentum") == algebra(n.mass * np.linalg.det([r, v]))
        rates = n(m.dot(ca.vertcat(e, m.angular_momentum)))
        size = (v @ v + 1) * np.hypot(*v) / np.hypot(*r) ** 2  # of the terms that cancel
        np.testing.assert_allclose(rates, 0, rtol=0, atol=1e-13 * max(1.0, size))


# ---- errata and validity of the texts ----------------------------------------------------------------------------


class PrintedFreeFall(FreeParticle):
    """K 2.5 item 2 as printed: U = -m g z."""

    def potential_energy(self) -> ca.SX:
        return -super().potential_energy()


def test_ka8_with_the_printed_potential_things_fall_upwards() -> None:
    still = unloaded(FreeParticle) | {f"{q}_dot": 0.0 for q in "xyz"}
    for n in random_states(FreeParticle, **still):
        fall = np.array([0.0, 0.0, -n.gravity])  # z'' = -g, K's own next line
        assert n("accelerations") == algebra(fall)
        assert State(PrintedFreeFall, n)("accelerations") == algebra(-fall)


class PrintedKepler(KeplerOrbit):
    """K 2.5 item 3 as printed: U = +γ m/|r|."""

    def potential_energy(self) -> ca.SX:
        return -super().potential_energy()


def test_ka9_the_printed_potential_repels_and_has_no_bound_orbit() -> None:
    for n in random_states(KeplerOrbit, **unloaded(KeplerOrbit)):
        r, printed = vector(n, axes="xy"), State(PrintedKepler, n)
        assert n("accelerations") @ r < 0 < printed("accelerations") @ r
        assert printed("energy") > 0  # whatever the start: it escapes, and there is no period


def test_ka11_virial_needs_positions_where_velocities_are_printed() -> None:
    """K 2.7: 2T = d/dt(p·r) - r·p', and by K eq. 73 with h = -1: 2T + V = d/dt(p·r)."""
    m = mechanism(KeplerOrbit)
    r, v = m.free.q, m.free.q_dot
    p = m.mass * v
    rates = ca.vertcat(ca.dot(r, m.dot(p)), m.dot(ca.dot(p, r)), m.dot(ca.dot(p, v)))
    for n in random_states(KeplerOrbit, **unloaded(KeplerOrbit)):
        twice_T = 2 * n("kinetic_energy")
        force_term, product_rate, printed_rate = n(rates)
        assert product_rate - force_term == algebra(twice_T)
        assert twice_T + n("potential_energy") == algebra(product_rate)
        assert abs(printed_rate - force_term - twice_T) > 1e-3 * twice_T


class PrintedLandau(ChargedParticle):
    """K eq. 27 as printed, for B along z: (Q B/2) (x y - y x)."""

    def lagrangian(self) -> ca.SX:
        printed = self.charge * self.B_z / 2 * (self.x * self.y - self.y * self.x)
        return self.kinetic_energy() - self.potential_energy() + printed


def test_ka12_without_its_dots_equation_27_has_no_magnetic_field_in_it() -> None:
    for n in random_states(ChargedParticle, B_x=0.0, B_y=0.0):
        area_rate = n.x * n.y_dot - n.y * n.x_dot
        L = n("kinetic_energy") - n("potential_energy") + n.charge * n.B_z / 2 * area_rate
        assert n("lagrangian") == algebra(L)
        electric = n.charge * vector(n, "E_{}")
        printed = State(PrintedLandau, n)("accelerations")
        assert printed == algebra((electric + applied(n, *"xyz")) / n.mass)
        assert np.linalg.norm(lorentz_force(n) - electric) > 1e-3


def test_kc3_half_b_cross_r_is_the_potential_of_a_uniform_field_only() -> None:
    r, B = ca.SX.sym("r", 3), ca.SX.sym("B", 3)
    uniform = ca.Function("uniform", [r, B], [curl(ca.cross(B, r) / 2, r) - B])
    np.testing.assert_allclose(uniform([1, 2, 3], [0.3, -0.7, 0.2]), 0, rtol=0, atol=1e-15)  # a rounding
    static = ca.vertcat(0, 0, r[0])  # B = x e_z, constant in time
    error = ca.Function("static", [r], [curl(ca.cross(static, r) / 2, r) - static])
    assert abs(float(error([1, 2, 3])[2])) == 0.5  # x/2 is missing


def kneller_example_4(t: NDArray, omega: float, v: NDArray) -> NDArray:
    """The solution as printed, r(0) = 0, B along z."""
    sine, cosine = np.sin(omega * t), np.cos(omega * t)
    x = (v[0] * sine - v[1] * cosine + v[1]) / omega
    y = (v[0] * cosine + v[1] * sine - v[0]) / omega
    return np.array([x, y, v[2] * t])


def test_kc4_closed_form_is_that_of_example_4_and_holds_where_it_divides_by_zero() -> None:
    times, v = np.linspace(0, 30, 61), np.array([1.0, -0.4, 0.1])
    start = {"x_dot_0": 1.0, "y_dot_0": -0.4, "z_dot_0": 0.1}
    for B_z in (1.0, -0.7):
        exact = ChargedParticle.exact(times, B_z=B_z, **start)
        found = [exact[axis] for axis in "xyz"]
        np.testing.assert_allclose(found, kneller_example_4(times, B_z, v), rtol=0, atol=2e-14)  # phase of 30, v/Ω = 1
    straight = ChargedParticle.exact(times, B_z=0.0, **start)
    np.testing.assert_allclose([straight[axis] for axis in "xyz"], np.outer(v, times), rtol=1e-15)  # one rounding
    nearly = ChargedParticle.exact(times, B_z=1e-20, **start)
    np.testing.assert_allclose(nearly["x"], straight["x"], rtol=1e-15)  # Ωt = 3e-19 of it
    # whereas the printed form loses v_y Ωt beside v_x, and with it all of y
    np.testing.assert_array_equal(kneller_example_4(times, 1e-20, v)[1], 0.0)
    np.testing.assert_allclose(nearly["y"], straight["y"], rtol=1e-15)  # as x
    with np.errstate(invalid="ignore"):
        assert np.all(np.isnan(kneller_example_4(times, 0.0, v)[:2]))


# ---- closed forms ------------------------------------------------------------------------------------------------


def test_stumpffs_functions_are_sines_and_their_series() -> None:
    theta = np.array([1e-8, 0.1, 0.999, 1.001, 3.0, 20.0])
    for sign, sine, cosine in ((1, np.sin, np.cos), (-1, np.sinh, np.cosh)):
        c_1, c_2, c_3 = stumpff(sign * theta**2)
        np.testing.assert_allclose(c_1, sine(theta) / theta, rtol=1e-15)  # the same expression
        # 1 - cos and θ - sin cancel in the references, by ε/θ² and ε/θ²
        np.testing.assert_allclose(c_2[1:], sign * (1 - cosine(theta[1:])) / theta[1:] ** 2, rtol=1e-13)
        np.testing.assert_allclose(c_3[1:], sign * (theta[1:] - sine(theta[1:])) / theta[1:] ** 3, rtol=1e-12)
        np.testing.assert_allclose([c_2[0], c_3[0]], [1 / 2, 1 / 6], rtol=1e-15)  # θ² = 1e-16
    assert [float(c) for c in stumpff(0.0)] == [1, 1 / 2, 1 / 6]


@pytest.mark.parametrize("friction", [0.0, 1e-9, 0.5, 20.0])
def test_free_particle_is_exact_to_rounding(friction: float) -> None:
    times = np.linspace(0, 5, 11)
    reference = taylor(
        times, [2, -3], [{(1,): 1}, {(): -Decimal(FreeParticle.gravity.start), (1,): -Decimal(friction)}]
    )
    exact = FreeParticle.exact(times, z_0=2, z_dot_0=-3, x_dot_0=-3, friction=friction)
    # Roundings of up to 140 m and of 50 m/s.
    np.testing.assert_allclose(exact["z"], reference[0], rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(exact["z_dot"], reference[1], rtol=1e-14, atol=1e-14)
    weightless = taylor(times, [0, -3], [{(1,): 1}, {(1,): -Decimal(friction)}])
    np.testing.assert_allclose(exact["x"], weightless[0], rtol=1e-14, atol=1e-14)


FIELDS: list[dict[str, float]] = [
    {"B_x": 0.3, "B_y": -0.8, "B_z": 0.5, "E_x": 0.2, "E_y": 0.1, "E_z": -0.4, "charge": -1.3, "mass": 0.7},
    {"B_z": 0.0, "E_x": 0.3, "E_z": -0.2},
    {"B_z": 1e-9, "E_x": 0.3},
    {"B_z": 20.0, "E_x": 5.0, "E_z": 0.1},
    {"charge": 0.0, "E_x": 1.0},
]


@pytest.mark.parametrize("fields", FIELDS)
def test_charged_particle_is_exact_to_rounding_in_any_fields(fields: dict[str, float]) -> None:
    times = np.linspace(0, 12, 13)
    n = defaults(ChargedParticle) | fields
    ratio = Decimal(n["charge"]) / Decimal(n["mass"])
    E, B = ([ratio * Decimal(n[f"{F}_{axis}"]) for axis in "xyz"] for F in "EB")
    # r' = v; v_x' = E_x + v_y B_z - v_z B_y, and so on round
    rates: list[Any] = [{(3 + i,): 1} for i in range(3)]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rates.append({(): E[i], (3 + j,): B[k], (3 + k,): -B[j]})
    start = {"x_0": 1.0, "y_0": -2.0, "z_0": 0.5, "x_dot_0": 0.3, "y_dot_0": 0.7, "z_dot_0": -1.1}
    reference = taylor(times, list(start.values()), rates)
    exact = ChargedParticle.exact(times, **start, **fields)
    phase = abs(n["charge"] / n["mass"]) * np.linalg.norm(vector(n, "B_{}")) * times[-1]
    # Roundings of the phase times speeds of up to 2 m/s and lengths of up to 30 m.
    tolerance = 4e-16 * max(30.0, 2 * phase)
    names = [form.format(axis) for form in ("{}", "{}_dot") for axis in "xyz"]
    for name, expected in zip(names, reference, strict=True):
        np.testing.assert_allclose(exact[name], expected, rtol=1e-14, atol=tolerance, err_msg=name)


@pytest.mark.parametrize("fields", [FIELDS[0], FIELDS[3]])
def test_guiding_centre_is_the_centre_of_the_turns(fields: dict[str, float]) -> None:
    """It is where the particle is on the average of a turn about now, when nothing pulls along B."""
    B, E = (np.array([fields.get(f"{F}_{axis}", 0.0) for axis in "xyz"]) for F in "BE")
    E -= B * (B @ E) / (B @ B)
    given: Any = fields | {f"E_{axis}": float(component) for axis, component in zip("xyz", E, strict=True)}
    period = 2 * np.pi * given.get("mass", 1.0) / (abs(given.get("charge", 1.0)) * np.linalg.norm(B))
    for now in (0.0, 0.3 * period, 5.1 * period):
        turn = ChargedParticle.exact(now + period * (np.arange(64) + 0.5) / 64 - period / 2, y_0=2.0, **given)
        at = ChargedParticle.exact(now, y_0=2.0, **given)
        mean = [float(np.mean(turn[axis])) for axis in "xyz"]  # the rule is exact for a sine and a straight line
        np.testing.assert_allclose(mean, [at[f"guiding_centre_{axis}"] for axis in "xyz"], rtol=0, atol=1e-13)


ORBITS: dict[str, Values] = {
    "circle": {},
    "ellipse": {"x_0": 0.3, "y_0": -1.1, "x_dot_0": 0.7, "y_dot_0": 0.2, "mu": 1.3},
    "e = 0.8": {"y_dot_0": np.sqrt(0.2)},
    "nearly parabolic": {"x_0": 0.5, "y_dot_0": 2 - 1e-9},
    "parabola": {"x_0": 0.5, "y_dot_0": 2.0},
    "hyperbola, inwards": {"x_0": 3.0, "x_dot_0": -1.5, "y_dot_0": 0.3},
    "backwards": {"y_dot_0": -1.2, "x_dot_0": -0.3},
}


@pytest.mark.parametrize("start", ORBITS.values(), ids=ORBITS)
def test_kepler_orbit_is_exact_to_rounding(start: dict[str, float]) -> None:
    times = np.linspace(0, 4, 17)
    x, y, u, v = (
        start.get(name, default) for name, default in (("x_0", 1.0), ("y_0", 0.0), ("x_dot_0", 0.0), ("y_dot_0", 1.0))
    )
    mu = Decimal(start.get("mu", 1.0))
    X, Y, U, V = map(Decimal, (x, y, u, v))
    w = 1 / (X * X + Y * Y).sqrt()
    sigma = X * U + Y * V
    # x, y, x', y', σ = r·v, K = v², w = 1/r, A = w², B = w³, C = A σ: everything is a polynomial in these
    rates = [
        {(2,): 1},
        {(3,): 1},
        {(8, 0): -mu},
        {(8, 1): -mu},
        {(5,): 1, (6,): -mu},
        {(8, 4): -2 * mu},
        {(6, 9): -1},
        {(7, 9): -2},
        {(8, 9): -3},
        {(9, 9): -2, (7, 5): 1, (8,): -mu},
    ]
    reference = taylor(times, [X, Y, U, V, sigma, U * U + V * V, w, w**2, w**3, w**2 * sigma], rates, step="0.01")
    exact = KeplerOrbit.exact(times, **start)
    # What the roundings of period and time do, some 1e-15 s, times speed and acceleration; and the orbit's size.
    late, speed, acceleration = 4e-15, np.hypot(*reference[2:4]), float(mu) * reference[6] ** 2
    assert np.all(np.hypot(exact["x"] - reference[0], exact["y"] - reference[1]) <= late * (1 + speed))
    assert np.all(np.hypot(exact["x_dot"] - reference[2], exact["y_dot"] - reference[3]) <= late * (1 + acceleration))


@pytest.mark.parametrize("y_dot_0", [0.05, 0.7, 1.0, 1.3, 1.414])
def test_kepler_orbit_closes_after_its_period(y_dot_0: float) -> None:
    period = KeplerOrbit.period(y_dot_0=y_dot_0)
    times = np.array([0.0, 0.3, 0.4]) * min(period, 10.0)
    first, later = (KeplerOrbit.exact(times + turns * period, y_dot_0=y_dot_0) for turns in (0, 1000))
    # κ of the period: roundings of 1000 periods times the largest speed, that of the pericentre
    slowest = min(y_dot_0, 2 / y_dot_0 - y_dot_0)
    for name in first:
        np.testing.assert_allclose(later[name], first[name], rtol=0, atol=1e3 * period * 4e-16 * (2 / slowest) ** 4)


def test_kepler_orbit_runs_back() -> None:
    start = {"x_0": 0.3, "y_0": -1.1, "x_dot_0": 0.7, "y_dot_0": 0.2}
    end = {f"{name}_0": float(value) for name, value in KeplerOrbit.exact(7.3, **start).items()}
    back = KeplerOrbit.exact(-7.3, **end)
    for name, value in back.items():
        assert value == pytest.approx(start[f"{name}_0"], abs=1e-13)  # a phase of 10, amplified by about ten


def test_kepler_orbit_far_out_on_a_hyperbola() -> None:
    exact = KeplerOrbit.exact(np.array([1e3, 1e9]), y_dot_0=2.0)
    speed = np.hypot(exact["x_dot"], exact["y_dot"])
    distance = np.hypot(exact["x"], exact["y"])
    np.testing.assert_allclose(speed**2 / 2 - 1 / distance, 1.0, rtol=1e-14)  # energy; a few roundings
