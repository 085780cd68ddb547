"""Numbers of K against calculations by hand, with masses, frequencies and stiffnesses that differ from 1."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from on_paper import algebra, equations_of
from scipy.linalg import expm

from liaisons.check import slope
from liaisons.errors import ComponentError
from liaisons.language import Coordinate, Gravity, Mechanism, Parameter, constraint, point
from liaisons.models import CartesianPendulum, DoublePendulum, NoseHooverOscillator, Oscillator, Pendulum
from liaisons_motion import analysis

FLOW = 1e-9  # integration at tolerance 1e-11, amplified less than a hundredfold
M, K, GAMMA = 0.7, 3.1, 0.4
BODY: dict[str, Any] = {"mass": M, "stiffness": K, "damping": GAMMA}
A = np.array([[0, 1 / M], [-K, -GAMMA]])  # X' = A X for X = (x, p)


# ---- K 2.1: statics ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.4, -1.1])
def test_at_rest_on_its_rod_a_bob_stays_where_the_forces_do_no_virtual_work(angle: float) -> None:
    """K eq. 5 without accelerations, Σ F·δr = 0: δr lies across the rod, F = m (g tan θ, 0, -g)."""
    m, g, rod = 1.7, 9.1, 1.3
    state = {"x": rod * np.sin(angle), "z": 1 - rod * np.cos(angle), "rod": rod, "mass": m, "gravity": g}
    equations, push = equations_of(CartesianPendulum), m * g * np.tan(angle)
    assert equations.evaluate("accelerations", x_force=push, **state) == algebra(np.zeros(3), 1e-11)  # 2 x 2 system
    assert equations.evaluate("operator_forces", x_force=push, **state) == algebra(-m * g / np.cos(angle), 1e-11)
    falling = push / m * np.cos(angle) ** 2 * np.array([-1, 0, -np.tan(angle)])  # -g sin θ across the rod
    assert equations.evaluate("accelerations", **state) == algebra(falling, 1e-11)


# ---- K 2.4: three bodies -----------------------------------------------------------------------------------------

BODIES = range(1, 4)


class ThreeBodies(Mechanism):
    """Three masses that attract each other, and a weight along z that breaks symmetries."""

    mass_1, mass_2, mass_3 = (Parameter(m, "kg", "mass", above=0) for m in (0.7, 1.9, 3.1))
    G = Parameter(1.3, "N.m2/kg2", "constant of gravitation")
    weight = Parameter(0.0, "m/s2", "uniform gravity along -z")
    x_1, y_1, z_1 = (Coordinate("m", "position", start=start) for start in (1.0, 0.0, 0.2))
    x_2, y_2, z_2 = (Coordinate("m", "position", start=start) for start in (-0.5, 0.9, 0.0))
    x_3, y_3, z_3 = (Coordinate("m", "position", start=start) for start in (-0.4, -1.1, -0.3))

    def position(self, body: int) -> ca.SX:
        return ca.vertcat(*(self.symbols[f"{axis}_{body}"] for axis in "xyz"))

    def mass(self, body: int) -> ca.SX:
        return self.symbols[f"mass_{body}"]

    def kinetic_energy(self) -> ca.SX:
        return ca.SX(sum(self.mass(i) / 2 * ca.sumsqr(self.dot(self.position(i))) for i in BODIES))

    def potential_energy(self) -> ca.SX:
        pairs = combinations(BODIES, 2)
        attraction = sum(
            self.G * self.mass(i) * self.mass(j) / ca.norm_2(self.position(i) - self.position(j)) for i, j in pairs
        )
        return ca.SX(sum(self.mass(i) * self.weight * self.symbols[f"z_{i}"] for i in BODIES)) - attraction


def turn(n: NDArray) -> Any:
    """δr_α = n × r_α (K eq. 48), of all bodies alike."""

    def field(m: Any) -> dict[str, ca.SX]:
        shifts = (ca.vertsplit(ca.cross(ca.SX(n), m.position(body))) for body in BODIES)
        return {
            f"{axis}_{body}": part
            for body, parts in zip(BODIES, shifts, strict=True)
            for axis, part in zip("xyz", parts, strict=True)
        }

    return field


def test_bodies_that_attract_each_other_keep_momentum_angular_momentum_and_energy() -> None:
    """K eq. 44-51: P = Σ m_α v_α and n·L = n·Σ r_α × m_α v_α for any n, each with a mass of its own; 30 and 44."""
    n, masses, rng = np.array([0.3, -0.8, 0.5]), np.array([0.7, 1.9, 3.1]), np.random.default_rng(6)
    shift = analysis.noether(ThreeBodies, lambda _: {f"y_{body}": 1.0 for body in BODIES})
    moment = analysis.noether(ThreeBodies, turn(n))
    energy = analysis.observable(ThreeBodies, lambda m: m.kinetic_energy() + m.potential_energy())
    for r, v in rng.normal(size=(5, 2, 3, 3)):
        state = {
            f"{axis}_{body}{end}": values[body - 1, i]
            for values, end in ((r, ""), (v, "_dot"))
            for body in BODIES
            for i, axis in enumerate("xyz")
        }
        assert moment.evaluate(**state) == algebra(n @ (masses @ np.cross(r, v)))
        assert shift.evaluate(**state) == algebra(masses @ v[:, 1])
        force = np.abs(equations_of(ThreeBodies).evaluate("momentum_rates", **state)).max()
        for quantity in (moment, shift, energy):
            # Forces cancel in pairs, their moments and powers too: roundings of the largest.
            assert quantity.time_derivative().evaluate(**state) == pytest.approx(0, abs=1e-13 * (1 + force))


def test_in_a_uniform_weight_three_bodies_keep_angular_momentum_about_the_vertical_alone() -> None:
    """K eq. 52: n·L for n along the weight."""
    state = {"weight": 9.81, "x_1_dot": 0.4, "y_3_dot": -0.9, "z_2_dot": 1.2}
    vertical = analysis.noether(ThreeBodies, turn(np.array([0.0, 0.0, 1.0])), weight=9.81)
    assert vertical.evaluate(**state) == algebra(3.1 * -0.4 * -0.9)
    with pytest.raises(ComponentError, match="is no symmetry"):
        analysis.noether(ThreeBodies, turn(np.array([1.0, 0.0, 0.0])), weight=9.81)


# ---- K 2.6: friction and the direction of time -------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [0.0, GAMMA])
def test_only_without_friction_a_motion_runs_backwards_to_its_start(gamma: float) -> None:
    """K eq. 62 under t → -t: with R = diag(1, -1), R e^(At) R e^(At) = 1 for γ = 0 alone."""
    t, R, start = 1.3, np.diag([1.0, -1.0]), np.array([0.8, -0.5])
    forth = analysis.flow(Oscillator, t, x=0.8, p_x=-0.5, mass=M, stiffness=K, damping=gamma)
    back = analysis.flow(Oscillator, t, x=forth.state["x"], p_x=-forth.state["p_x"], mass=M, stiffness=K, damping=gamma)
    ended = R @ list(back.state.values())
    motion = expm(np.array([[0, 1 / M], [-K, -gamma]]) * t)
    np.testing.assert_allclose(ended, R @ motion @ R @ motion @ start, rtol=0, atol=FLOW)
    assert (np.abs(ended - start).max() < FLOW) == (gamma == 0)


# ---- K 3.3: rates of what depends on time ------------------------------------------------------------------------


def test_rate_of_a_quantity_that_depends_on_time_is_more_than_its_bracket() -> None:
    """K eq. 86, 88: d(lθ)/dt = l'θ + lθ'; {H, lθ} = lθ' = 0.5 lacks ∂(lθ)/∂t = l'θ = 0.15."""
    a = analysis.observable(Pendulum, lambda m: m.length * m.theta)
    state = {"theta": 0.3, "theta_dot": 0.25, "length": 2.0, "length_dot": 0.5, "mass": 1.7}
    H = analysis.hamiltonian(a.equations)
    assert analysis.poisson_bracket(H, a).evaluate(**state) == algebra(0.5)
    assert a.time_derivative().evaluate(**state) == algebra(0.65)
    # Of the rate that a moving pivot gives, by its acceleration; of p_θ, the torques of weight and friction.
    shaken = analysis.observable(Pendulum, lambda m: m.dot(m.pivot_x) * m.theta)
    moved = state | {"pivot_x_dot": -0.7, "pivot_x_ddot": 1.1}
    assert shaken.time_derivative().evaluate(**moved) == algebra(1.1 * 0.3 - 0.7 * 0.25)
    p, torque = analysis.observable(Pendulum, lambda m: m.momentum(m.theta)), -1.7 * 9.81 * 2 * np.sin(0.3)
    assert analysis.poisson_bracket(H, p).evaluate(**state) == algebra(torque)
    assert p.time_derivative().evaluate(**state, friction=0.2) == algebra(torque - 0.2 * 1.7 * 4 * 0.25)


# ---- K 3.4: maps of phase space ----------------------------------------------------------------------------------


def test_a_motion_is_a_map_and_two_in_succession_are_one() -> None:
    """K eq. 92-94, and the product before 102: coordinates first; X(X(X_0; s); t) = X(X_0; s + t)."""
    start = {"theta_1": 0.7, "theta_2": -0.4, "theta_1_dot": 0.9, "mass_2": 1.7}
    whole, first = (analysis.flow(DoublePendulum, t, **start) for t in (0.7, 0.3))
    second = analysis.flow(DoublePendulum, 0.4, mass_2=1.7, **first.state)
    assert list(whole.state) == ["theta_1", "theta_2", "p_theta_1", "p_theta_2"]
    assert second.state == pytest.approx(whole.state, abs=FLOW)
    np.testing.assert_allclose(second.jacobian @ first.jacobian, whole.jacobian, rtol=0, atol=1e2 * FLOW)


def test_a_short_motion_and_each_element_of_its_jacobian_are_linear_in_its_time() -> None:
    """K eq. 96, 98, 99: X_dt = X_0 + dt V + O(dt²), J_kl = δ_kl + dt ∂V_k/∂X_l + O(dt²), V = A X."""
    start, steps = np.array([0.8, -0.5]), np.array([0.004, 0.002, 0.001])
    errors = []
    for dt in steps:
        flow = analysis.flow(Oscillator, dt, x=start[0], p_x=start[1], **BODY)
        moved = np.array(list(flow.state.values())) - start - dt * A @ start
        errors.append([*np.abs(moved), *np.abs(flow.jacobian - np.eye(2) - dt * A).ravel()])
    for error in np.transpose(errors):
        assert slope(steps, error) == pytest.approx(2, abs=0.02)  # next term: dt A = 0.01 of it


def test_pendulum_in_phase_space_turns_at_its_own_frequency() -> None:
    """K eq. 104, 105 with x_1 = θ, x_2 = p_θ/(m l² Ω): x_1' = Ω x_2, x_2' = -Ω sin x_1; Ω² = g/l."""
    m, l, g = 0.7, 2.3, 5.2  # noqa: E741
    frequency, x_1, x_2 = np.sqrt(g / l), 0.9, -1.4
    unit = m * l**2 * frequency
    theta_dot, p_dot = analysis.phase_velocity(Pendulum).evaluate(
        theta=x_1, p_theta=x_2 * unit, mass=m, length=l, gravity=g
    )
    assert (theta_dot, p_dot / unit) == algebra((frequency * x_2, -frequency * np.sin(x_1)))


# ---- K 4.1: varied accelerations, centres of force without mass --------------------------------------------------


def test_with_place_and_velocity_held_a_displacement_varies_by_half_dt_squared_times_the_acceleration() -> None:
    """K eq. 106: δr(t + dt) = ½ dt² δr'' + O(dt³), by a push F: r by the flow in θ, δr'' by multipliers in x, y, z."""
    theta, rate, F = 0.6, 1.5, 2.0
    along, across = np.array([np.sin(theta), 0, -np.cos(theta)]), np.array([np.cos(theta), 0, np.sin(theta)])
    position = dict(zip("xyz", [*along[:2], along[2] + 1], strict=True))
    state = position | dict(zip(("x_dot", "y_dot", "z_dot"), rate * across, strict=True)) | {"mass": M}
    free, pushed = (equations_of(CartesianPendulum).evaluate("accelerations", x_force=f, **state) for f in (0.0, F))
    assert (pushed - free) @ along == algebra(0, 1e-11)  # compatible with the rod
    motion = dict(zip(("x_ddot", "y_ddot", "z_ddot"), free, strict=True))
    tension = M * (rate**2 + 9.81 * np.cos(theta))
    # K eq. 108, 109: Gauss's function is Z²/2m on the motion.
    assert analysis.gauss_function(CartesianPendulum).evaluate(**state, **motion) == algebra(
        tension**2 / (2 * M), 1e-11
    )

    def reached(dt: float, push: float) -> NDArray:
        end = analysis.flow(Pendulum, dt, theta=theta, theta_dot=rate, mass=M, bob_x_load=-push).state["theta"]
        return np.array([np.sin(end), 0, -np.cos(end)])

    steps = np.array([0.04, 0.02, 0.01])
    rest = [reached(dt, F) - reached(dt, 0.0) - dt**2 / 2 * (pushed - free) for dt in steps]
    assert slope(steps, np.linalg.norm(rest, axis=1)) == pytest.approx(3, abs=0.1)  # next term of dt θ' = 0.06


class Dumbbell(Mechanism):
    """Two masses on a massless rod, and beside it a centre of force without mass, r_1 + 0.3 d + 0.4 e_y × d."""

    mass_1, mass_2 = (Parameter(m, "kg", "mass", above=0) for m in (0.7, 1.9))
    gravity = Gravity()
    x_1, z_1 = (Coordinate("m", "first mass", start=start) for start in (0.1, -0.2))
    x_2, z_2 = (Coordinate("m", "second mass", start=start) for start in (0.9, 0.4))

    @constraint("m", "length of the rod")
    def rod(self) -> ca.SX:
        return ca.norm_2(ca.vertcat(self.x_2 - self.x_1, self.z_2 - self.z_1)) - self.reach

    reach = Parameter(1.0, "m", "length", above=0)

    @point("m", "centre of force")
    def centre(self) -> dict[str, ca.SX]:
        x, z = self.x_2 - self.x_1, self.z_2 - self.z_1
        return {"x": self.x_1 + 0.3 * x + 0.4 * z, "z": self.z_1 + 0.3 * z - 0.4 * x}

    def kinetic_energy(self) -> ca.SX:
        first, second = {"x": self.x_1, "z": self.z_1}, {"x": self.x_2, "z": self.z_2}
        return self.mass_1 / 2 * self.speed_squared(first) + self.mass_2 / 2 * self.speed_squared(second)


def test_a_force_on_a_centre_without_mass_moves_the_masses_that_hold_it() -> None:
    """K 4.1, end: M R'' = F and, about the centre of mass, I φ'' = (r - R) × F, by the laws of a rigid body."""
    (m_1, m_2), F, spin = (0.7, 1.9), np.array([1.3, -0.8]), 0.9
    r_1, d = np.array([0.1, -0.2]), np.array([0.8, 0.6])
    left = np.array([-d[1], d[0]])  # d, turned from x towards z
    positions = dict(zip(("x_1", "z_1", "x_2", "z_2"), [*r_1, *(r_1 + d)], strict=True))
    ends = np.array([-m_2, m_1]) / (m_1 + m_2)  # the masses, seen from R in units of d
    rates = dict(zip(("x_1_dot", "z_1_dot", "x_2_dot", "z_2_dot"), np.outer(ends, spin * left).ravel(), strict=True))
    arm = 0.3 * d - 0.4 * left + ends[0] * d
    turning = np.linalg.det([arm, F]) / (m_1 * m_2 / (m_1 + m_2))
    expected = F / (m_1 + m_2) + np.outer(ends, turning * left - spin**2 * d)
    load = {"centre_x_load": -F[0], "centre_z_load": -F[1]}
    accelerations = equations_of(Dumbbell).evaluate("accelerations", **positions, **rates, **load)
    assert accelerations == algebra(expected.ravel(), 1e-11)  # a linear system of condition 10


def test_a_coordinate_of_a_centre_without_mass_is_refused_by_name() -> None:
    with pytest.raises(ComponentError, match="no kinetic energy belongs to charge_x"):

        class Massless(Dumbbell):
            charge_x = Coordinate("m", "centre of force")


# ---- K 4.2: Nosé and Hoover --------------------------------------------------------------------------------------


def test_nose_hoover_conserves_its_extended_energy_and_contracts_at_the_rate_of_its_friction() -> None:
    """K 4.2, end: H' = p²/2m + K q²/2 + Q ξ²/2 + k_B T η, ∇·V = -ξ, for m, K, Q and k_B T that differ."""
    n = {"mass": M, "stiffness": K, "thermostat_mass": 2.3, "thermal_energy": 1.7, "q": 0.6, "p_q": -1.1, "xi": 0.4}
    rates = analysis.phase_velocity(NoseHooverOscillator).evaluate(**n)
    assert rates == algebra([-1.1 / M, -K * 0.6 + 0.4 * 1.1, (1.1**2 / M - 1.7) / 2.3, 0.4])
    extended = analysis.observable(NoseHooverOscillator, lambda m: m.extended_energy)
    assert extended.evaluate(**n, eta=0.2) == algebra(1.1**2 / (2 * M) + K * 0.18 + 2.3 * 0.08 + 1.7 * 0.2)
    assert extended.time_derivative().evaluate(**n) == algebra(0)
    assert analysis.divergence(NoseHooverOscillator).evaluate(**n) == algebra(-0.4)


# ---- K 5.1: the driven oscillator --------------------------------------------------------------------------------


@pytest.mark.parametrize("omega", [0.9, 2.1, 3.7])  # ω_0 = 2.104
def test_stationary_motion_solves_the_equation_of_the_driven_oscillator(omega: float) -> None:
    """K eq. 120-124: u_p = |u_0| |F_0| cos(ωt + α + φ), u_0 = (F_0/m)/(ω_0² - ω² + iγω), from its start on."""
    F, alpha, t = 1.9, 0.3, np.linspace(0, 7, 29)
    amplitude, phase = Oscillator.response(omega, **BODY)
    u_0 = F / (K - M * omega**2 + 1j * M * GAMMA * omega)
    assert F * amplitude * np.exp(1j * phase) == algebra(u_0)
    u = u_0 * np.exp(1j * (omega * t + alpha))
    start = {"x_0": u[0].real, "x_dot_0": (1j * omega * u[0]).real}
    drive = {"amplitude": F, "angular_frequency": omega, "phase": alpha + np.pi / 2}  # a cosine
    motion = Oscillator.exact(t, driven="x_force", **start, **drive, **BODY)
    np.testing.assert_allclose(motion["x"], u.real, rtol=0, atol=1e-13)  # roundings of a phase of 26


@pytest.mark.parametrize("ratio", [20.0, 50.0])
def test_an_over_damped_transient_dies_in_the_time_gamma_over_the_squared_frequency(ratio: float) -> None:
    """K eq. 130, 131 corrected: 1/|λ_1| = 1/(γ/2 - √(γ²/4 - ω_0²)), γ/ω_0² but for (ω_0/γ)²; 1/γ is too short."""
    omega_0 = np.sqrt(K / M)
    gamma = ratio * omega_0
    time = gamma / omega_0**2
    times = np.array([10 / gamma, time, 2 * time])
    early, *after = Oscillator.exact(times, x_0=1.0, mass=M, stiffness=K, damping=gamma)["x"]
    relaxation = time / np.log(after[0] / after[1])
    assert relaxation == pytest.approx(
        1 / (gamma / 2 - np.sqrt(gamma**2 / 4 - omega_0**2)), rel=1e-11
    )  # cancels: ratio²
    assert relaxation == pytest.approx(time, rel=1.1 / ratio**2)
    assert early > np.exp(-10 / ratio**2)  # nearly all of it is left after the printed time, tenfold
