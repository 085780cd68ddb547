"""A SCARA robot has the mass matrix of the textbook, which depends only on the angle of the elbow.

Each axis of the Scara in turn is accelerated from rest by a unit of force or torque: the accelerations are columns of
the inverse of the mass matrix of Spong, Hutchinson and Vidyasagar.
"""

from __future__ import annotations

import numpy as np

from liaisons import simulate
from liaisons.models import Scara
from liaisons.scenarios import Claims, dots, panels, scenario, within

AXES = ("shoulder", "elbow", "turn")


@scenario
def main(claim: Claims) -> None:
    rounding = within(
        1e-10, because="rounding errors of the inverse of a matrix of condition 1e3, relative to its largest entry"
    )
    (axis,) = panels(
        ("acceleration of each axis by its own torque", "elbow [rad]", "M$^{-1}$ [1/(kg m²)]"), size=(7, 4)
    )
    elbows, inverses = np.linspace(0.0, 3.0, 7), []
    for elbow in elbows:
        columns = [
            [run[f"{name}_ddot"][0] for name in AXES]
            for driven in AXES
            for start in [{"elbow_0": elbow, f"{driven}_force": 1.0}]
            for run in [simulate("Scara", stop_time=1e-3, step_size=1e-3, start_values=start)]
        ]
        inverses.append(np.transpose(columns))
        identity = inverses[-1] @ Scara.mass_matrix(elbow)
        claim(f"elbow {elbow:.1f} rad: M times the accelerations gives the torque", identity, np.eye(3), rounding)
    fine = np.linspace(0.0, 3.0, 61)
    exact = np.array([np.linalg.inv(Scara.mass_matrix(elbow)) for elbow in fine])
    for k, name in enumerate(AXES):
        axis.semilogy(fine, exact[:, k, k], label=name)
        dots(axis, elbows, np.array(inverses)[:, k, k])
