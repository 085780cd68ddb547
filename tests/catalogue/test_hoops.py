"""Hoops of any shape: geometry, M eq. 61-67, Newton's law by hand, and the FMUs against one another and closed forms.

A point of the hoop's plane is a complex number; the curves and their derivatives by the parameter u are written down
by hand, arc lengths come from SciPy, and ' = d/dξ is a difference quotient along the arc.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from hand_derivations import COEFFICIENTS, HOOPS, Curve, ellipse, fourier, on_the_hoop, p_xi, states
from numpy.typing import NDArray
from on_paper import (
    TURN,
    State,
    Values,
    algebra,
    assert_follows,
    cross,
    derivative,
    dot,
    equations_of,
    mechanism,
    operated,
    unloaded,
)
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipeinc

from liaisons.cosim import Result
from liaisons.language import Coordinate, Parameter
from liaisons.models import CircularHoop, Ramp
from liaisons_catalogue.elliptic_hoop import EllipticHoop
from liaisons_catalogue.fourier_hoop import FourierHoop
from liaisons_catalogue.hoop import Hoop
from liaisons_catalogue.parametrised_hoop import ParametrisedHoop

# ---- geometry: arc length, angle, length, area -------------------------------------------------------------------


def outputs(component: type[ParametrisedHoop], n: Values, u: np.ndarray, *names: str) -> list[np.ndarray]:
    """Geometric outputs of a hoop along u."""
    m = component()
    (q,) = (coordinate.name for coordinate in component.coordinates)
    symbols = [m.symbols[p.name] for p in component.parameters]
    function = ca.Function("outputs", [m.symbols[q], *symbols], [getattr(m, name) for name in names])
    columns = function(u[None, :], *(n.get(p.name, p.start) for p in component.parameters))
    return [np.asarray(column).ravel() for column in (columns if len(names) > 1 else [columns])]


@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 0.1, 0.9, 1.0, 1.5, 10.0, 1e3, 1e6])
def test_arc_length_of_an_ellipse_is_legendres_integral_for_any_axes_and_any_number_of_turns(ratio: float) -> None:
    u = np.linspace(-40, 40, 2001)
    n = {"semi_axis_a": ratio, "semi_axis_b": 1.0}
    xi, length = outputs(EllipticHoop, n, u, "xi", "hoop_length")
    if ratio <= 1:
        expected = ellipeinc(u, 1 - ratio**2)
    else:  # from the end of the longer axis on; SciPy's integral wants a positive parameter
        quarter = ellipeinc(np.pi / 2, 1 - ratio**-2)
        expected = ratio * (ellipeinc(u + np.pi / 2, 1 - ratio**-2) - quarter)
    # Roundings of u, times the largest speed, in both.
    np.testing.assert_allclose(xi, expected, rtol=0, atol=40 * 4e-15 * max(ratio, 1))
    quarter = max(ratio, 1) * ellipeinc(np.pi / 2, 1 - min(ratio, 1 / ratio) ** 2)
    assert length[0] == pytest.approx(4 * quarter, rel=1e-13)  # ten roundings of the angle 2π


BENT: Values = {"cos_1": 0.2, "sin_2": -0.1, "cos_3": 0.05, "cos_4": 0.1, "sin_4": 0.1, "radius": 1.3}
SINGLE = {
    "cos_1": 0.8,
    "sin_1": 0.8,
    "cos_2": 0.5,
    "sin_2": -0.5,
    "cos_3": 0.3,
    "sin_3": 0.3,
    "cos_4": 0.2,
    "sin_4": 0.2,
}


def arc(curve: Curve, begin: float, end: float) -> float:
    """Arc length: Gauss's rule of order 10 on pieces of a thousandth of a turn, over which every speed is smooth."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    cuts = np.linspace(begin, end, 2 + int(1000 * abs(end - begin) / TURN))
    half = np.diff(cuts) / 2
    u = cuts[:-1, None] + half[:, None] * (1 + nodes)
    return float(half @ np.abs(curve(u)[1]) @ weights)


@pytest.mark.parametrize("n", [BENT, {}, *({name: value} for name, value in SINGLE.items())], ids=str)
def test_arc_length_of_a_fourier_hoop_is_the_adaptive_quadrature(n: Values) -> None:
    curve = fourier(n)
    u = np.concatenate([np.linspace(-np.pi, np.pi, 33), [-25.0, 3.2, 7.0, 100.0]])
    xi, length, area = outputs(FourierHoop, n, u, "xi", "hoop_length", "hoop_area")
    turn = arc(curve, 0, TURN)
    expected = np.array([turn * (v // TURN) + arc(curve, 0, v % TURN) for v in u])
    # 1e-12 of the length is what the docstring says, for each turn.
    assert np.all(np.abs(xi - expected) <= 1e-12 * turn * np.maximum(1, np.abs(u) / TURN))
    assert length[0] == pytest.approx(turn, rel=1e-12)  # as above
    sector, _ = quad(lambda v: abs(curve(v)[0]) ** 2 / 2, 0, TURN, epsabs=1e-13)
    assert area[0] == pytest.approx(sector, rel=1e-12)  # ten times the quadrature's


@pytest.mark.parametrize("centre", [(0.0, 0.0), (0.7, -0.4), (-1.6, 0.5)])
def test_ellipse_starts_its_arc_at_a_and_does_not_wrap_its_angle(centre: tuple[float, float]) -> None:
    n = {"semi_axis_a": 2.0, "semi_axis_b": 1.0, "centre_x": centre[0], "centre_y": centre[1]}
    curve = ellipse(n)
    u = np.linspace(-20, 20, 4001)
    xi, theta, length, area = outputs(EllipticHoop, n, u, "xi", "theta", "hoop_length", "hoop_area")
    position = np.array([curve(v)[0] for v in u])
    np.testing.assert_allclose(
        np.exp(1j * theta), position / np.abs(position), rtol=0, atol=4e-14
    )  # roundings of u = 20
    assert np.max(np.abs(np.diff(theta))) < 0.2  # not wrapped: steps of 0.01 in u, at no less than 0.05 from O
    assert abs(theta[2000]) < np.pi
    # A is where θ = 0 with OP along the axis; there ξ = 0.
    at_a = brentq(lambda v: curve(v)[0].imag, -np.pi / 2, np.pi / 2, xtol=1e-15)
    assert curve(at_a)[0].real > 0
    at_A = outputs(EllipticHoop, n, np.array([at_a]), "xi", "theta")
    np.testing.assert_allclose(at_A, 0, rtol=0, atol=1e-14)  # the root's
    assert area[0] == pytest.approx(2 * np.pi, rel=1e-15)
    assert xi[-1] - xi[0] == pytest.approx(length[0] * 40 / TURN, abs=length[0])  # not wrapped


class Egg(ParametrisedHoop):
    """r = radius (1 + bulge cos u), with u = θ: what FourierHoop is for cos_1 alone; nothing but the curve is given."""

    radius = Parameter(1.0, "m", "mean radius", above=0)
    bulge = Parameter(0.4, "1", "first harmonic")
    u = Coordinate("rad", "polar angle")

    def curve(self, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        r = self.radius * (1 + self.bulge * ca.cos(u))
        return r * ca.cos(u), r * ca.sin(u)


class Shifted(Egg):
    """A circle off O."""

    offset = Parameter(0.3, "m", "distance of its centre from O")

    def curve(self, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        return self.offset + self.radius * ca.cos(u), self.radius * ca.sin(u)


def test_a_curve_alone_makes_a_hoop() -> None:
    u = np.linspace(-10, 10, 101)
    names = ("xi", "hoop_length", "hoop_area")
    own, given = outputs(Egg, {"bulge": 0.4}, u, *names), outputs(FourierHoop, {"cos_1": 0.4}, u, *names)
    np.testing.assert_allclose(own, given, rtol=0, atol=2e-14 * 10)  # roundings of the quadrature
    for n in states(FourierHoop, **(dict.fromkeys(COEFFICIENTS, 0.0) | {"cos_1": 8.0})):  # 0.05 * 8
        same = {name.replace("theta", "u"): value for name, value in n.items() if name not in COEFFICIENTS}
        egg = State(Egg, same | {"bulge": 0.4})
        for quantity in ("accelerations", "momenta", "operator_forces"):
            assert egg(quantity) == pytest.approx(n(quantity), rel=1e-12, abs=1e-11)


def test_a_curve_that_is_not_star_shaped_is_refused() -> None:
    """Pascal's limaçon has a loop round O for bulge > 1: there OP turns back."""
    margin = ca.Function("margin", [(m := Egg()).radius, m.bulge], [m.star_shaped])
    assert float(margin(1, 0.9)) > 0
    assert float(margin(1, -0.9)) > 0
    outside = ca.Function("margin", [(s := Shifted()).radius, s.offset], [s.star_shaped])
    assert float(outside(1, 0.3)) > 0  # O inside the circle
    assert float(outside(1, 3)) < 0  # and outside of it


# ---- M eq. 61-67 with r, θ as functions of the arc length --------------------------------------------------------


def along_the_arc(curve: Curve, u: float) -> Callable[[Callable[[float], float]], float]:
    """d/dξ at u of a function of u: a central difference between points that are equally far on the arc."""
    speed = abs(curve(u)[1])

    def shifted(xi: float) -> float:
        v = u + xi / speed
        for _ in range(6):  # Newton; the arc is short
            v -= (arc(curve, u, v) - xi) / abs(curve(v)[1])
        return v

    return lambda f: derivative(lambda xi: f(shifted(xi)), 0.0, 0.005 * speed)


def a_of(curve: Curve) -> Callable[[float], float]:
    """r² θ' = OP × tangent."""
    return lambda u: cross(*curve(u)[:2]) / abs(curve(u)[1])


def b_of(curve: Curve) -> Callable[[float], float]:
    """r² r'² = (OP · tangent)²."""
    return lambda u: (dot(*curve(u)[:2]) / abs(curve(u)[1])) ** 2


def quotient(value: object) -> object:
    """Equal up to the difference quotient: h¹⁰ f⁽¹¹⁾/2772 with h = 0.005 rad, and roundings of f/h."""
    return pytest.approx(value, rel=1e-10, abs=1e-10)


every_hoop = pytest.mark.parametrize("component", HOOPS)


@every_hoop
def test_hoop_has_the_lagrangian_of_equation_61_with_its_dots(component) -> None:
    """Erratum MA3: M prints ξ for its rate."""
    for n in states(component, 5):
        curve, u, u_dot = on_the_hoop(n)
        d, place = along_the_arc(curve, u), curve(u)[0]
        r, r_dash = abs(place), d(lambda v, curve=curve: abs(curve(v)[0]))
        theta_dash = d(lambda v, curve=curve, here=place: np.angle(curve(v)[0] / here))  # no jump nearby
        xi_dot = n("_xi_dot")
        assert xi_dot == algebra(abs(curve(u)[1]) * u_dot)
        bead = (r_dash * xi_dot) ** 2 + r**2 * (theta_dash * xi_dot + n.beta_dot) ** 2
        assert n("kinetic_energy") == quotient(n.mass / 2 * bead + n.hoop_inertia / 2 * n.beta_dot**2)
        assert n(p_xi(component)) == quotient(n.mass * (xi_dot + r**2 * theta_dash * n.beta_dot))


@every_hoop
def test_hoop_has_the_hamiltonian_of_equation_62_and_k_of_equation_63(component) -> None:
    """K_Y is half the effective mass times the rate squared (M eq. 51)."""
    for n in states(component):
        curve, u, _ = on_the_hoop(n)
        a, b, p = a_of(curve)(u), b_of(curve)(u), n(p_xi(component))
        moved = n.hoop_inertia + n.mass * b
        p_beta = a * p + moved * n.beta_dot
        H = ((moved + n.mass * a**2) / n.mass * p**2 - 2 * a * p * p_beta + p_beta**2) / 2
        assert n("energy") == algebra(H / moved)
        assert n("K_Y") == algebra(moved * n.beta_dot**2 / 2)
        assert n("effective_mass") == algebra(moved)


def field(n: State, p: float, Y: float) -> NDArray:
    """The dynamic field D_Y in ξ and p_ξ, for any p_ξ and Y, of the component's equations."""
    curve, u, _ = on_the_hoop(n)
    xi_dot = p / n.mass - a_of(curve)(u) * Y
    there = n | {"beta_dot": Y, f"{n.component.coordinates[0].name}_dot": xi_dot / abs(curve(u)[1])}
    momentum = p_xi(n.component)
    assert there(momentum) == algebra(p)
    return np.array([there("_xi_dot"), there(mechanism(n.component).dot(momentum))])


@every_hoop
def test_the_three_terms_of_equation_52_are_those_of_65_to_67(component) -> None:
    """At given (ξ, p_ξ) the field is a polynomial of degree 2 in Y; its parts are D_0, H(Y), -X_K, and nothing else."""
    for n in states(component, 5, **unloaded(component)):
        curve, u, _ = on_the_hoop(n)
        d, a, b = along_the_arc(curve, u), a_of(curve), b_of(curve)
        p, Y, mass = 1.3, n.beta_dot, n.mass
        still, forth, back, fast = (field(n, p, rate) for rate in (0.0, Y, -Y, 3 * Y))
        lift, drift = (forth - back) / 2, (forth + back) / 2 - still
        assert still == algebra([p / mass, 0])  # 65
        assert lift == quotient([-a(u) * Y, d(a) * p * Y])  # 66
        assert drift == quotient([0, mass / 2 * d(b) * Y**2])  # 67
        assert fast == quotient(still + 3 * lift + 9 * drift)


@every_hoop
def test_hoop_moves_whatever_its_own_inertia(component) -> None:
    """M 8.4: I does not appear in the final equations; only the operator feels it."""
    equations = equations_of(component)
    inertia = equations.mechanism.symbols["hoop_inertia"]
    for expression in (equations.velocities, equations.momentum_rates, equations.accelerations):
        assert not ca.depends_on(ca.simplify(expression), inertia)
    assert ca.depends_on(equations.operator_forces, inertia)


# ---- FMUs: the same hoop twice -----------------------------------------------------------------------------------


def test_length_and_area_of_a_circle() -> None:
    for n in states(CircularHoop, 3):
        assert n("hoop_length") == pytest.approx(TURN * n.radius, rel=1e-14)  # a few roundings
        assert n("hoop_area") == pytest.approx(np.pi * n.radius**2, rel=1e-14)


# ---- FMUs against closed forms and first integrals ---------------------------------------------------------------


def turning(fmu, component: type[Hoop], rate: float, start: Values) -> Result:
    return operated(fmu, component, "beta", Ramp, start, rate=rate).simulate(50.0, 0.1, tolerance=1e-10)


CIRCLE: Values = {"xi_0": 1.0, "mass": 2.0, "radius": 1.4, "offset": 0.6}
TURNING: dict[str, tuple[type[Hoop], float, Values]] = {
    "circle, swinging": (CircularHoop, 2.0, CIRCLE | {"xi_dot_0": 0.3}),
    "circle, going round": (CircularHoop, 2.0, CIRCLE | {"xi_dot_0": -4.0}),
    "ellipse, swinging": (EllipticHoop, 1.3, {"u_0": 0.8, "u_dot_0": 0.1}),
    "ellipse, swinging about the far end": (EllipticHoop, 1.3, {"u_0": 3.5, "u_dot_0": 0.2}),
    "ellipse, going round": (EllipticHoop, 1.3, {"u_0": 0.8, "u_dot_0": -2.5}),
    "ellipse, upright": (
        EllipticHoop,
        1.3,
        {"semi_axis_a": 1.0, "semi_axis_b": 1.7, "u_0": 1.0, "u_dot_0": 0.4, "mass": 2.0},
    ),
    "round ellipse": (EllipticHoop, 1.3, {"semi_axis_a": 1.5, "semi_axis_b": 1.5, "u_0": 1.0, "u_dot_0": 0.4}),
    "bent": (FourierHoop, 1.3, {"theta_0": 0.5, "theta_dot_0": -1.9, **BENT}),
    "bent, at rest": (FourierHoop, 0.0, {"theta_0": 0.5, "theta_dot_0": -1.9, **BENT}),
}


@pytest.mark.parametrize("name", TURNING)
def test_hoop_at_constant_rate_follows_its_closed_form_with_torque_and_power(fmu, name: str) -> None:
    component, rate, start = TURNING[name]
    result = turning(fmu, component, rate, start)
    exact: Values = component.exact(result.time, beta_dot=rate, **start)  # type: ignore[attr-defined]
    forces = [name for name in exact if name.endswith(("_force", "_power"))]  # of 100 N per metre
    assert_follows(result, exact, 1e-7, "it.", exact.keys() - forces)  # κ of a hundred over 50 s
    assert_follows(result, {name: exact[name] for name in forces}, 1e-6, "it.")


# ---- bad input ---------------------------------------------------------------------------------------------------


def test_radius_that_vanishes_between_two_samples_is_refused() -> None:
    """The bound behind the condition: no hoop with r <= 0 somewhere passes, wherever its narrowest place lies."""
    m = FourierHoop()
    symbols = [m.symbols[name] for name in ("radius", *COEFFICIENTS)]
    margin = ca.Function("margin", symbols, [m.star_shaped])
    random = np.random.default_rng(7)
    fine = np.linspace(0, TURN, 20_000)
    k = np.arange(1, 5)
    least_refused = 1.0
    for _ in range(300):
        z = random.normal(size=4) + 1j * random.normal(size=4)
        waves = (z[:, None] * np.exp(1j * np.outer(k, fine))).real.sum(0)
        z *= random.uniform(0.9, 1.05) / -waves.min()  # least r between -0.05 and 0.1
        least = 1 + (z[:, None] * np.exp(1j * np.outer(k, fine))).real.sum(0).min()
        accepted = float(margin(1.0, *z.real, *-z.imag)) > 0
        assert not (accepted and least <= 0)
        if accepted:
            least_refused = min(least_refused, least)
    assert least_refused < 0.03  # and the bound is no larger than it must be: h²/8 · Σ k² |z_k| = 0.0012 · 20
