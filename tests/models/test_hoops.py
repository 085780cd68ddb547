"""Hoops of any shape: geometry, M eq. 61-67, Newton's law by hand, and the FMUs against one another and closed forms.

A point of the hoop's plane is a complex number; the curves and their derivatives by the parameter u are written down
by hand, arc lengths come from SciPy, and ' = d/dξ is a difference quotient along the arc.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from on_paper import algebra
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipeinc

from liaisons.check import max_error
from liaisons.cosim import Result, System, simulate
from liaisons.language import Coordinate, Mechanism, Parameter
from liaisons.mechanics import Equations, derive
from liaisons.models import CircularHoop, Ramp
from liaisons.models.elliptic_hoop import EllipticHoop
from liaisons.models.fourier_hoop import FourierHoop
from liaisons.models.hoop import Hoop
from liaisons.models.parametrised_hoop import ParametrisedHoop

State = dict[str, float]
Curve = Callable[[Any], tuple[Any, Any, Any]]  # u, one or many -> OP, dOP/du, d²OP/du²
Values = dict[str, Any]

COEFFICIENTS = [f"{wave}_{k}" for wave in ("cos", "sin") for k in range(1, 5)]
HOOPS = [CircularHoop, EllipticHoop, FourierHoop]
TURN = 2 * np.pi


def circle(n: State) -> Curve:
    """By the arc length."""

    def curve(xi: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        out = np.exp(1j * xi / n["radius"])
        return n["offset"] + n["radius"] * out, 1j * out, -out / n["radius"]

    return curve


def ellipse(n: State) -> Curve:
    a, b, centre = n["semi_axis_a"], n["semi_axis_b"], n["centre_x"] + 1j * n["centre_y"]

    def curve(u: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        radius = a * np.cos(u) + 1j * b * np.sin(u)
        return centre + radius, -a * np.sin(u) + 1j * b * np.cos(u), -radius

    return curve


def fourier(n: State) -> Curve:
    k = np.arange(1, 5)
    amplitude = np.array([n[f"cos_{i}"] - 1j * n[f"sin_{i}"] for i in k])

    def curve(u: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        waves = amplitude * np.exp(1j * np.multiply.outer(u, k))
        r, dr, ddr = (n["radius"] * np.sum((1j * k) ** order * waves, axis=-1).real for order in range(3))
        r = r + n["radius"]
        out = np.exp(1j * u)
        return r * out, (dr + 1j * r) * out, (ddr + 2j * dr - r) * out

    return curve


CURVES: dict[type[Hoop], Callable[[State], Curve]] = {
    CircularHoop: circle,
    EllipticHoop: ellipse,
    FourierHoop: fourier,
}


@pytest.fixture
def states(random_states) -> Callable[..., Iterator[tuple[State, Curve]]]:
    """Random states of a hoop that goes round O, with its curve."""

    def tame(equations: Equations, count: int = 20, **fixed: float) -> Iterator[tuple[State, Curve]]:
        component = type(equations.mechanism)
        assert issubclass(component, Hoop)
        for n in random_states(equations, count, **fixed):
            for name in ("centre_x", "centre_y", *COEFFICIENTS):
                if name in n:
                    n[name] *= 0.1 if component is EllipticHoop else 0.05
            yield n, CURVES[component](n)

    return tame


def unloaded(equations: Equations) -> State:
    return {name: 0.0 for name in equations.symbols if name.endswith(("_load", "_force"))}


def parameter(n: State) -> tuple[float, float]:
    """u and its rate, whatever the hoop calls it."""
    name = next(name for name in ("u", "theta", "xi") if name in n)
    return n[name], n[f"{name}_dot"]


def p_xi_of(equations: Equations) -> ca.SX:
    m = equations.mechanism
    return equations.momenta[0] if isinstance(m, CircularHoop) else m.p_xi


# ---- geometry: arc length, angle, length, area -------------------------------------------------------------------


def outputs(component: type[ParametrisedHoop], n: State, u: np.ndarray, *names: str) -> list[np.ndarray]:
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


ROUND = dict.fromkeys(COEFFICIENTS, 0.0) | {"radius": 1.0}
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
def test_arc_length_of_a_fourier_hoop_is_the_adaptive_quadrature(n: State) -> None:
    curve = fourier(ROUND | n)
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
    np.testing.assert_allclose(at_A, 0, atol=1e-14)  # the root's
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


def test_a_curve_alone_makes_a_hoop(states) -> None:
    u = np.linspace(-10, 10, 101)
    names = ("xi", "hoop_length", "hoop_area")
    for own, given in zip(
        outputs(Egg, {"bulge": 0.4}, u, *names), outputs(FourierHoop, {"cos_1": 0.4}, u, *names), strict=True
    ):
        np.testing.assert_allclose(own, given, rtol=0, atol=2e-14 * 10)  # roundings of the quadrature
    egg, series = derive(Egg), derive(FourierHoop)
    for n, _ in states(series, **(dict.fromkeys(COEFFICIENTS, 0.0) | {"cos_1": 8.0})):  # 0.05 * 8
        same = {name.replace("theta", "u"): value for name, value in n.items() if name not in COEFFICIENTS}
        for quantity in ("accelerations", "momenta", "operator_forces"):
            expected = series.evaluate(quantity, **n)
            assert egg.evaluate(quantity, **same, bulge=0.4) == pytest.approx(expected, rel=1e-12, abs=1e-11)


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
    """d/dξ at u of a function of u: a central difference of order 10 between points that are equally far on the arc."""
    h = 0.005 * abs(curve(u)[1])
    weights = (5 / 6, -5 / 21, 5 / 84, -5 / 504, 1 / 1260)

    def shifted(xi: float) -> float:
        v = u + xi / abs(curve(u)[1])
        for _ in range(6):  # Newton; the arc is short
            v -= (arc(curve, u, v) - xi) / abs(curve(v)[1])
        return v

    points = [(w, shifted(i * h), shifted(-i * h)) for i, w in enumerate(weights, 1)]

    def derivative(f: Callable[[float], float]) -> float:
        return sum(w * (f(ahead) - f(behind)) for w, ahead, behind in points) / h

    return derivative


def r_of(curve: Curve) -> Callable[[float], float]:
    return lambda u: abs(curve(u)[0])


def theta_of(curve: Curve, here: float) -> Callable[[float], float]:
    """θ, counted from where it is now: no jump nearby."""
    return lambda u: np.angle(curve(u)[0] / curve(here)[0])


def a_of(curve: Curve) -> Callable[[float], float]:
    """r² θ' = OP × tangent."""
    return lambda u: (np.conj(curve(u)[0]) * curve(u)[1]).imag / abs(curve(u)[1])


def b_of(curve: Curve) -> Callable[[float], float]:
    """r² r'² = (OP · tangent)²."""
    return lambda u: ((np.conj(curve(u)[0]) * curve(u)[1]).real / abs(curve(u)[1])) ** 2


def quotient(value: object) -> object:
    """Equal up to the difference quotient: h¹⁰ f⁽¹¹⁾/2772 with h = 0.005 rad, and roundings of f/h."""
    return pytest.approx(value, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("component", HOOPS, ids=lambda component: component.__name__)
def test_hoop_has_the_lagrangian_of_equation_61_with_its_dots(component, states, number) -> None:
    """Erratum MA3: M prints ξ for its rate."""
    equations = derive(component)
    m = equations.mechanism
    for n, curve in states(equations, 5):
        u, u_dot = parameter(n)
        d = along_the_arc(curve, u)
        r, r_dash, theta_dash = abs(curve(u)[0]), d(r_of(curve)), d(theta_of(curve, u))
        xi_dot, beta_dot = number(equations, m._xi_dot, n), n["beta_dot"]
        assert xi_dot == algebra(abs(curve(u)[1]) * u_dot)
        bead = (r_dash * xi_dot) ** 2 + r**2 * (theta_dash * xi_dot + beta_dot) ** 2
        L = n["mass"] / 2 * bead + n["hoop_inertia"] / 2 * beta_dot**2
        assert equations.evaluate("kinetic_energy", **n) == quotient(L)
        assert number(equations, p_xi_of(equations), n) == quotient(n["mass"] * (xi_dot + r**2 * theta_dash * beta_dot))


@pytest.mark.parametrize("component", HOOPS, ids=lambda component: component.__name__)
def test_hoop_has_the_hamiltonian_of_equation_62(component, states, number) -> None:
    equations = derive(component)
    for n, curve in states(equations):
        u, _ = parameter(n)
        a, b, mass, inertia = a_of(curve)(u), b_of(curve)(u), n["mass"], n["hoop_inertia"]
        p_xi = number(equations, p_xi_of(equations), n)
        p_beta = a * p_xi + (inertia + mass * b) * n["beta_dot"]
        H = ((inertia + mass * (a**2 + b)) / mass * p_xi**2 - 2 * a * p_xi * p_beta + p_beta**2) / 2
        assert equations.evaluate("energy", **n) == algebra(H / (inertia + mass * b))


@pytest.mark.parametrize("component", HOOPS, ids=lambda component: component.__name__)
def test_k_of_equation_63_is_half_the_effective_mass_times_the_rate_squared(component, states, number) -> None:
    equations = derive(component)
    for n, curve in states(equations):
        u, _ = parameter(n)
        K_Y = (n["hoop_inertia"] + n["mass"] * b_of(curve)(u)) * n["beta_dot"] ** 2 / 2
        assert number(equations, equations.mechanism.K_Y, n) == algebra(K_Y)
        assert equations.evaluate("effective_mass", **n) * n["beta_dot"] ** 2 / 2 == algebra(K_Y)  # M eq. 51


@pytest.fixture
def field(number) -> Callable[..., NDArray]:
    """The dynamic field D_Y in ξ and p_ξ, for any p_ξ and Y, of the component's equations."""

    def at(equations: Equations, n: State, curve: Curve, p: float, Y: float) -> NDArray:
        m = equations.mechanism
        u, _ = parameter(n)
        xi_dot = p / n["mass"] - a_of(curve)(u) * Y
        there = n | {"beta_dot": Y, f"{m.coordinates[0].name}_dot": xi_dot / abs(curve(u)[1])}
        assert number(equations, p_xi_of(equations), there) == algebra(p)
        return np.array([number(equations, m._xi_dot, there), number(equations, m.dot(p_xi_of(equations)), there)])

    return at


@pytest.mark.parametrize("component", HOOPS, ids=lambda component: component.__name__)
def test_the_three_terms_of_equation_52_are_those_of_65_to_67(component, states, field) -> None:
    """At given (ξ, p_ξ) the field is a polynomial of degree 2 in Y; its parts are D_0, H(Y), -X_K, and nothing else."""
    equations = derive(component)
    for n, curve in states(equations, 5, **unloaded(equations)):
        u, _ = parameter(n)
        d, a, b = along_the_arc(curve, u), a_of(curve), b_of(curve)
        p, Y, mass = 1.3, n["beta_dot"], n["mass"]
        still, forth, back, fast = (field(equations, n, curve, p, rate) for rate in (0.0, Y, -Y, 3 * Y))
        lift, drift = (forth - back) / 2, (forth + back) / 2 - still
        assert still == algebra([p / mass, 0])  # 65
        assert lift == quotient([-a(u) * Y, d(a) * p * Y])  # 66
        assert drift == quotient([0, mass / 2 * d(b) * Y**2])  # 67
        assert fast == quotient(still + 3 * lift + 9 * drift)


@pytest.mark.parametrize("component", HOOPS, ids=lambda component: component.__name__)
def test_hoop_moves_whatever_its_own_inertia(component) -> None:
    """M 8.4: I does not appear in the final equations; only the operator feels it."""
    equations = derive(component)
    inertia = equations.mechanism.symbols["hoop_inertia"]
    for expression in (equations.velocities, equations.momentum_rates, equations.accelerations):
        assert not ca.depends_on(ca.simplify(expression), inertia)
    assert ca.depends_on(equations.operator_forces, inertia)


# ---- Newton's law by hand ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("component", HOOPS, ids=lambda component: component.__name__)
def test_motion_and_forces_are_those_of_newton(component, states, number) -> None:
    equations = derive(component)
    q = component.coordinates[0].name
    for n, curve in states(equations):
        u, u_dot = parameter(n)
        position, first, second = (np.exp(1j * n["beta"]) * part for part in curve(u))
        beta_dot, beta_ddot, mass = n["beta_dot"], n["beta_ddot"], n["mass"]
        load = n["bead_x_load"] + 1j * n["bead_y_load"]
        tangent, speed = first / abs(first), abs(first)
        velocity = first * u_dot + 1j * beta_dot * position
        without = second * u_dot**2 + 2j * beta_dot * first * u_dot + (1j * beta_ddot - beta_dot**2) * position
        push = (n[f"{q}_force"] - n[f"{q}_load"]) / speed  # along the tangent, between hoop and bead
        u_ddot = (push - (np.conj(tangent) * (mass * without + load)).real) / (mass * speed)
        acceleration = without + first * u_ddot
        contact = mass * acceleration + load
        torque = n["hoop_inertia"] * beta_ddot + (np.conj(position) * contact).imag
        by_hand = {
            "accelerations": u_ddot,
            "momenta": mass * (np.conj(first) * velocity).real,
            "operator_forces": torque,
        }
        for quantity, expected in by_hand.items():
            # Two orders of evaluation of sums of ten terms, which random states make up to ten times the result.
            assert equations.evaluate(quantity, **n) == pytest.approx(expected, rel=1e-12, abs=1e-11), quantity
        normal = (np.conj(1j * tangent) * mass * acceleration).real
        assert number(equations, equations.mechanism.normal_force, n) == pytest.approx(normal, rel=1e-12, abs=1e-11)
        assert number(equations, p_xi_of(equations), n) == algebra(mass * (np.conj(tangent) * velocity).real)


# ---- FMUs: the same hoop twice -----------------------------------------------------------------------------------


def shaken(fmu, component: type[Mechanism], *, turned_by: float = 0.0, **start: Any) -> Result:
    """The bead while the hoop is turned to and fro, 20 s: everything in M eq. 64 takes part."""

    def beta(t: float) -> tuple[float, float, float]:
        return turned_by + 0.9 * np.sin(1.5 * t), 1.35 * np.cos(1.5 * t), -2.025 * np.sin(1.5 * t)

    reconstruct: Values = {"input_reconstruction": 2}
    return simulate(
        fmu(component), stop_time=20.0, step_size=0.02, tolerance=1e-12, inputs={"beta": beta}, **reconstruct, **start
    )


SHARED = ("xi", "xi_dot", "p_xi", "theta", "bead_x", "bead_y", "K_Y", "normal_force", "beta_force", "energy", "work")


def assert_same_motion(one: Result, other: Result, *, tolerance: float) -> None:
    for name in SHARED:
        scale = max(1.0, float(np.max(np.abs(one[name]))))
        assert max_error(one[name], other[name]) <= tolerance * scale, name


@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_elliptic_hoop_of_equal_axes_is_a_circular_one(fmu, offset: float) -> None:
    circle = shaken(fmu, CircularHoop, radius=1.4, offset=offset, xi_0=0.7, xi_dot_0=0.3, mass=2.0)
    ellipse = shaken(
        fmu, EllipticHoop, semi_axis_a=1.4, semi_axis_b=1.4, centre_x=offset, u_0=0.5, u_dot_0=0.3 / 1.4, mass=2.0
    )
    assert_same_motion(circle, ellipse, tolerance=1e-9)  # two solvers at 1e-12, κ of a hundred over 20 s


@pytest.mark.parametrize(
    ("component", "start", "length", "area"),
    [
        (CircularHoop, {"radius": 1.4}, TURN * 1.4, np.pi * 1.96),
        (EllipticHoop, {"semi_axis_a": 1.4, "semi_axis_b": 1.4}, TURN * 1.4, np.pi * 1.96),
        (EllipticHoop, {}, 8 * ellipeinc(np.pi / 2, 0.75), 2 * np.pi),
        (FourierHoop, {"radius": 1.4}, TURN * 1.4, np.pi * 1.96),
        (FourierHoop, {"sin_2": 0.4}, arc(fourier(ROUND | {"sin_2": 0.4}), 0, TURN), 1.08 * np.pi),
    ],
    ids=["circle", "round ellipse", "ellipse", "round", "bent"],
)
def test_fmu_calculates_length_and_area(fmu, component, start: Values, length: float, area: float) -> None:
    result = simulate(fmu(component), stop_time=0.1, step_size=0.1, record=["hoop_length", "hoop_area"], **start)
    assert result["hoop_length"] == pytest.approx(length, rel=1e-12)  # of the quadrature
    assert result["hoop_area"] == pytest.approx(area, rel=1e-14)  # a few roundings


# ---- FMUs against closed forms and first integrals ---------------------------------------------------------------


def turning(fmu, component: type[Hoop], rate: float, stop_time: float = 50.0, **start: float) -> Result:
    system = System("turning hoop")
    hoop = system.add("hoop", fmu(component), start_values=start)
    operator = system.add("operator", fmu(Ramp), rate=rate)
    system.connect(operator["y"], hoop["beta"])
    return system.simulate(stop_time=stop_time, step_size=0.1, tolerance=1e-10)


ELLIPSES: dict[str, Values] = {
    "swinging": {"u_0": 0.8, "u_dot_0": 0.1},
    "swinging about the far end": {"u_0": 3.5, "u_dot_0": 0.2},
    "going round": {"u_0": 0.8, "u_dot_0": -2.5},
    "upright": {"semi_axis_a": 1.0, "semi_axis_b": 1.7, "u_0": 1.0, "u_dot_0": 0.4, "mass": 2.0},
    "circle": {"semi_axis_a": 1.5, "semi_axis_b": 1.5, "u_0": 1.0, "u_dot_0": 0.4},
}


@pytest.mark.parametrize("start", ELLIPSES.values(), ids=ELLIPSES.keys())
def test_ellipse_about_its_centre_is_a_pendulum_in_its_own_time(fmu, start: Values) -> None:
    result = turning(fmu, EllipticHoop, 1.3, **start)
    exact = EllipticHoop.exact(result.time, beta_dot=1.3, **start)
    for name in ("u", "u_dot", "xi", "xi_dot"):
        assert max_error(result[f"hoop.{name}"], exact[name]) <= 1e-7, name  # κ of a hundred over 50 s
    for name in ("beta_force", "beta_power"):
        assert max_error(result[f"hoop.{name}"], exact[name]) <= 1e-6, name  # forces of 100 N per metre


@pytest.mark.parametrize("rate", [0.0, 1.3])
def test_bead_that_goes_round_a_fourier_hoop_takes_the_time_of_the_quadrature(fmu, rate: float) -> None:
    start = {"theta_0": 0.5, "theta_dot_0": -1.9, **BENT}
    result = turning(fmu, FourierHoop, rate, **start)
    exact = FourierHoop.exact(result.time, beta_dot=rate, **start)
    for name, values in exact.items():
        assert max_error(result[f"hoop.{name}"], values) <= 1e-7, name  # κ of a hundred over 50 s


@pytest.mark.parametrize(
    ("component", "start"),
    [
        (EllipticHoop, {"centre_x": 0.6, "centre_y": -0.3, "u_0": 0.8, "u_dot_0": 0.2}),
        (EllipticHoop, {"centre_x": 0.6, "centre_y": -0.3, "u_0": 0.8, "u_dot_0": 3.0}),
        (FourierHoop, {"theta_0": 1.8, "theta_dot_0": 0.2, **BENT}),
        (FourierHoop, {"theta_0": 1.8, "theta_dot_0": 3.0, **BENT}),
    ],
    ids=["ellipse, swinging", "ellipse, going round", "Fourier, swinging", "Fourier, going round"],
)
def test_constant_rate_keeps_the_jacobi_integral(fmu, component, start: Values) -> None:
    rate = 1.3
    result = turning(fmu, component, rate, **start)
    r_squared = result["hoop.bead_x"] ** 2 + result["hoop.bead_y"] ** 2
    jacobi = result["hoop.xi_dot"] ** 2 / 2 - rate**2 * r_squared / 2
    assert np.ptp(result["hoop.xi_dot"]) > 0.4  # the two terms do exchange something
    assert max_error(jacobi, jacobi[0]) <= 10 * 1e-10 * 50.0  # ten tolerances a second, terms of size 5


@pytest.mark.parametrize("reconstruction", [1, 2], ids=["extrapolate", "interpolate"])
@pytest.mark.parametrize(
    ("component", "start"),
    [(EllipticHoop, {"u_0": 1.0, "u_dot_0": 0.5}), (FourierHoop, {"theta_0": 1.0, "theta_dot_0": 0.5, **BENT})],
    ids=["ellipse", "Fourier"],
)
def test_energy_balance_closes_while_the_operator_works(fmu, component, start: Values, reconstruction: int) -> None:
    inputs = {"beta": lambda t: (np.sin(1.5 * t), 1.5 * np.cos(1.5 * t), -2.25 * np.sin(1.5 * t))}
    mode: Values = {"input_reconstruction": reconstruction}
    result = simulate(fmu(component), stop_time=20.0, step_size=0.05, tolerance=1e-9, inputs=inputs, **mode, **start)
    scale = sum(float(np.max(np.abs(result[name]))) for name in ("work", "kinetic_energy"))
    assert max_error(result["energy_balance"], 0.0) <= 10 * 1e-9 * scale * 20.0  # ten tolerances a second
    assert np.ptp(result["energy"]) > 1e-3 * scale  # work was done


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
