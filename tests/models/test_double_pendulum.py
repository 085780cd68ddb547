"""DoublePendulum: Newton's law rod by rod, normal modes, and large motions."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hand_derivations import double_pendulum
from numpy.typing import NDArray
from on_paper import EXTRAPOLATE, State, Values, assert_follows, defaults, equations_of, mechanism, run, taylor
from scipy.integrate import solve_ivp

from liaisons.check import max_error, slope
from liaisons.models.double_pendulum import DoublePendulum

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


# ---- FMU ---------------------------------------------------------------------------------------------------------


SHORT: Any = {"stop_time": 5.0, "step_size": 0.05, "tolerance": 1e-12}


def test_small_motions_are_the_normal_modes_up_to_the_cube_of_the_amplitude(fmu) -> None:
    direction = np.array([0.8, -0.5])
    amplitudes, found = [0.2, 0.1, 0.05, 0.025, 0.0125], []
    for amplitude in amplitudes:
        theta = dict(zip(("theta_1_0", "theta_2_0"), amplitude * direction, strict=True))
        result = run(fmu(DoublePendulum), **SHORT, **theta)
        small = DoublePendulum.small_angles(result.time, **theta)
        found.append(max(max_error(result[q], small[q]) for q in ("theta_1", "theta_2")))
    assert 2.9 <= slope(amplitudes[1:], found[1:]) <= 3.1  # terms of fifth order: amplitude² relative


NAMES = ("theta_1", "theta_2", "theta_1_dot", "theta_2_dot")
LARGE: Any = {"theta_1_0": 1.2, "theta_2_0": -0.6, "theta_1_dot_0": 0.5, "mass_2": 0.6, "length_2": 0.8}


def test_large_motion_follows_newton(fmu) -> None:
    """Against an integration of the equations by hand; a disturbance grows 1e3-fold within these five seconds."""
    result = run(fmu(DoublePendulum), **SHORT, **LARGE)
    body = {"mass_2": 0.6, "length_2": 0.8}
    state = State(DoublePendulum, equations_of(DoublePendulum).numbers(body))

    def rates(_: float, y: NDArray) -> NDArray:
        state.update(zip(NAMES, y.tolist(), strict=True))
        return np.concatenate([y[2:], double_pendulum(state)["accelerations"]])

    reference = solve_ivp(rates, (0, 5), [1.2, -0.6, 0.5, 0.0], "DOP853", result.time, rtol=1e-12, atol=1e-12)
    assert_follows(result, dict(zip(NAMES, reference.y, strict=True)), 1e-12 * 10 * 1e3)


def test_energy_stays_where_chaos_leaves_nothing_else_to_compare(fmu) -> None:
    wild: Any = {"theta_1_0": 3.0, "theta_2_0": 2.0, "theta_2_dot_0": 1.0}
    result, disturbed = (
        run(fmu(DoublePendulum), stop_time=200.0, **wild | more) for more in ({}, {"theta_1_0": 3 + 1e-9})
    )
    assert max_error(result["theta_1"], disturbed["theta_1"]) > 1  # it is chaotic
    scale = float(np.max(result["kinetic_energy"]))
    assert max_error(result["energy"], result["energy"][0]) <= 10 * 1e-10 * scale * 200.0


def test_a_pivot_that_accelerates_upwards_is_more_gravity(fmu) -> None:
    a = 3.0
    lift = {"pivot_z": lambda t: (a * t**2 / 2, a * t, a)}
    # a parabola is its own Taylor polynomial
    rising = run(fmu(DoublePendulum), **SHORT, inputs=lift, input_reconstruction=EXTRAPOLATE, **LARGE)
    heavy = run(fmu(DoublePendulum), **SHORT, gravity=9.81 + a, **LARGE)
    for name in ("theta_1", "theta_2"):
        assert max_error(rising[name], heavy[name]) <= 1e-12 * 10 * 1e3, name  # as above
    # Seen from the ground the operator also lifts both masses; the force is the same.
    assert max_error(rising["pivot_z_force"], heavy["pivot_z_force"]) <= 1e-7  # accelerations of 1e2 m/s², as stiff
    assert max_error(rising["energy_balance"], 0.0) <= 10 * 1e-12 * 5 * float(np.max(np.abs(rising["energy"])))
