"""Feedback by a motor's torque holds a Furuta pendulum upright; its gains solve an independent Riccati equation.

The torque of the motor is constant from sample to sample.  The torque computed at one sample acts from the next,
so the gains K multiply the states that are predicted for the next sample, A x + B u.  The reference is linearised by
hand from Cazzolato and Prime (2011), eq. 33-34, and uses the stable eigenvectors of the symplectic matrix.  ``hold``
differentiates the equations that follow from the Lagrangian, and uses SciPy's solver.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from liaisons import hold
from liaisons.scenarios import Claims, panels, scenario, within

STEP, STOP, TILT, MOST = 0.01, 6.0, 0.07, 0.12
WEIGHTS, EFFORT = {"turn": 2.0, "swing": 1.0, "p_swing": 0.5}, 3.0
PENDULUM, ARM, ROD, GRAVITY = 0.075, 0.25, 0.15, 9.81  # kg, m, m, m/s²
INERTIAS = 2e-3 + 0.3 * 0.1**2, 1e-4 + PENDULUM * ROD**2, 1e-6  # of arm and pendulum about their joints, of its axis


def upright_over_a_period() -> tuple[NDArray, NDArray]:
    """A and B of (turn, swing, p_turn, p_swing) over a period in which the torque is constant, by hand."""
    (J_1, J_2, J_3), A, B = INERTIAS, np.zeros((4, 4)), np.array([[0.0], [0], [1], [0]])
    coupling = -PENDULUM * ARM * ROD
    A[:2, 2:] = np.linalg.inv([[J_1 + PENDULUM * ARM**2 + J_3, coupling], [coupling, J_2]])
    A[3, 1] = PENDULUM * GRAVITY * ROD
    flow = expm(STEP * np.block([[A, B], [np.zeros((1, 5))]]))
    return flow[:4, :4], flow[:4, 4:]


def riccati(A: NDArray, B: NDArray, Q: NDArray, R: NDArray) -> NDArray:
    """Solution of the discrete Riccati equation, from the stable eigenvectors of its symplectic matrix."""
    inverse, S = np.linalg.inv(A).T, B @ np.linalg.solve(R, B.T)
    values, vectors = np.linalg.eig(np.block([[A + S @ inverse @ Q, -S @ inverse], [-inverse @ Q, inverse]]))
    stable = vectors[:, np.abs(values) < 1]
    return np.real(stable[len(A) :] @ np.linalg.inv(stable[: len(A)]))


@scenario
def main(claim: Claims) -> None:
    upright = {"swing": np.pi, "turn": 0.0}
    regulator = hold(
        "FurutaPendulum",
        upright,
        controls="turn_force",
        step_size=STEP,
        weights=WEIGHTS,
        effort=EFFORT,
        bounds={"turn_force": (-MOST, MOST)},
    )
    claim.verdicts += regulator.verify()
    A, B = upright_over_a_period()
    sizes = regulator.sizes
    Q = np.diag(np.array([WEIGHTS.get(name, 0.0) for name in regulator.states[:4]]) / sizes[:4] ** 2)
    R = np.array([[EFFORT / sizes[4] ** 2]])
    P = riccati(A, B, Q, R)
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    eight = within(1e-8, because="rounding errors times the eigenvectors' condition, 1e-10 by linearising")
    claim("gains, against our own Riccati equation", regulator.gains[0, 0] / np.hstack([K @ A, K @ B])[0], 1.0, eight)
    held = np.sort(np.abs(regulator.floquet_multipliers))[::-1]
    closed = np.block([[A, B], [-K @ A, -K @ B]])
    own = np.sort(np.abs(np.linalg.eigvals(closed)))[::-1]
    claim("multipliers, largest first", held, own, within(1e-6, because="the smallest are roots of rounding errors"))

    run = regulator.simulate(STOP, swing_0=np.pi + TILT)
    torque, angle = run["FurutaPendulum.turn_force"], run["FurutaPendulum.swing"] - np.pi
    bounded = within(1e-12, "N.m", because="the torque is limited to this value, and reaches it at least once")
    claim("the torque reaches its bounds and does not exceed them", np.abs(torque).max(), MOST, bounded)
    settled = within(1e-9, "rad", because="0.95, the largest multiplier, to the power of 600 samples is 4e-14")
    claim("from 0.07 rad it comes back upright", angle[-1], 0.0, settled)
    power = np.append(0.0, np.cumsum(torque[:-1] * np.diff(run["FurutaPendulum.turn"])))
    fall = PENDULUM * GRAVITY * ROD * (1 - np.cos(TILT))
    work = within(1e-9, "J", because="at rest again up to the previous claim's bound; solver tolerance 1e-11")
    claim("the torque's work lifts the pendulum, m g l (1 - cos 0.07)", power[-1], fall, work)

    tilt, arm, motor = panels(
        ("upright is 0", "t [s]", "θ - π [rad]"), ("arm", "t [s]", "φ [rad]"), ("motor", "t [s]", "torque [N m]")
    )
    tilt.plot(run.time, angle)
    arm.plot(run.time, run["FurutaPendulum.turn"])
    motor.step(run.time, torque, where="post")
