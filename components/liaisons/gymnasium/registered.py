"""Environments by name: ``gymnasium.make("liaisons/SwingUp-v0")``."""

from __future__ import annotations

from typing import Any

import gymnasium

_TASKS: dict[str, dict[str, Any]] = {
    "SwingUp": {
        "subject": "Pendulum",
        "observe": ["cos(theta)", "sin(theta)", "theta_dot", "pivot_x", "pivot_x_dot"],
        "act": {"pivot_x_ddot": (-8.0, 8.0)},
        "reward": "(1 - cos(theta))/2 - 0.001*pivot_x_ddot**2",
        "step_size": 0.02,
        "stop": "abs(pivot_x) - 2",
        "stop_time": 4.0,
        "randomize": {"theta_0": (-0.05, 0.05)},
        "goal": {"bounds": {"pivot_x": (-2.0, 2.0)}, "accuracy": 1e-4},
    },
    "FallingCat": {
        "subject": "PlanarCat",
        "observe": ["phi", "psi_1", "psi_2"],
        "act": {"psi_1_dot": (-15.0, 15.0), "psi_2_dot": (-15.0, 15.0)},
        "reward": "-phi_dot - 2*(psi_1*psi_1_dot + psi_2*psi_2_dot) - 0.0005*(psi_1_dot**2 + psi_2_dot**2)",
        "step_size": 0.02,
        "stop_time": 0.9,
        "randomize": {"arm_1": (0.2, 0.3), "arm_2": (0.2, 0.3)},
        "start_values": {"phi_dot_0": 0.0},
        "goal": {"accuracy": 1e-4},
    },
    "CraneShift": {
        "subject": "Pendulum",
        "observe": ["theta", "theta_dot", "pivot_x", "pivot_x_dot", "length", "length_dot"],
        "act": {"pivot_x_ddot": (-2.0, 2.0), "length_ddot": (-0.5, 0.5)},
        "reward": "-(bob_x - 1)**2 - (bob_z + 0.8)**2 - 0.01*(pivot_x_ddot**2 + length_ddot**2)",
        "step_size": 0.05,
        "stop_time": 4.0,
        "randomize": {"length": (0.9, 1.1)},
        "start_values": {"theta_0": 0.0},
        "goal": {"accuracy": 1e-4},
    },
    "TorqueFreeTurn": {
        "subject": "Satellite",
        "observe": ["q_w", "q_x", "q_y", "q_z"],
        "act": {"wheel_1_dot": (-300.0, 300.0), "wheel_2_dot": (-300.0, 300.0)},
        "reward": "0.5*(q_w*omega_z + q_x*omega_y - q_y*omega_x) - 2e-6*(wheel_1_dot**2 + wheel_2_dot**2)",
        "step_size": 0.05,
        "stop_time": 2.0,
        "randomize": {"J_zz": (7.0, 9.0)},
        "start_values": {"J_yy": 10.0},
        "goal": {"accuracy": None},
    },
}


def register_environments() -> None:
    """Make the environments known to Gymnasium."""
    for name, settings in _TASKS.items():
        gymnasium.register(
            f"liaisons/{name}-v0",
            "liaisons.gymnasium:Environment",
            vector_entry_point="liaisons.gymnasium:VectorEnvironment",
            kwargs=settings,
        )
