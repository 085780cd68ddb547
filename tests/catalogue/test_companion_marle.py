"""Numbers, hypotheses and remarks of M against calculations by hand."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from on_paper import algebra, equations_of
from scipy.integrate import quad, solve_ivp

from liaisons.errors import ComponentError
from liaisons.language import ActiveCoordinate, Coordinate, Mechanism, Parameter, unchecked
from liaisons.models import CartesianPendulum, DoublePendulum, Pendulum
from liaisons_motion import analysis

M, G = 0.7, 9.1
BODY: dict[str, Any] = {"mass": M, "gravity": G}


# ---- M 3.1: sections, rates of the liaisons ----------------------------------------------------------------------


def test_rod_and_plane_are_a_submersion_whose_rates_any_momentum_keeps() -> None:
    """M eq. 2, 3, 35: dπ = (d/|d|, e_y) has rank 2; x' = p/m but for what dπ prescribes, dπ·x' = σ'."""
    equations, rng = equations_of(CartesianPendulum), np.random.default_rng(8)
    C = analysis.Quantity(equations, equations.constraints.matrix)
    for x, z, sigma_dot, *p in rng.normal(size=(5, 6)):
        rod = np.hypot(x, z - 1)
        along, e_y = np.array([x, 0, z - 1]) / rod, np.array([0, 1, 0])
        slopes = C.evaluate(x=x, z=z, rod=rod)
        assert np.linalg.matrix_rank(slopes) == 2
        assert slopes == algebra(np.array([e_y, along]))
        momenta = dict(zip(("p_x", "p_y", "p_z"), p, strict=True))
        v = np.array(p) / M
        v += (sigma_dot - v @ along) * along - v @ e_y * e_y
        velocities = equations.evaluate("velocities", x=x, z=z, rod=rod, rod_dot=sigma_dot, mass=M, **momenta)
        assert velocities == algebra(v, 1e-11)  # a linear system of two equations


def test_any_section_has_the_same_action_on_space_time_and_on_configurations() -> None:
    """M eq. 4: I of θ = 0.4 + 0.9 sin 2t, l = 1 + 0.2 cos 3t, no motion, in (θ, l), in (x, y, z), and by quadrature."""
    t, height = np.linspace(0, 1.7, 1601), 0.3

    def section(t: Any) -> tuple[Any, ...]:
        return 0.4 + 0.9 * np.sin(2 * t), 1.8 * np.cos(2 * t), 1 + 0.2 * np.cos(3 * t), -0.6 * np.sin(3 * t)

    def lagrangian(t: float) -> float:
        theta, rate, rod, rod_rate = section(t)
        return M / 2 * (rod_rate**2 + (rod * rate) ** 2) + M * G * rod * np.cos(theta)

    theta, rate, rod, rod_rate = section(t)
    sine, cosine, still = np.sin(theta), np.cos(theta), 0 * t
    adapted = {"theta": theta, "theta_dot": rate, "length": rod, "length_dot": rod_rate}
    free = {"x": rod * sine, "y": still, "z": height - rod * cosine, "y_dot": still}
    free |= {"x_dot": rod_rate * sine + rod * rate * cosine, "z_dot": -rod_rate * cosine + rod * rate * sine}
    expected = quad(lagrangian, 0, 1.7, epsabs=1e-13)[0]
    # Cubic interpolation: h⁴/384 = 3e-15 times forces of 20 N and fourth derivatives of 1e3 /s⁴.
    assert analysis.action(Pendulum, t, adapted, **BODY).action == pytest.approx(expected, abs=1e-10)
    lower = analysis.action(CartesianPendulum, t, free, height=height, **BODY).action + M * G * height * 1.7
    assert lower == pytest.approx(expected, abs=1e-10)


# ---- M 5: the hypothesis, and motion where s is a function of time -----------------------------------------------


def test_a_metric_whose_active_block_is_invertible_may_bind_the_operator() -> None:
    """M 5, remark 3: of an indefinite metric not g_αβ but g^αβ has to be invertible; here g_22 = 1 and g²² = 0."""
    metric = np.array([[0.0, 1.0], [1.0, 1.0]])
    assert np.linalg.inv(metric)[1, 1] == 0.0 != metric[1, 1]
    with pytest.raises(ComponentError, match=r"x_1_dot is multiplied by rates of active coordinates alone.*M eq\. 39"):

        class Indefinite(Mechanism):
            mass = Parameter(1.0, "kg", "mass", above=0)
            x_1 = Coordinate("m", "free")
            x_2 = ActiveCoordinate("m", "prescribed")

            def kinetic_energy(self) -> ca.SX:
                v_1, v_2 = self.dot(self.x_1), self.dot(self.x_2)
                return self.mass * (v_1 * v_2 + v_2**2 / 2)


def shaken(t: Any, y: NDArray) -> list[float]:
    """(θ', p_θ') of a rod of length 1 + 0.1 sin 2t whose pivot is at x = 0.2 cos 3t, by Newton's law."""
    theta, p = y
    rod, rod_dot, speed = 1 + 0.1 * np.sin(2 * t), 0.2 * np.cos(2 * t), -0.6 * np.sin(3 * t)
    theta_dot = (p / (M * rod) - speed * np.cos(theta)) / rod
    pull = speed * (rod_dot * np.cos(theta) - rod * theta_dot * np.sin(theta))
    return [theta_dot, M * (pull - G * rod * np.sin(theta))]


def test_motion_under_a_given_sigma_is_canonical() -> None:
    """M 5, end: σ*(D) on σ*(V*M): the flow from Newton's law, with Jᵀ Ω J = Ω, which a p'-part of -γp would shrink."""
    drives: Any = {"length": lambda t: 1 + 0.1 * ca.sin(2 * t), "pivot_x": lambda t: 0.2 * ca.cos(3 * t)}
    flow = analysis.flow(Pendulum, 1.5, theta=0.8, p_theta=-0.5, **drives, **BODY)

    def end(*start: float) -> NDArray:
        return solve_ivp(shaken, (0, 1.5), start, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    assert list(flow.state.values()) == pytest.approx(end(0.8, -0.5), abs=1e-9)  # two integrations, amplified tenfold
    size = 1e-4
    J = [(end(0.8 + size, -0.5) - end(0.8 - size, -0.5)), end(0.8, -0.5 + size) - end(0.8, -0.5 - size)]
    np.testing.assert_allclose(flow.jacobian, np.transpose(J) / (2 * size), rtol=0, atol=1e-6)  # differences: size²
    two = analysis.flow(DoublePendulum, 0.8, theta_1=0.7, theta_2_dot=1.1, pivot_x=drives["pivot_x"]).jacobian
    omega = np.kron([[0, 1], [-1, 0]], np.eye(2))
    np.testing.assert_allclose(two.T @ omega @ two, omega, rtol=0, atol=1e-8)  # products of entries of 100


# ---- M 6: Poisson's tensor, automorphisms, charts ----------------------------------------------------------------


def test_poisson_tensor_has_its_sign_and_knows_nothing_of_the_active_coordinates() -> None:
    """M eq. 49: Λ = ∂/∂p ∧ ∂/∂x, so that {p, x} = +1, {H, x} = x', and functions of s have no bracket."""
    formulas = (lambda m: m.momentum(m.theta), lambda m: m.theta, lambda m: m.length)
    p, x, s = (analysis.observable(Pendulum, formula) for formula in formulas)
    for (u, v), expected in {(p, x): 1.0, (x, p): -1.0, (s, p): 0.0, (s, x): 0.0}.items():
        assert analysis.poisson_bracket(u, v).evaluate(theta=0.3, length=2.0) == expected
    rate = analysis.poisson_bracket(analysis.hamiltonian(p.equations), x)
    assert rate.evaluate(theta=0.3, p_theta=1.4, length=2.0, mass=M) == algebra(1.4 / (M * 4))


def test_the_dynamic_field_moves_the_pendulum_and_without_the_operator_stays_on_its_leaf() -> None:
    """M 6, proposition: D_Y = (θ', Y, p_θ') by Newton's law, with all of K_Y; D_0 has no part along s."""
    theta, p, rod = 0.6, 1.3, 1.4
    state = {"theta": theta, "p_theta": p, "length": rod, **BODY}
    rod_dot, x_dot, z_dot = Y = np.array([0.5, -0.8, 0.3])
    sine, cosine = np.sin(theta), np.cos(theta)
    theta_dot = p / (M * rod**2) - (x_dot * cosine + z_dot * sine) / rod
    pull = x_dot * (rod_dot * cosine - rod * theta_dot * sine) + z_dot * (rod_dot * sine + rod * theta_dot * cosine)
    D = analysis.dynamic_field(Pendulum)
    moved = D.evaluate(**state, length_dot=rod_dot, pivot_x_dot=x_dot, pivot_z_dot=z_dot)
    assert moved == algebra([theta_dot, *Y, M * (pull - G * rod * sine)])
    assert D.evaluate(**state) == algebra([p / (M * rod**2), 0, 0, 0, -M * G * rod * sine])


class Direct(Mechanism):
    """A metric and a potential in w = x, with a prescribed s."""

    x = Coordinate("m", "free", start=0.3)
    s = ActiveCoordinate("m", "prescribed", start=0.7)

    def w(self) -> ca.SX:
        return self.x

    @unchecked("made of bare numbers")
    def kinetic_energy(self) -> ca.SX:
        w, rate = self.dot(self.w()), self.dot(self.s)
        return (w**2 + ca.cos(self.w()) * w * rate + 2 * rate**2) / 2

    @unchecked("made of bare numbers")
    def potential_energy(self) -> ca.SX:
        return ca.sin(self.w()) * self.s


class Skew(Direct):
    """The same, in a chart that moves with s: w = x + s²/2."""

    def w(self) -> ca.SX:
        return self.x + self.s**2 / 2


def test_three_terms_are_the_same_vectors_in_any_chart_but_not_the_local_decomposition() -> None:
    """M 6, remark, and 7: x = w - s²/2 takes (w', s', p') to (w' - s s', s', p')."""
    w, s, p, Y = 0.9, 0.7, 1.1, -1.3
    fields = analysis.dynamic_field(Direct), analysis.dynamic_field(Skew)
    states = [{"x": x, "s": s, "p_x": p, "s_dot": Y} for x in (w, w - s**2 / 2)]
    change = np.array([[1, -s, 0], [0, 1, 0], [0, 0, 1]])
    for term in ("frozen", "energy", "lift"):
        direct, skew = (getattr(field, term).evaluate(**state) for field, state in zip(fields, states, strict=True))
        assert skew == algebra(change @ direct)
        assert np.abs(direct).max() > 0.1
    # The local one is Y ∂/∂s and a Hamiltonian field along the leaf, where the change is the identity.
    direct, skew = (
        analysis.hamilton_equations(chart).evaluate(**state)
        for chart, state in zip((Direct, Skew), states, strict=True)
    )
    assert skew - direct == algebra([-s * Y, 0])


# ---- M 7: the dynamic connection ---------------------------------------------------------------------------------


def test_two_properties_leave_one_dynamic_connection() -> None:
    """M 7, proposition: orthogonal to the fibre, an automorphism, tangent to p = 0.

    The first says what x' = v(x) is.  Then Jᵀ Ω + Ω J = 0 says p' = c - (∂v/∂x)ᵀ p, with c(x, s) = 0 by the last.
    """
    lift, equations = analysis.dynamic_field(DoublePendulum).lift, equations_of(DoublePendulum)
    body = {"mass_1": 0.7, "mass_2": 1.9, "length_2": 1.3}
    Y = {"pivot_x_dot": 0.8, "pivot_z_dot": -0.5}
    theta, p = np.array([0.6, -0.9]), np.array([1.1, -0.7])

    def lifted(theta: NDArray, p: NDArray) -> NDArray:
        state = dict(zip(("theta_1", "theta_2", "p_theta_1", "p_theta_2"), [*theta, *p], strict=True))
        return lift.evaluate(**state, **Y, **body)

    v, w = lifted(theta, p)[:2], lifted(theta, p)[-2:]
    assert lifted(theta, p)[2:4] == algebra([0.8, -0.5])
    angles = {f"theta_{i}{end}": value[i - 1] for end, value in (("", theta), ("_dot", v)) for i in (1, 2)}
    assert equations.evaluate("momenta", **angles, **Y, **body) == algebra([0, 0])
    h = 1e-5  # central differences: h² and roundings over h
    slopes = [(lifted(theta + h * e, p)[:2] - lifted(theta - h * e, p)[:2]) / (2 * h) for e in np.eye(2)]
    np.testing.assert_allclose(w, -np.array(slopes) @ p, rtol=0, atol=1e-9)
    assert lifted(theta, 0 * p)[-2:] == algebra([0, 0])
    assert np.abs(w).min() > 0.1
