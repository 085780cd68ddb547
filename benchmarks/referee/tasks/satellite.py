"""A satellite that tumbles while all of its three wheels are turned."""

import numpy as np

from referee.equations import integrated
from referee.task import Task, sinusoid

INERTIAS, WHEEL = np.array([10.0, 12.0, 8.0]), 0.1  # [kg.m2], with the wheels locked
TURNS = (sinusoid(0.0, 40.0, 0.7), sinusoid(20.0, 20.0, 1.1, -1.5), sinusoid(5.0, 30.0, 0.5, 0.4))
SPIN = (0.1, -0.05, 0.2)  # [rad/s]


def dynamics(t, y):
    """Euler: J ω' + J_w φ'' = (J ω + J_w φ') × ω."""
    w, v, omega = y[0], y[1:4], y[4:7]
    _, turn, faster = np.array([motion(t) for motion in TURNS]).T
    spin = (np.cross(INERTIAS * omega + WHEEL * turn, omega) - WHEEL * faster) / INERTIAS
    torque = WHEEL * (faster + spin)
    energy = (INERTIAS * omega) @ omega / 2 + WHEEL * (omega + turn / 2) @ turn
    quaternion = np.hstack([-v @ omega, w * omega + np.cross(v, omega)]) / 2
    return np.hstack([quaternion, spin, torque @ turn]), torque[0], energy


TASK = Task(
    "satellite",
    4.8,
    {f"wheel_{axis}": turn for axis, turn in enumerate(TURNS, 1)},
    ["attitude"],
    "Satellite",
    integrated(dynamics, [1.0, 0.0, 0.0, 0.0, *SPIN, 0.0], 4, {}),
    spin=SPIN,
    parameters={f"omega_{axis}_0": rate for axis, rate in zip("xyz", SPIN, strict=True)},
    signals=["q_w", "q_x", "q_y", "q_z"],
)
