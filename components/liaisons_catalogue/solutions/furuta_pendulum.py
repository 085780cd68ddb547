"""The published equations of the Furuta pendulum."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.integration import integrate


@closed_form("the published equations of motion, integrated at 1e-13, without torque")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    mass, L, c_1 = at.pendulum_mass, at.swing_at_x, -at.pendulum_centre_z
    across, along = at.pendulum_inertia_xx + mass * c_1**2, at.pendulum_inertia_zz
    at.require(
        at.pendulum_inertia_xx == at.pendulum_inertia_yy,
        "pendulum_inertia_yy must be pendulum_inertia_xx: a pendulum round its rod",
    )
    arm = at.arm_inertia_zz + at.arm_mass * at.arm_centre_x**2 + mass * L**2

    def rates(_: float, y: NDArray) -> ArrayLike:
        _, theta, phi_dot, theta_dot = y
        s, c, twice = np.sin(theta), np.cos(theta), (across - along) * np.sin(2 * theta)
        masses = [[arm + across * s**2 + along * c**2, mass * L * c_1 * c], [mass * L * c_1 * c, across]]
        forces = [
            mass * L * c_1 * s * theta_dot**2 - twice * theta_dot * phi_dot,
            twice * phi_dot**2 / 2 - mass * at.gravity * c_1 * s,
        ]
        return [phi_dot, theta_dot, *np.linalg.solve(masses, forces)]

    names = ("turn", "swing", "turn_dot", "swing_dot")
    y = integrate(at, rates, at.array("turn_0", "swing_0", "turn_dot_0", "swing_dot_0"), t)
    return dict(zip(names, y, strict=True))
