"""LinearMolecule: K Ex. 11, its equations, modes and motion."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hand_derivations import ATOMS, displacements, molecule_matrices
from on_paper import Values, algebra, defaults, random_states, taylor, unloaded

from liaisons_catalogue.linear_molecule import LinearMolecule

# not at rest, not symmetric
START: Values = {"x_1_0": -0.02, "x_2_0": 0.13, "x_3_0": 0.21, "x_1_dot_0": 0.01, "x_3_dot_0": -0.02}


# ---- Newton's law and the formulas of the text -------------------------------------------------------------------


def test_ka16_the_eigenvalues_are_the_squares_of_the_normal_frequencies() -> None:
    for n in random_states(LinearMolecule):
        omega = np.array([n(f"omega_{i}") for i in ATOMS])
        M, K = molecule_matrices(n)
        root = np.sqrt(M)
        eigenvalues = np.linalg.eigvalsh(np.linalg.solve(root, K) @ np.linalg.inv(root))  # of K eq. 156
        assert eigenvalues == algebra(omega**2)
        assert np.max(np.abs(eigenvalues - omega)) > 1e-2  # K's words, "les valeurs propres … sont les fréquences"


def test_modes_are_those_of_equation_158() -> None:
    for n in random_states(LinearMolecule):
        M, K = molecule_matrices(n)
        modes = LinearMolecule.modes(mass_outer=n["mass_outer"], mass_inner=n["mass_inner"])
        alpha = n["mass_outer"] / n["mass_inner"]
        third = [1 / np.sqrt(4 * alpha**2 + 2), -np.sqrt(2) * alpha / np.sqrt(2 * alpha**2 + 1)]
        printed = np.array([[1 / np.sqrt(3)] * 3, [-1 / np.sqrt(2), 0, 1 / np.sqrt(2)], [*third, third[0]]]).T
        assert modes == algebra(printed)
        squares = n["stiffness"] * np.array([0, 1 / n["mass_outer"], 1 / n["mass_outer"] + 2 / n["mass_inner"]])
        assert K @ modes == algebra(M @ modes * squares)  # K u_k = Ω_k² M u_k
        assert modes @ [n(f"mode_{i}") for i in ATOMS] == algebra(displacements(n))  # u = Σ q_k u_k


def test_kb2_total_momentum_needs_each_atoms_own_mass() -> None:
    """K eq. 46 prints Σ m r_α': with one mass for all it is no constant."""
    for n in random_states(LinearMolecule, **unloaded(LinearMolecule)):
        rates = n("accelerations")
        masses = np.diag(molecule_matrices(n)[0])
        terms = np.abs(masses * rates).sum()
        assert abs(masses @ rates) <= 1e-14 * terms  # a few roundings
        assert abs(n.mass_outer * rates.sum()) > 1e-3 * terms


# ---- closed form -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "other", [{}, {"mass_outer": 1.0, "mass_inner": 0.01}, {"mass_inner": 500.0, "stiffness": 30.0}]
)
def test_closed_form_is_exact_to_rounding(other: Values) -> None:
    times = np.linspace(0, 20, 11)
    n = {name: Decimal(value) for name, value in (defaults(LinearMolecule) | other).items()}
    outer, inner = n["stiffness"] / n["mass_outer"], n["stiffness"] / n["mass_inner"]
    # displacements u and their rates
    rates = [{(3,): 1}, {(4,): 1}, {(5,): 1}]
    rates += [{(0,): -outer, (1,): outer}, {(0,): inner, (1,): -2 * inner, (2,): inner}, {(1,): outer, (2,): -outer}]
    L = n["spacing"]
    u = [Decimal(START[f"x_{i}_0"]) - (i - 1) * L for i in ATOMS]
    u_dot = [Decimal(START.get(f"x_{i}_dot_0", 0.0)) for i in ATOMS]
    reference = taylor(times, [*u, *u_dot], rates)
    exact = LinearMolecule.exact(times, **START, **other)
    for i in ATOMS:
        # Roundings of a phase of up to 300 (the light inner atom) in amplitudes of 0.05 m, rates 14 times that.
        position = reference[i - 1] + (i - 1) * float(L)
        np.testing.assert_allclose(exact[f"x_{i}"], position, rtol=0, atol=1e-14)
        np.testing.assert_allclose(exact[f"x_{i}_dot"], reference[i + 2], rtol=0, atol=1e-13)
