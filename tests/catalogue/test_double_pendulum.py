"""DoublePendulum: Newton's law rod by rod, normal modes, and large motions."""

from __future__ import annotations

from decimal import Decimal

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from on_paper import State, Values, defaults, equations_of, mechanism, taylor

from liaisons_catalogue.double_pendulum import DoublePendulum

# ---- normal modes ------------------------------------------------------------------------------------------------

SHAPES: list[Values] = [
    {},
    {"mass_2": 0.01},
    {"mass_1": 0.2, "mass_2": 3.0, "length_1": 0.4},
    {"mass_2": 1e-8, "length_2": 0.9},
    {"length_1": 2.0, "length_2": 0.3, "gravity": 1.6},
]


def matrices(shape: Values) -> tuple[NDArray, NDArray]:
    """M and K of M θ'' + K θ = 0 by hand: T = ½ m_1 l_1² θ_1'² + ½ m_2 (l_1 θ_1' + l_2 θ_2')²."""
    n = defaults(DoublePendulum) | shape
    m_1, m_2, l_1, l_2, g = (n[name] for name in ("mass_1", "mass_2", "length_1", "length_2", "gravity"))
    M = np.array([[(m_1 + m_2) * l_1**2, m_2 * l_1 * l_2], [m_2 * l_1 * l_2, m_2 * l_2**2]])
    return M, g * np.diag([(m_1 + m_2) * l_1, m_2 * l_2])


@pytest.mark.parametrize("shape", SHAPES)
def test_normal_modes_solve_the_equations_of_small_motion(shape: Values) -> None:
    M, K = matrices(shape)
    frequencies, modes = DoublePendulum.normal_modes(**shape)
    assert 0 < frequencies[0] < frequencies[1]
    for omega, mode in zip(frequencies, modes.T, strict=True):
        # Sums of two terms, up to fifteen times as large as their sum: a few roundings of each.
        np.testing.assert_allclose(omega**2 * M @ mode, K @ mode, rtol=1e-13)
    assert modes[1, 0] > 0 > modes[1, 1]  # to the same side, to opposite sides
    product = modes.T @ M @ modes  # orthogonal with M for weight
    assert abs(product[0, 1]) <= 1e-14 * np.sqrt(product[0, 0] * product[1, 1])


def test_equal_pendulums_have_the_modes_of_the_textbook() -> None:
    frequencies, modes = DoublePendulum.normal_modes()
    np.testing.assert_allclose(frequencies**2, 9.81 * (2 - np.sqrt(2) * np.array([1, -1])), rtol=1e-14)  # roundings
    np.testing.assert_allclose(modes, [[1, 1], [np.sqrt(2), -np.sqrt(2)]], rtol=1e-14)


@pytest.mark.parametrize("shape", SHAPES)
def test_derived_equations_are_those_of_small_motion_near_the_equilibrium(shape: Values) -> None:
    gradient = ca.jacobian(equations_of(DoublePendulum).accelerations, mechanism(DoublePendulum).free.q)
    M, K = matrices(shape)
    stiffness = M @ State(DoublePendulum, shape | {"theta_1": 0.0, "theta_2": 0.0})(gradient)
    np.testing.assert_allclose(stiffness, -K, rtol=0, atol=1e-12 * np.max(K))  # inverse of M and M, condition 1e2


@pytest.mark.parametrize("shape", SHAPES)
def test_small_angles_are_exact_to_rounding(shape: Values) -> None:
    times = np.linspace(0, 10, 11)
    n = {name: Decimal(value) for name, value in (defaults(DoublePendulum) | shape).items()}
    share = n["mass_2"] / (n["mass_1"] + n["mass_2"])
    g_1, g_2 = n["gravity"] / n["length_1"], n["gravity"] / n["length_2"]
    # l_1 θ_1'' + share l_2 θ_2'' = -g θ_1 and l_1 θ_1'' + l_2 θ_2'' = -g θ_2, solved for the accelerations
    first = {(0,): -g_1 / (1 - share), (1,): share * g_1 / (1 - share)}
    second = {(0,): g_2 / (1 - share), (1,): -g_2 / (1 - share)}
    reference = taylor(times, [0.03, -0.02, 0.1, 0.05], [{(2,): 1}, {(3,): 1}, first, second])
    start = {"theta_1_0": 0.03, "theta_2_0": -0.02, "theta_1_dot_0": 0.1, "theta_2_dot_0": 0.05}
    exact = DoublePendulum.small_angles(times, **start, **shape)
    largest = max(
        1.0, float(np.max(DoublePendulum.normal_modes(**shape)[1]))
    )  # θ_2/θ_1, to 1e4 in the weakest coupling
    for name, expected in zip(exact, reference, strict=True):
        # Roundings of a phase of up to 200 in angles of 0.1 and rates of 1.
        np.testing.assert_allclose(exact[name], expected, rtol=0, atol=1e-13 * largest, err_msg=name)
