"""Equilibria and normal modes against characteristic polynomials solved by hand."""

import numpy as np
import pytest

from liaisons.models import (
    Flywheel,
    LinearMolecule,
    Oscillator,
    Swing,
)
from liaisons_motion import analysis

ROUNDING = 1e-12  # diagonalisation of matrices of order 3 and condition below 100


def test_modes_of_the_molecule() -> None:
    """K Ex. 11: Ω² = 0, κ/m, κ (1/m + 2/M) are the eigenvalues, which the text calls frequencies (KA16)."""
    m, M, kappa = 16.0, 12.0, 3.0
    found = analysis.normal_modes(LinearMolecule, x_1=0.0, mass_outer=m, mass_inner=M, stiffness=kappa)
    squares = np.array([0.0, kappa / m, kappa * (1 / m + 2 / M)])
    np.testing.assert_allclose(found.squares, squares, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(found.frequencies, np.sqrt(squares), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(found.mass, np.diag([m, M, m]), rtol=ROUNDING)
    np.testing.assert_allclose(
        found.stiffness, kappa * np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1]]), rtol=0, atol=ROUNDING
    )
    assert found.zero_modes == 1
    assert found.equilibrium == pytest.approx({"x_1": 0.0, "x_2": 0.116, "x_3": 0.232}, abs=1e-15)


def test_modes_have_unit_mass_not_unit_length() -> None:
    """u_kᵀ M u_l = δ_kl (K eq. 151); K eq. 158 gives the same directions as unit vectors (KB12)."""
    m, M = 16.0, 12.0
    modes = analysis.normal_modes(LinearMolecule, mass_outer=m, mass_inner=M).modes
    np.testing.assert_allclose(modes.T @ np.diag([m, M, m]) @ modes, np.eye(3), rtol=0, atol=ROUNDING)
    printed = np.array([[1, 1, 1], [-1, 0, 1], [1, -2 * m / M, 1]]).T
    printed = printed / np.linalg.norm(printed, axis=0)
    lengths = np.linalg.norm(modes, axis=0)
    np.testing.assert_allclose(np.abs(np.sum(modes / lengths * printed, axis=0)), 1, rtol=ROUNDING)
    assert np.all(np.abs(lengths - 1) > 0.5)


def test_equilibrium_of_the_leaning_swing() -> None:
    """The centre of mass hangs under the pivot; Ω² = D/I (M eq. 54-56)."""
    m, b, rope, lean = 20.0, 0.5, 2.0, 1.1
    across, along = m * b * np.sin(lean), 2 * m * rope + m * b * np.cos(lean)
    found = analysis.normal_modes(Swing, lean=lean)
    assert found.equilibrium["theta"] == pytest.approx(-np.arctan2(across, along), rel=ROUNDING)
    inertia = m * rope**2 + m * (rope**2 + b**2 + 2 * rope * b * np.cos(lean))
    assert found.squares == pytest.approx([9.81 * np.hypot(across, along) / inertia], rel=ROUNDING)


def test_equilibrium_under_a_force_and_a_moved_support() -> None:
    """x = x_0 + F/K: drives less loads."""
    found = analysis.equilibrium(Oscillator, support=2.0, x_force=5.0, x_load=2.0, stiffness=4.0)
    assert found == pytest.approx({"x": 2.75}, rel=ROUNDING)
    assert analysis.equilibrium(Flywheel, angle=0.7) == {"angle": 0.7}  # at rest anywhere
