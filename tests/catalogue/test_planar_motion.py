"""PlanarOscillator and PolarOscillator: one motion, two descriptions (K Ex. 5)."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hand_derivations import states
from on_paper import State, Values, algebra, taylor, unloaded

from liaisons_catalogue.planar_oscillator import PlanarOscillator
from liaisons_catalogue.polar_oscillator import PolarOscillator

# ---- Newton's law and the formulas of the text -------------------------------------------------------------------


def test_both_have_the_same_energies_and_angular_momentum() -> None:
    """K eq. 35 is eq. 41 under x = r cos φ, y = r sin φ (eq. 39, 40)."""
    for n in states(PolarOscillator):
        turn = np.exp(1j * n.phi)
        position, velocity = n.r * turn, (n.r_dot + 1j * n.r * n.phi_dot) * turn
        place = {"x": position.real, "y": position.imag, "x_dot": velocity.real, "y_dot": velocity.imag}
        there = State(PlanarOscillator, {"mass": n.mass, "stiffness": n.stiffness} | place)
        for quantity in ("kinetic_energy", "potential_energy"):
            assert n(quantity) == algebra(there(quantity))
        assert n("momenta")[1] == algebra(there("angular_momentum"))


def test_ka1_the_printed_radial_equation_lacks_the_centrifugal_term() -> None:
    for n in states(PolarOscillator, **unloaded(PolarOscillator)):
        printed = -n.stiffness / n.mass * n.r  # K eq. 43
        p_phi = n.mass * n.r**2 * n.phi_dot
        centrifugal = p_phi**2 / (n.mass**2 * n.r**3)
        assert n("accelerations")[0] == algebra(printed + centrifugal)
        assert centrifugal > 1e-6  # it is the whole difference, and it is there
        radial = n | {"phi_dot": 0.0}
        assert radial("accelerations")[0] == algebra(printed)  # right for p_φ = 0 only


def test_ka10_the_printed_hamiltonian_subtracts_the_lagrangian_once_too_often() -> None:
    """K eq. 29 with the braces where they are printed: L is subtracted f = 2 times."""
    for n in states(PolarOscillator):
        L, E, products = n("lagrangian"), n("energy"), n("momenta") * [n.r_dot, n.phi_dot]
        assert products.sum() - L == algebra(E)
        assert (products - L).sum() == algebra(E - L)


# ---- closed forms ------------------------------------------------------------------------------------------------

STARTS: dict[str, Values] = {
    "ellipse": {"r_0": 1.0, "phi_dot_0": 0.5},
    "circle": {"r_0": 2.0, "phi_dot_0": 1.0},
    "oblique": {"r_0": 0.7, "phi_0": 2.0, "r_dot_0": -0.9, "phi_dot_0": 0.8, "stiffness": 2.5, "mass": 0.6},
    "backwards": {"r_0": 1.3, "phi_0": -1.0, "r_dot_0": 0.4, "phi_dot_0": -0.6},
    "free": {"r_0": 1.0, "r_dot_0": -0.5, "phi_dot_0": 0.3, "stiffness": 0.0},
}


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_polar_closed_form_is_exact_to_rounding(start: Values) -> None:
    times = np.linspace(0, 12, 25)
    n = {"phi_0": 0.0, "r_dot_0": 0.0, "mass": 1.0, "stiffness": 1.0} | start
    r, phi, r_dot, phi_dot = (Decimal(n[name]) for name in ("r_0", "phi_0", "r_dot_0", "phi_dot_0"))
    omega_squared, J = Decimal(n["stiffness"]) / Decimal(n["mass"]), r * r * phi_dot
    # r' = r D, φ' = J W, W' = -2 W D, D' = J² W² - Ω² - D² with W = 1/r² and D = r'/r
    rates = [{(0, 3): 1}, {(2,): J}, {(2, 3): -2}, {(2, 2): J * J, (): -omega_squared, (3, 3): -1}]
    reference = taylor(times, [r, phi, 1 / (r * r), r_dot / r], rates, step="0.02")
    exact = PolarOscillator.exact(times, **start)
    expected = {
        "r": reference[0],
        "phi": reference[1],
        "r_dot": reference[0] * reference[3],
        "phi_dot": float(J) * reference[2],
    }
    # Roundings of a phase of 12 · 2, seen from distances down to 0.3: rates of up to 10 /s.
    for name, values in expected.items():
        np.testing.assert_allclose(exact[name], values, rtol=0, atol=3e-13, err_msg=name)


@pytest.mark.parametrize("phi_dot_0", [1e-9, -0.3, 4.0])
def test_phi_grows_by_pi_in_each_half_period(phi_dot_0: float) -> None:
    times = np.linspace(0, 3, 13)
    first, later = (PolarOscillator.exact(times + 7 * shift, phi_dot_0=phi_dot_0) for shift in (0, np.pi))
    # A rounding of the phase 25, divided by the shortest distance squared: φ_dot is at most r_0² φ_dot/r_min².
    largest = max(abs(phi_dot_0), 1 / abs(phi_dot_0))
    gain = 7 * np.copysign(np.pi, phi_dot_0)
    np.testing.assert_allclose(later["phi"] - first["phi"], gain, rtol=0, atol=4e-15 * (1 + largest))
    np.testing.assert_allclose(later["r"], first["r"], rtol=0, atol=1e-14 * (1 + abs(phi_dot_0)))  # of the phase


def test_planar_closed_form_is_an_ellipse_with_its_invariants() -> None:
    times = np.linspace(0, 50, 101)
    start = {"x_0": 1.0, "y_0": -0.4, "x_dot_0": 0.3, "y_dot_0": 0.9, "mass": 1.7, "stiffness": 0.8}
    exact = PlanarOscillator.exact(times, **start)
    x, y, u, v = (exact[name] for name in ("x", "y", "x_dot", "y_dot"))
    # Energy, angular momentum and Fradkin's tensor K x_i x_j + m v_i v_j, which fixes the axes of the ellipse.
    for integral in (x * v - y * u, *(0.8 * a * b + 1.7 * c * d for a, b, c, d in ((x, x, u, u), (x, y, u, v)))):
        np.testing.assert_allclose(integral, integral[0], rtol=0, atol=5e-14)  # roundings of a phase of 35
