"""Numbers of K and M that no component stands for: each on expressions or numbers of its own.

Which number is shown where is told by components/liaisons_pages/companion/texts.toml.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hand_derivations import displacements, molecule_matrices
from numpy.typing import NDArray
from on_paper import State, algebra, equations_of, random_states, unloaded, vector
from scipy.spatial.transform import Rotation

from liaisons.check import slope
from liaisons.language import ActiveCoordinate, Coordinate, Friction, Mechanism, Parameter, unchecked
from liaisons.mechanics import derive
from liaisons.models import (
    CircularHoop,
    DoublePendulum,
    LinearMolecule,
    Oscillator,
    OscillatorChain,
    Pendulum,
    PlanarCat,
    SpatialCat,
    Swing,
)
from liaisons_motion import analysis
from liaisons_motion.analysis import Quantity

# ---- K 2.1, 2.2: points, generalised coordinates -----------------------------------------------------------------


def places(q: NDArray, l: NDArray) -> NDArray:  # noqa: E741
    """K eq. 10 for two rods in a plane: r_1 and r_2 as (x_1, z_1, x_2, z_2)."""
    first = l[0] * np.array([np.sin(q[0]), -np.cos(q[0])])
    return np.concatenate([first, first + l[1] * np.array([np.sin(q[1]), -np.cos(q[1])])])


def slopes(q: NDArray, l: NDArray) -> NDArray:  # noqa: E741
    """∂r/∂q by complex steps, exact to rounding."""
    step = 1e-30j * np.eye(2)
    return np.array([np.imag(places(q + e, l)) / 1e-30 for e in step]).T


def two_rods() -> list[tuple[State, NDArray, NDArray, NDArray]]:
    """States with the pivot at rest at the origin: the numbers, ∂r/∂q, masses of the components, q'."""
    still = {name: 0.0 for name in equations_of(DoublePendulum).symbols if name.startswith("pivot")}
    found = []
    for n in random_states(DoublePendulum, **still):
        J = slopes(np.array([n["theta_1"], n["theta_2"]]), np.array([n["length_1"], n["length_2"]]))
        masses = np.repeat([n["mass_1"], n["mass_2"]], 2)
        found.append((n, J, masses, np.array([n["theta_1_dot"], n["theta_2_dot"]])))
    return found


def test_metric_tensor_is_the_masses_between_slopes_of_the_places() -> None:
    """K eq. 10-13: δr = ∂r/∂q δq, T = ½ Σ m r'² = ½ Σ a_kl q_k' q_l', a_kl = Σ m ∂r/∂q_k · ∂r/∂q_l."""
    for n, J, masses, rates in two_rods():
        a = J.T @ np.diag(masses) @ J
        assert n("mass_matrix") == algebra(a)
        assert n("kinetic_energy") == algebra(rates @ a @ rates / 2)
        assert masses @ (J @ rates) ** 2 / 2 == algebra(rates @ a @ rates / 2)


def test_generalised_forces_are_the_forces_on_the_slopes_of_the_places() -> None:
    """K eq. 14-17: Q_k = Σ F·∂r/∂q_k; of weights -∂U/∂q_k; of loads on the bobs, by the FMU's own ports."""
    equations = equations_of(DoublePendulum)
    own = [f"theta_{k}_{kind}" for k in (1, 2) for kind in ("force", "load")]
    ports = ["bob_1_x_load", "bob_1_z_load", "bob_2_x_load", "bob_2_z_load"]
    for n, J, masses, _ in two_rods():
        weights = -n["gravity"] * masses * [0, 1, 0, 1]
        slope_of_U = n(ca.gradient(equations.potential_energy, equations.mechanism.free.q))
        assert J.T @ weights == algebra(-slope_of_U)
        applied = weights - [n[name] for name in ports]
        rates = {f"theta_{k}_dot": 0.0 for k in (1, 2)} | dict.fromkeys(own, 0.0)
        # At rest p' = ∂L/∂q + Q = Q (K eq. 15).
        assert (n | rates)("momentum_rates") == algebra(J.T @ applied)


def test_generalised_friction_is_minus_eta_times_the_slope_of_the_kinetic_energy() -> None:
    """K eq. 64-66: Q = -η Σ m r'·∂r/∂q = -η ∂T/∂q' for friction -m η r' on each bob."""

    class Rubbed(DoublePendulum):
        """With friction on both bobs."""

        friction = Friction("of the air")

    for n, J, masses, rates in two_rods():
        by_points = -0.3 * J.T @ (masses * (J @ rates))
        found = State(Rubbed, n | {"friction": 0.3})("momentum_rates") - n("momentum_rates")
        assert found == algebra(by_points)
        assert found == algebra(-0.3 * n("momenta"))


# ---- K 2.3: fields that are neither uniform nor static -----------------------------------------------------------


class ChargeInFields(Mechanism):
    """L = ½ m r'² - Q (φ - r'·A) with fields of place and time; the operator is a clock, t' = 1."""

    mass = Parameter(0.7, "kg", "mass", above=0)
    charge = Parameter(-1.3, "C", "charge")
    x, y, z = (Coordinate("m", "position") for _ in range(3))
    t = ActiveCoordinate("s", "time")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y, "z": self.z})

    @unchecked("fields made of bare numbers")
    def potential_energy(self) -> ca.SX:
        return self.charge * (self.x**2 * self.y - ca.sin(self.z) * self.t**2)

    @unchecked("fields made of bare numbers")
    def lagrangian(self) -> ca.SX:
        A = ca.vertcat(self.y * self.z * self.t, ca.cos(self.x) + self.t**3, self.x * self.y**2 - self.t)
        return super().lagrangian() + self.charge * ca.dot(self.free.q_dot, A)


def test_lagrangian_of_a_charge_gives_lorentz_force_in_any_field() -> None:
    """K eq. 21-25: m r'' = Q (E + r' ∧ B), E = -∇φ - ∂A/∂t, B = ∇ ∧ A, by hand."""
    for n in random_states(ChargeInFields, **unloaded(ChargeInFields), t_dot=1.0):
        x, y, z, t = n.x, n.y, n.z, n.t
        slope_of_phi, rate_of_A = [2 * x * y, x**2, -np.cos(z) * t**2], [y * z, 3 * t**2, -1]
        B = [2 * x * y, y * t - y**2, -np.sin(x) - z * t]
        force = -np.add(slope_of_phi, rate_of_A) + np.cross(vector(n, "{}_dot"), B)
        assert n("accelerations") == algebra(n.charge / n.mass * force)


# ---- K 3.2, M 4: Legendre's transformation -----------------------------------------------------------------------


@pytest.mark.parametrize("component", [Pendulum, Swing, CircularHoop, PlanarCat])
def test_slopes_of_h_at_given_momenta_are_those_of_l_at_given_rates(component: type[Mechanism]) -> None:
    """K eq. 79-83, 85, 89 and M eq. 30-33: ∂H/∂x = -∂L/∂x, ∂H/∂p = x', ∂H/∂t = -∂L/∂t = dH/dt; t enters by s and s'."""
    equations = derive(component)
    m, h = equations.mechanism, analysis.hamiltonian(equations).expression
    q, p, s, s_dot = m.free.q, m.free.p, m.active.s, m.active.s_dot
    by_time = ca.vertcat(s, s_dot)
    motion = analysis.hamilton_equations(equations).expression
    passing = ca.vertcat(s_dot, m.active.s_ddot)
    along = ca.jtimes(h, ca.vertcat(q, p, by_time), ca.densify(ca.vertcat(motion, passing)))
    rest = ca.substitute(h, s_dot, ca.SX.zeros(s_dot.shape))
    by_metric = ca.dot(p, ca.solve(equations.mass_matrix, p)) / 2 + equations.potential_energy
    pairs = {
        "x": (ca.gradient(h, q), -ca.gradient(equations.lagrangian, q)),
        "p": (ca.gradient(h, p), m.free.q_dot),
        "t": (ca.gradient(h, by_time), -ca.gradient(equations.lagrangian, by_time)),
        "dH/dt": (along, ca.dot(ca.gradient(h, by_time), passing)),
        "K eq. 85": (rest, by_metric),
    }
    momenta = {str(symbol) for symbol in ca.vertsplit(p)}  # which follow from the rates
    for n in random_states(component, 5):
        state = {
            name: n[name] for name in equations.symbols if not (name.endswith(("_force", "_load")) or name in momenta)
        }
        for name, (left, right) in pairs.items():
            size = 1e-11 * (1 + np.abs(Quantity(equations, right).evaluate(**state)).max())  # metrics of condition 100
            found, expected = (Quantity(equations, ca.densify(e)).evaluate(**state) for e in (left, right))
            np.testing.assert_allclose(found, expected, rtol=1e-11, atol=size, err_msg=name)


# ---- K 5: normal coordinates, and the limit of a string ----------------------------------------------------------


def test_lagrangian_is_a_sum_over_normal_coordinates() -> None:
    """K eq. 133-146, 149-151: with q = D̃ᵀ M^½ u the Lagrangian is Σ (½ q_k'² - ½ Ω_k² q_k²)."""
    for n in random_states(LinearMolecule):
        (M, K), u = molecule_matrices(n), displacements(n)
        root = np.sqrt(M)
        squares, D = np.linalg.eigh(np.linalg.inv(root) @ K @ np.linalg.inv(root))
        q, q_dot = D.T @ root @ u, D.T @ root @ vector(n, "x_{}_dot", "123")
        L = n("kinetic_energy") - n("potential_energy")
        assert algebra(np.sum(q_dot**2 - squares * q**2) / 2) == L
        assert np.linalg.inv(root) @ D @ q == algebra(u)


def test_chain_becomes_a_string_with_the_square_of_the_spacing() -> None:
    """K eq. 162-165: Ω_k = c q (1 - (q Δx)²/24 + ...), with q = kπ/L, as second differences tend to derivatives."""
    counts, length, speed = np.array([20, 40, 80, 160]), 2.0, 3.0
    errors = []
    for n in counts:
        spacing = length / n
        frequencies, modes = OscillatorChain.normal_modes(n=int(n), mass=1.0, stiffness=(speed / spacing) ** 2)
        wave = 3 * np.pi / length
        j = 2 * int(n) // 5
        second = (modes[j + 1, 3] - 2 * modes[j, 3] + modes[j - 1, 3]) / spacing**2
        assert second == pytest.approx(-(frequencies[3] ** 2) / speed**2 * modes[j, 3], rel=1e-9)  # n² roundings
        errors.append(1 - frequencies[3] / (speed * wave))
    assert slope(length / counts, errors) == pytest.approx(2, abs=0.01)  # next term (q Δx)⁴
    assert errors[-1] == pytest.approx((3 * np.pi / 160) ** 2 / 24, rel=1e-3)


# ---- M 3: variations ---------------------------------------------------------------------------------------------


def test_action_of_a_motion_changes_by_the_momenta_at_its_ends() -> None:
    """M eq. 9: where the ends move, dI/ds = ⟨ℒ(c'), δk⟩ at t_2 less that at t_1; δx = 1 + t."""
    t, size = np.linspace(0, 1.3, 401), 1e-3
    motion = Oscillator.exact(t, x_0=1.0, x_dot_0=0.7, mass=0.5, stiffness=2.0)

    def action(e: float) -> float:
        path = {"x": motion["x"] + e * (1 + t), "x_dot": motion["x_dot"] + e}
        return analysis.action(Oscillator, t, path, mass=0.5, stiffness=2.0).action

    momenta = 0.5 * motion["x_dot"]
    expected = momenta[-1] * (1 + t[-1]) - momenta[0]
    assert (action(size) - action(-size)) / (2 * size) == pytest.approx(
        expected, abs=1e-9
    )  # S is quadratic; interpolation
    assert abs(expected) > 0.1


# ---- M 6, 7: automorphisms of the Poisson structure --------------------------------------------------------------


@pytest.mark.parametrize("term", ["frozen", "energy", "lift"])
@pytest.mark.parametrize("component", [Pendulum, Swing, PlanarCat])
def test_each_term_of_the_dynamic_field_keeps_the_poisson_tensor(component: type[Mechanism], term: str) -> None:
    """M eq. 48, 49: the Jacobian matrix F of the field in (x, p) is Hamiltonian, Ω F symmetric."""
    quantity = getattr(analysis.dynamic_field(component), term)
    equations, rng = quantity.equations, np.random.default_rng(2)
    m, f = equations.mechanism, equations.mechanism.free.q.shape[0]
    field = ca.vertcat(quantity.expression[:f], quantity.expression[-f:])
    F = ca.jacobian(field, ca.vertcat(m.free.q, m.free.p))
    moving = ca.vertcat(m.free.q, m.free.p, m.active.s_dot)
    state = {str(symbol): rng.uniform(0.1, 1) for symbol in ca.vertsplit(moving)}
    table = Quantity(equations, ca.densify(F)).evaluate(**state)
    omega = np.block([[np.zeros((f, f)), np.eye(f)], [-np.eye(f), np.zeros((f, f))]])
    product = omega @ table
    np.testing.assert_allclose(product, product.T, rtol=0, atol=1e-12 * (1 + np.abs(product).max()))  # algebra


# ---- M 8.2: the group of displacements ---------------------------------------------------------------------------


def test_kinetic_energy_of_a_cat_is_invariant_under_displacements() -> None:
    """M eq. 57, 58, 60: (l, r)·(x_G, y) = (l + r x_G, ρ(r, y)) changes the potential energy alone."""
    equations = derive(SpatialCat)
    rng = np.random.default_rng(4)
    shape = {"bend": 0.7, "azimuth": 0.4, "bend_dot": 0.3, "azimuth_dot": -0.8, "twist_dot": 0.2}
    shape |= {"omega_x": 0.5, "omega_y": -0.9, "omega_z": 0.3}  # in the axes of half A
    body, turn = Rotation.from_rotvec([0.3, -0.9, 1.1]), Rotation.from_rotvec([1.2, 0.4, -0.7])
    place, speed, shift = rng.normal(size=(3, 3))

    def state(attitude: Rotation, x: NDArray, v: NDArray) -> dict[str, float]:
        q = dict(zip(("q_w", "q_x", "q_y", "q_z"), attitude.as_quat(scalar_first=True), strict=True))
        axes = ("com_x", "com_y", "com_z")
        return shape | q | dict(zip(axes, x, strict=True)) | {f"{a}_dot": b for a, b in zip(axes, v, strict=True)}

    here, there = state(body, place, speed), state(turn * body, shift + turn.apply(place), turn.apply(speed))
    assert equations.evaluate("kinetic_energy", **there) == algebra(equations.evaluate("kinetic_energy", **here))
    higher = np.subtract(*(equations.evaluate("potential_energy", **at) for at in (there, here)))
    assert higher == algebra([2 * 2.0 * 9.81 * (there["com_z"] - here["com_z"])])
