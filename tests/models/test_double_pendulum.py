"""DoublePendulum: Newton's law rod by rod, normal modes, and large motions."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons.check import max_error, slope
from liaisons.cosim import simulate
from liaisons.mechanics import derive
from liaisons.models.double_pendulum import DoublePendulum

State = dict[str, float]

# ---- Newton's law ------------------------------------------------------------------------------------------------


def dot(a: complex, b: complex) -> float:
    """Scalar product of two plane vectors x + i z."""
    return (a.conjugate() * b).real


def by_hand(n: State) -> dict[str, NDArray]:
    """Both bobs and both massless rods cut free: angular accelerations and tensions from four balances of forces.

    A couple on a massless rod is a pair of forces across it, at its ends.
    """
    m_1, m_2, l_1, l_2, g = (n[name] for name in ("mass_1", "mass_2", "length_1", "length_2", "gravity"))
    along_1, along_2 = (-1j * np.exp(1j * n[q]) for q in ("theta_1", "theta_2"))
    w_1, w_2 = n["theta_1_dot"], n["theta_2_dot"]
    pivot = n["pivot_x_ddot"] + 1j * n["pivot_z_ddot"]
    load_1, load_2 = (n[f"bob_{i}_x_load"] + 1j * n[f"bob_{i}_z_load"] for i in (1, 2))
    push_1 = (n["theta_1_force"] - n["theta_1_load"]) / l_1 * 1j * along_1
    push_2 = (n["theta_2_force"] - n["theta_2_load"]) / l_2 * 1j * along_2

    def accelerations(alpha_1: float, alpha_2: float) -> tuple[complex, complex]:
        first = pivot + l_1 * along_1 * (1j * alpha_1 - w_1**2)
        return first, first + l_2 * along_2 * (1j * alpha_2 - w_2**2)

    def missing(alpha_1: float, alpha_2: float, pull_1: float, pull_2: float) -> NDArray:
        """Mass × acceleration - force of both bobs, as four real numbers."""
        a_1, a_2 = accelerations(alpha_1, alpha_2)
        first = m_1 * (a_1 + 1j * g) + load_1 + pull_1 * along_1 - pull_2 * along_2 - push_1 + push_2
        second = m_2 * (a_2 + 1j * g) + load_2 + pull_2 * along_2 - push_2
        return np.array([first.real, first.imag, second.real, second.imag])

    zero = missing(0, 0, 0, 0)
    columns = [missing(*unit) - zero for unit in np.eye(4)]
    alpha_1, alpha_2, *_ = np.linalg.solve(np.array(columns).T, -zero)
    a_1, a_2 = accelerations(alpha_1, alpha_2)
    held = m_1 * (a_1 + 1j * g) + load_1 + m_2 * (a_2 + 1j * g) + load_2  # what is not weight or load: the pivot's
    v_1 = n["pivot_x_dot"] + 1j * n["pivot_z_dot"] + 1j * l_1 * along_1 * w_1
    v_2 = v_1 + 1j * l_2 * along_2 * w_2
    momenta = [dot(1j * l_1 * along_1, m_1 * v_1 + m_2 * v_2), dot(1j * l_2 * along_2, m_2 * v_2)]
    return {
        "accelerations": np.array([alpha_1, alpha_2]),
        "operator_forces": np.array([held.real, held.imag]),
        "momenta": np.array(momenta),
    }


def test_motion_and_pivot_force_are_newtons(random_states) -> None:
    equations = derive(DoublePendulum)
    for n in random_states(equations):
        for quantity, expected in by_hand(n).items():
            # Two orders of evaluation, and a mass matrix whose condition reaches a hundred.
            np.testing.assert_allclose(equations.evaluate(quantity, **n), expected, rtol=1e-11, atol=1e-10)


# ---- normal modes ------------------------------------------------------------------------------------------------

SHAPES: list[State] = [
    {},
    {"mass_2": 0.01},
    {"mass_1": 0.2, "mass_2": 3.0, "length_1": 0.4},
    {"mass_2": 1e-8, "length_2": 0.9},
    {"length_1": 2.0, "length_2": 0.3, "gravity": 1.6},
]


def matrices(shape: State) -> tuple[NDArray, NDArray]:
    """M and K of M θ'' + K θ = 0 by hand: T = ½ m_1 l_1² θ_1'² + ½ m_2 (l_1 θ_1' + l_2 θ_2')²."""
    n = {item.name: item.start for item in DoublePendulum.parameters} | shape
    m_1, m_2, l_1, l_2, g = (n[name] for name in ("mass_1", "mass_2", "length_1", "length_2", "gravity"))
    M = np.array([[(m_1 + m_2) * l_1**2, m_2 * l_1 * l_2], [m_2 * l_1 * l_2, m_2 * l_2**2]])
    return M, g * np.diag([(m_1 + m_2) * l_1, m_2 * l_2])


@pytest.mark.parametrize("shape", SHAPES)
def test_normal_modes_solve_the_equations_of_small_motion(shape: State) -> None:
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
def test_derived_equations_are_those_of_small_motion_near_the_equilibrium(shape: State, number) -> None:
    equations = derive(DoublePendulum)
    gradient = ca.jacobian(equations.accelerations, equations.mechanism.free.q)
    hanging = dict.fromkeys(equations.symbols, 0.0) | {p.name: p.start for p in DoublePendulum.parameters} | shape
    M, K = matrices(shape)
    stiffness = M @ number(equations, gradient, hanging)
    np.testing.assert_allclose(stiffness, -K, rtol=0, atol=1e-12 * np.max(K))  # inverse of M and M, condition 1e2


@pytest.mark.parametrize("shape", SHAPES)
def test_small_angles_are_exact_to_rounding(shape: State, taylor) -> None:
    times = np.linspace(0, 10, 11)
    n = {item.name: Decimal(item.start) for item in DoublePendulum.parameters}
    n |= {name: Decimal(value) for name, value in shape.items()}
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


def test_small_motions_are_the_normal_modes_up_to_the_cube_of_the_amplitude(fmu) -> None:
    direction = np.array([0.8, -0.5])
    amplitudes, found = [0.2, 0.1, 0.05, 0.025, 0.0125], []
    for amplitude in amplitudes:
        theta = dict(zip(("theta_1_0", "theta_2_0"), amplitude * direction, strict=True))
        result = simulate(fmu(DoublePendulum), stop_time=5.0, step_size=0.05, tolerance=1e-12, **theta)
        small = DoublePendulum.small_angles(result.time, **theta)
        found.append(max(max_error(result[q], small[q]) for q in ("theta_1", "theta_2")))
    assert 2.9 <= slope(amplitudes[1:], found[1:]) <= 3.1  # terms of fifth order: amplitude² relative


LARGE: Any = {"theta_1_0": 1.2, "theta_2_0": -0.6, "theta_1_dot_0": 0.5, "mass_2": 0.6, "length_2": 0.8}


def test_large_motion_follows_newton(fmu) -> None:
    """Against an integration of the equations by hand; a disturbance grows 1e3-fold within these five seconds."""
    result = simulate(fmu(DoublePendulum), stop_time=5.0, step_size=0.05, tolerance=1e-12, **LARGE)
    zero = dict.fromkeys(derive(DoublePendulum).symbols, 0.0)
    zero |= {p.name: p.start for p in DoublePendulum.parameters} | {"mass_2": 0.6, "length_2": 0.8}

    def rates(_: float, y: NDArray) -> NDArray:
        state = zero | dict(zip(("theta_1", "theta_2", "theta_1_dot", "theta_2_dot"), y.tolist(), strict=True))
        return np.concatenate([y[2:], by_hand(state)["accelerations"]])

    reference = solve_ivp(rates, (0, 5), [1.2, -0.6, 0.5, 0.0], "DOP853", result.time, rtol=1e-12, atol=1e-12)
    for name, values in zip(("theta_1", "theta_2", "theta_1_dot", "theta_2_dot"), reference.y, strict=True):
        assert max_error(result[name], values) <= 1e-12 * 10 * 1e3, name


def test_energy_stays_where_chaos_leaves_nothing_else_to_compare(fmu) -> None:
    wild: Any = {"theta_1_0": 3.0, "theta_2_0": 2.0, "theta_2_dot_0": 1.0}
    tolerance, stop_time = 1e-10, 200.0
    result = simulate(fmu(DoublePendulum), stop_time=stop_time, step_size=0.1, tolerance=tolerance, **wild)
    disturbed = simulate(
        fmu(DoublePendulum), stop_time=stop_time, step_size=0.1, tolerance=tolerance, **(wild | {"theta_1_0": 3 + 1e-9})
    )
    assert max_error(result["theta_1"], disturbed["theta_1"]) > 1  # it is chaotic
    scale = float(np.max(result["kinetic_energy"]))
    assert max_error(result["energy"], result["energy"][0]) <= 10 * tolerance * scale * stop_time


def test_a_pivot_that_accelerates_upwards_is_more_gravity(fmu) -> None:
    a = 3.0
    rising = simulate(
        fmu(DoublePendulum),
        stop_time=5.0,
        step_size=0.05,
        tolerance=1e-12,
        inputs={"pivot_z": lambda t: (a * t**2 / 2, a * t, a)},
        input_reconstruction=1,  # a parabola is its own Taylor polynomial
        **LARGE,
    )
    heavy = simulate(fmu(DoublePendulum), stop_time=5.0, step_size=0.05, tolerance=1e-12, gravity=9.81 + a, **LARGE)
    for name in ("theta_1", "theta_2"):
        assert max_error(rising[name], heavy[name]) <= 1e-12 * 10 * 1e3, name  # as above
    # Seen from the ground the operator also lifts both masses; the force is the same.
    assert max_error(rising["pivot_z_force"], heavy["pivot_z_force"]) <= 1e-7  # accelerations of 1e2 m/s², as stiff
    assert max_error(rising["energy_balance"], 0.0) <= 10 * 1e-12 * 5 * float(np.max(np.abs(rising["energy"])))
