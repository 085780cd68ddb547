"""The printed formulas hold for the derived equations, and where they are misprinted they are shown to fail.

K = Kneller, M = Marle.  Each correction has its name in the list of errata: KA for Kneller, MA for Marle.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from on_paper import State, algebra, random_states, unloaded

from liaisons.errors import ComponentError, ValidityError
from liaisons.language import ActiveCoordinate, Coordinate, Mechanism, Parameter, unchecked
from liaisons.models import CircularHoop, Oscillator, Pendulum, Swing

# ---- K Ex. 3, 6, 8: the pendulum ---------------------------------------------------------------------------------


STILL = {f"{s}{end}": 0.0 for s in ("length", "pivot_x", "pivot_z") for end in ("_dot", "_ddot")}


def test_pendulum_of_kneller_is_the_one_with_fixed_pivot_and_length() -> None:
    """K Ex. 3 and 6: θ'' + η θ' + Ω² sin θ = 0; Ex. 8: p_θ = m l² θ', p_θ' = -m g l sin θ - η p_θ.

    KA7: Ex. 6 prints m l² θ'' = -m g l sin θ - Q with Q = -m l² η θ': then dE/dt = +2 η T, against eq. 67.
    """
    for n in random_states(Pendulum, **STILL, **unloaded(Pendulum)):
        inertia, weight = n.mass * n.length**2, n.mass * n.gravity * n.length * np.sin(n.theta)
        p, theta_ddot = inertia * n.theta_dot, n("accelerations")
        assert theta_ddot == algebra(-n.friction * n.theta_dot - n.gravity / n.length * np.sin(n.theta))
        assert n("momenta") == algebra(p)
        assert n("momentum_rates") == algebra(-weight - n.friction * p)
        loss = 2 * n.friction * n("kinetic_energy")
        printed = (-weight + n.friction * p) / inertia
        # K eq. 67; cancellation of the weight's power
        assert n.theta_dot * (inertia * theta_ddot + weight) == pytest.approx(-loss, rel=1e-11)
        assert n.theta_dot * (inertia * printed + weight) == pytest.approx(+loss, rel=1e-12)


# ---- K 5.1: the oscillator ---------------------------------------------------------------------------------------


MASS, OMEGA_0 = 0.7, 1.3


def oscillator(ratio: float) -> dict[str, float]:
    """Damped with γ = ratio · ω_0."""
    return {"mass": MASS, "stiffness": MASS * OMEGA_0**2, "damping": ratio * OMEGA_0}


def complex_amplitude(omega: NDArray, ratio: float) -> NDArray:
    """K eq. 120 for |F_0| = 1 N."""
    return 1 / (MASS * (OMEGA_0**2 - omega**2 + 1j * ratio * OMEGA_0 * omega))


@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.0, 1.4])
def test_ka2_amplitude_is_largest_at_the_corrected_resonance_not_at_the_printed_one(ratio: float) -> None:
    grid = OMEGA_0 * np.linspace(0, 2, 2_000_001)
    top = grid[np.argmax(np.abs(complex_amplitude(grid, ratio)))]
    printed = OMEGA_0 * np.sqrt(1 - ratio**2 / 4)
    peak = Oscillator.resonance(**oscillator(ratio))
    assert abs(peak - top) <= 1.3e-6  # spacing of the grid
    assert abs(printed - top) > 1e-3
    height, _ = Oscillator.response(peak, **oscillator(ratio))
    assert height == algebra(1 / (MASS * ratio * OMEGA_0**2 * np.sqrt(1 - ratio**2 / 4)))


@pytest.mark.parametrize("ratio", [1.42, 1.7, 1.99])
def test_ka3_no_resonance_from_root_two_on_though_printed_up_to_two(ratio: float) -> None:
    amplitude, _ = Oscillator.response(OMEGA_0 * np.linspace(0.01, 3, 500), **oscillator(ratio))
    assert np.all(np.diff(amplitude) < 0)
    with pytest.raises(ValidityError, match="damping"):
        Oscillator.resonance(**oscillator(ratio))


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0, 4.0])  # those of K Fig. 7
def test_ka4_phase_is_continuous_through_resonance_where_the_printed_one_jumps(ratio: float) -> None:
    omega = OMEGA_0 * np.concatenate([np.linspace(0.05, 0.95, 10), np.linspace(1.05, 3, 10)])
    amplitude, phase = Oscillator.response(omega, **oscillator(ratio))
    np.testing.assert_allclose(amplitude * np.exp(1j * phase), complex_amplitude(omega, ratio), rtol=1e-14)  # roundings
    assert np.all((phase < 0) & (phase > -np.pi))
    assert np.all(np.diff(phase) < 0)
    printed = np.arctan(ratio * OMEGA_0 * omega / (omega**2 - OMEGA_0**2))
    np.testing.assert_allclose(printed[:10], phase[:10], rtol=1e-13)  # right below ω_0, a few roundings
    np.testing.assert_allclose(printed[10:], phase[10:] + np.pi, rtol=1e-13)  # too large by π above


# ---- M 8.1: the swing --------------------------------------------------------------------------------------------


def swing_coefficients(n: State) -> tuple[float, NDArray, NDArray]:
    """I, J_α and g_αβ of M eq. 55 in the rope's frame, from the velocities of the two masses by hand."""
    m_1, m_2, b, rope, lean = n.mass_seat, n.mass_torso, n.torso_length, n.rope, n.lean
    inertia = m_1 * rope**2 + m_2 * (rope**2 + b**2 + 2 * rope * b * np.cos(lean))
    J = m_2 * b * np.array([-np.sin(lean), b + rope * np.cos(lean)])
    g = np.array([[m_1 + m_2, -m_2 * b * np.sin(lean)], [-m_2 * b * np.sin(lean), m_2 * b**2]])
    return inertia, J, g


def test_swing_has_the_lagrangian_of_equation_56_with_the_half_restored() -> None:
    for n in random_states(Swing):
        inertia, J, g = swing_coefficients(n)
        v = np.array([n.rope_dot, n.lean_dot])
        L = inertia * n.theta_dot**2 / 2 + J @ v * n.theta_dot + v @ g @ v / 2 + n("D") * np.cos(n("theta_com"))
        assert n("lagrangian") == algebra(L)
        assert [n(name) for name in ("inertia", "J_rope", "J_lean")] == algebra([inertia, *J])
        assert n("momenta") == algebra(inertia * n.theta_dot + J @ v)
        # M eq. 50 for one free coordinate: Θ = g - J Jᵀ/I
        np.testing.assert_allclose(n("effective_mass"), g - np.outer(J, J) / inertia, rtol=0, atol=1e-11)


def test_swing_angular_momentum_changes_by_the_weight_alone() -> None:
    """M eq. 26 with eq. 54: p_θ' = -D sin θ_com, whatever the operator does."""
    for n in random_states(Swing, **unloaded(Swing)):
        assert n("momentum_rates") == pytest.approx(-n("D") * np.sin(n("theta_com")), rel=1e-12, abs=1e-10)


def test_ma2_weight_needs_the_total_mass_and_theta_com_points_at_its_centre() -> None:
    """M prints D = gravity × distance of the centre of mass; it is the total mass times that."""
    for n in random_states(Swing):
        seat = -1j * n.rope * np.exp(1j * n.theta)
        torso = seat - 1j * n.torso_length * np.exp(1j * (n.theta + n.lean))
        moment, total = n.mass_seat * seat + n.mass_torso * torso, n.mass_seat + n.mass_torso
        D, theta_com, potential = n("D"), n("theta_com"), n("potential_energy")
        printed = n.gravity * abs(moment) / total
        assert algebra(n.gravity * abs(moment)) == D
        # M eq. 54: P = -D cos θ is the potential energy of the two masses; with the printed D it is not.
        assert -D * np.cos(theta_com) == algebra(potential)
        assert -printed * np.cos(theta_com) == algebra(potential / total)
        # e^{iθ} leaves the number of turns open; a rounding of it
        assert abs(np.exp(1j * theta_com) - 1j * moment / abs(moment)) <= 1e-14
        assert abs(theta_com - n.theta) < np.pi  # not wrapped


class PrintedSwing(Swing):
    """Swing with M eq. 56 as printed: the term g_αβ v^α v^β without its ½."""

    def lagrangian(self) -> ca.SX:
        return self.kinetic_energy() - self.potential_energy() + self._missing_half()

    def _missing_half(self) -> ca.SX:
        """½ g_αβ v^α v^β once more: the kinetic energy at θ' = 0."""
        return ca.substitute(self.kinetic_energy(), self.free.q_dot, ca.SX.zeros(1))


def test_ma1_without_the_half_the_motion_stays_right_but_the_operator_pays_twice() -> None:
    for n in random_states(Swing):
        printed = State(PrintedSwing, n)
        np.testing.assert_allclose(printed("accelerations"), n("accelerations"), rtol=1e-12, atol=1e-12)
        # d/dt of the surplus ½ g(v, v): its own Lagrange expression, g v' + Γ(v, v) at θ' = 0, at θ = anything
        forces = n("operator_forces")
        assert np.max(np.abs(printed("operator_forces") - forces)) > 1e-2 * np.max(np.abs(forces))
        surplus = printed("effective_mass") - n("effective_mass")
        np.testing.assert_allclose(surplus, swing_coefficients(n)[2], rtol=0, atol=1e-11)  # Θ counts g_αβ twice; 100 kg


# ---- M 8.4: the hoop ---------------------------------------------------------------------------------------------


def test_ma3_without_the_dots_equation_61_is_no_lagrangian() -> None:
    """M prints ξ where the rate of ξ belongs: then nothing moves along the hoop."""
    with pytest.raises(ComponentError, match="no kinetic energy belongs to xi"):

        class PrintedHoop(CircularHoop):
            @unchecked("a length stands where its rate belongs")
            def lagrangian(self) -> ca.SX:
                return ca.substitute(self.kinetic_energy(), self.free.q_dot, self.free.q)


# ---- M 5: a Lagrangian that is hyper-regular, and no mechanism with an operator ----------------------------------


def test_the_product_of_equation_39_is_refused_because_it_would_bind_the_operator() -> None:
    """L = v¹ v², π = x²: eq. 26 says σ'' = 0, eq. 27 says λ = x¹'', and nothing says what x¹ is.

    L is hyper-regular with H = p_1 p_2 (eq. 40), but ∂H/∂p_2 = p_1 does not contain p_2: eq. 37 cannot be solved.
    """
    v, a, p = ca.SX.sym("v", 2), ca.SX.sym("a", 2), ca.SX.sym("p", 2)
    L = v[0] * v[1]
    lagrange = ca.jtimes(ca.gradient(L, v), v, a)  # d/dt ∂L/∂v; ∂L/∂x = 0
    np.testing.assert_array_equal(ca.DM(ca.substitute(lagrange, a, ca.DM([2.0, 3.0]))), [[3.0], [2.0]])  # (σ'', x¹'')
    metric = ca.DM(ca.hessian(L, v)[0])
    assert np.linalg.matrix_rank(np.asarray(metric)) == 2
    rates = ca.solve(metric, p)
    H = ca.dot(p, rates) - ca.substitute(L, v, rates)
    assert float(ca.DM(ca.substitute(H, p, ca.DM([2.0, 5.0])))) == 10.0
    assert float(ca.DM(ca.hessian(H, p)[0])[1, 1]) == 0.0
    with pytest.raises(ComponentError, match=r"x_1_dot is multiplied by rates of active coordinates alone.*M eq\. 39"):

        class Product(Mechanism):
            """M eq. 39."""

            mass = Parameter(1.0, "kg", "mass", above=0)
            x_1 = Coordinate("m", "free")
            x_2 = ActiveCoordinate("m", "prescribed")

            def kinetic_energy(self) -> ca.SX:
                return self.mass * self.dot(self.x_1) * self.dot(self.x_2)
