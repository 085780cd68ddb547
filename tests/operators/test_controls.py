"""Forces as controls: feedback, observers and plans that set torques, alone and beside prescribed motions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm, solve_discrete_are

from liaisons import Controller, hold, observe
from liaisons.errors import LiaisonsError, PlanError

from .conftest import verified

Floats = Any
G = 9.81


def riccati(A: Floats, B: Floats, Q: Floats, R: Floats) -> Floats:
    """Solution of the discrete Riccati equation from the stable eigenvectors of its symplectic matrix."""
    n, inverse = len(A), np.linalg.inv(A).T
    S = B @ np.linalg.solve(R, B.T)
    symplectic = np.block([[A + S @ inverse @ Q, -S @ inverse], [-inverse @ Q, inverse]])
    values, vectors = np.linalg.eig(symplectic)
    stable = vectors[:, np.abs(values) < 1]
    return np.real(stable[n:] @ np.linalg.inv(stable[:n]))


def gains_with_delay(A: Floats, B: Floats, Q: Floats, R: Floats) -> Floats:
    """Gains of the states and of the force that acts: of what the states will be at the next sample."""
    P = riccati(A, B, Q, R)
    assert_allclose(P, solve_discrete_are(A, B, Q, R), rtol=1e-8)  # 16 digits less a condition number of 1e6
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    return np.hstack([K @ A, K @ B])


def held_constant(A: Floats, B: Floats, H: float) -> tuple[Floats, Floats]:
    """Matrices over a period of x' = A x + B u, with u constant in it."""
    n, k = B.shape
    flow = expm(H * np.block([[A, B], [np.zeros((k, n + k))]]))
    return flow[:n, :n], flow[:n, n:]


def furuta_upright() -> tuple[Floats, Floats, Floats]:
    """Mass matrix of the Furuta pendulum upside down, and A, B of (turn, swing, p_turn, p_swing), by hand.

    Linearised from Cazzolato and Prime (2011), eq. 33-34, with the numbers of the catalogue.
    """
    m, arm, rod = 0.075, 0.25, 0.15
    J_1, J_2, J_3 = 2e-3 + 0.3 * 0.1**2, 1e-4 + m * rod**2, 1e-6
    M = np.array([[J_1 + m * arm**2 + J_3, -m * arm * rod], [-m * arm * rod, J_2]])
    A, B = np.zeros((4, 4)), np.array([[0.0], [0], [1], [0]])
    A[:2, 2:], A[3, 1] = np.linalg.inv(M), m * G * rod
    return M, A, B


def test_gains_of_a_furuta_pendulum_are_those_of_our_own_riccati_equation() -> None:
    weights, effort = {"turn": 2.0, "swing": 1.0, "p_swing": 0.5}, 3.0
    held = hold("FurutaPendulum", {"swing": np.pi, "turn": 0.0}, controls="turn_force", step_size=0.005,
                weights=weights, effort=effort)  # fmt: skip
    assert held.states == ("turn", "swing", "p_turn", "p_swing", "turn_force")
    A, B = held_constant(*furuta_upright()[1:], 0.005)
    of_weights = np.array([2.0, 1.0, 0.0, 0.5]) / held.sizes[:4] ** 2
    expected = gains_with_delay(A, B, np.diag(of_weights), np.array([[effort / held.sizes[4] ** 2]]))
    assert_allclose(held.gains[0], expected, rtol=1e-8)  # of the equation's; the matrix of the step is good to 1e-10
    _, energy = furuta_upright()[0], held.energy
    assert held.sizes[4] == pytest.approx(energy, rel=1e-12)  # a torque does a typical work along one radian


@pytest.fixture(scope="module")
def furuta() -> Controller:
    return hold("FurutaPendulum", {"swing": np.pi, "turn": 0.0}, controls="turn_force", step_size=0.01,
                bounds={"turn_force": (-0.12, 0.15)})  # fmt: skip


def test_a_furuta_pendulum_stands_by_a_torque_within_bounds(furuta: Controller) -> None:
    verified(furuta)
    run = furuta.simulate(6, swing_0=np.pi + 0.07)
    torque = run["FurutaPendulum.turn_force"]
    assert torque.min() == pytest.approx(-0.12, abs=1e-15), "the bound is reached, and not exceeded"
    assert abs(run["FurutaPendulum.swing"][-1] - np.pi) < 1e-4 > abs(run["FurutaPendulum.turn"][-1])
    samples = np.round(run.time / 0.01, 9) % 1 == 0
    assert samples.all()
    gains, states = furuta.gains[0, 0], np.array([run[name] for name in furuta.signals])
    wanted = gains @ (furuta.trajectory.states[:, 0, None] - states)
    assert_allclose(torque[1:], wanted[:-1].clip(-0.12, 0.15), rtol=0, atol=1e-12)  # rounding; one sample later


def test_a_system_needs_no_setting_to_be_run_and_is_restored(furuta: Controller) -> None:
    system = furuta.system(swing_0=np.pi + 0.05)
    result = system.simulate(0.5)
    own = furuta.simulate(0.5, swing_0=np.pi + 0.05)
    assert not result.warnings
    assert_allclose(result["FurutaPendulum.swing"], own["FurutaPendulum.swing"], rtol=0, atol=1e-5)  # default tolerance
    with system.start(step_size=0.005) as run:
        for _ in range(41):  # half a period after a sample
            run.step()
        state = run.save()
        ends = []
        for _ in range(2):
            run.restore(state)
            for _ in range(30):
                run.step()
            ends.append([run[name] for name in ("FurutaPendulum.swing", "FurutaPendulum_turn_force.force")])
    assert_array_equal(*ends)


def test_start_values_of_a_force_act_until_the_next_sample(furuta: Controller) -> None:
    run = furuta.simulate(0.02, turn_force=0.1)
    assert run["FurutaPendulum.turn_force"][0] == 0.1
    A, B = held_constant(*furuta_upright()[1:], 0.01)
    states = [run[f"FurutaPendulum.{name}"][1] for name in ("turn", "swing", "p_turn", "p_swing")]
    assert_allclose(states, [0, np.pi, 0, 0] + 0.1 * B[:, 0], rtol=0, atol=2e-7)  # of second order: 0.01⁴ s⁴ times 16
    assert A.shape == (4, 4)


def test_forces_that_balance_weight_are_found() -> None:
    held = hold("Pendulum", {"theta": 1.0}, controls=["theta_force"], step_size=0.02, length=2.0, mass=0.5)
    assert held.starts["theta_force"] == pytest.approx(0.5 * G * 2 * np.sin(1.0), rel=1e-12)
    verified(held)
    with pytest.raises(PlanError, match=r"^Pendulum: this is no equilibrium: the rate of p_theta is -7\.25"):
        hold("Pendulum", {"theta": 1.0, "theta_force": 1.0}, controls="theta_force", step_size=0.02)


def test_viscous_friction_is_linearised() -> None:
    held = hold("Oscillator", {"x": 0.0}, controls="x_force", step_size=0.05, damping=0.3, mass=2.0, stiffness=5.0)
    A, B = held_constant(np.array([[0, 1 / 2.0], [-5.0, -0.3]]), np.array([[0.0], [1.0]]), 0.05)
    sizes = held.sizes
    expected = np.block([[A, B], [-held.gains[0]]]) * sizes / sizes[:, None]
    assert_allclose(held.loop, expected, rtol=0, atol=1e-10)  # error of the integration


def test_a_force_beside_a_prescribed_motion() -> None:
    held = hold("Pendulum", {"theta": np.pi, "pivot_x": 0.0}, "pivot_x", controls="theta_force", step_size=0.02)
    assert held.driven == ("pivot_x", "theta_force")
    assert held.states[2:] == ("pivot_x", "theta_force", "pivot_x_dot", "pivot_x_ddot")
    verified(held)
    run = held.simulate(theta_0=np.pi + 0.3, pivot_x=0.1)
    assert abs(run["Pendulum.theta"][-1] - np.pi) < 1e-5 > abs(run["Pendulum.pivot_x"][-1])
    assert np.abs(run["Pendulum.theta_force"]).max() > 0.1 < np.abs(run["Pendulum_pivot_x.y"]).max() + 0.1


def test_two_angles_show_a_furuta_pendulum_that_a_torque_holds() -> None:
    shown: Any = {
        "measured": ["turn", "swing"],
        "noise": {"turn": 1e-3, "swing": 1e-3},
        "disturbance": {"swing_force": 1e-3, "turn_load": 1e-3},
    }
    upright: Any = {"at": {"swing": np.pi, "turn": 0.0}, "controls": "turn_force", "step_size": 0.01}
    held = hold("FurutaPendulum", **upright, **shown)
    claims = verified(held)
    assert any("those of feedback and of the observer" in claim for claim in claims)
    assert any("a step costs" in claim for claim in claims)
    observer = observe("FurutaPendulum", **upright, **shown)
    A, _ = held_constant(*furuta_upright()[1:], 0.01)
    F, _, C = observer.model.start_matrices()
    size = observer.model.sizes
    assert_allclose(F * size[:, None] / size, A, rtol=3e-6, atol=1e-15)  # Runge-Kutta steps of an eighth of a radian
    P = riccati(A.T, C.T / size[:, None], *noise_matrices())
    assert_allclose(np.diag(observer.covariance) * size**2, np.diag(P), rtol=1e-5)


def noise_matrices() -> tuple[Floats, Floats]:
    """Covariances of what forces add in a period, constant in it, and of the readings, divided by their noise."""
    _, A, B = furuta_upright()
    _, on_turn = held_constant(A, B, 0.01)
    _, on_swing = held_constant(A, np.array([[0.0], [0], [0], [1]]), 0.01)
    pushes = np.hstack([on_turn, on_swing])
    return 1e-6 / 0.01 * pushes @ pushes.T, np.eye(2)


@pytest.mark.parametrize(
    ("subject", "arguments", "message"),
    [
        ("Pendulum", {"controls": "theta_farce"}, "Pendulum: controls = 'theta_farce' is no input force; did you mean"),
        ("Pendulum", {"controls": "pivot_x"}, "controls = 'pivot_x' is no input force: it is prescribed; give moves="),
        ("Pendulum", {"controls": ["theta_force"] * 2}, r"controls = .*: name each force once"),
        ("Pendulum", {"controls": 3}, "controls = 3"),
        ("Pendulum", {"controls": "theta_force", "theta_force": 1.0}, "theta_force is a control and cannot have the"),
        ("Pendulum", {"controls": "theta_force", "bounds": {"theta_force": (1, 2)}}, "low < 0.979366 < high"),
        ("Pendulum", {"controls": "theta_force", "bounds": {"x_force": (1, 2)}}, "the regulators bound theta_force$"),
        ("FurutaPendulum", {}, r"FurutaPendulum has no active coordinate: .*; give forces, controls=\['turn_force'"),
        ("DryOscillator", {"controls": "x_force"}, "DryOscillator: what is planned or held takes no .*friction"),
    ],
)
def test_refusals(subject: str, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(LiaisonsError, match=message):
        hold(subject, {}, step_size=0.01, **arguments)
