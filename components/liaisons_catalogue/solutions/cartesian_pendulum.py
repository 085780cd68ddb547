"""The pendulum in Cartesian coordinates."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic


@closed_form("the motion of Pendulum with a fixed rod, from the angle theta_0 at the rate theta_dot_0", gravity="> 0")
def exact(t: NDArray, at: Values, *, theta_0: float = 0.1, theta_dot_0: float = 0.0) -> dict[str, NDArray]:
    theta, rate = elliptic.pendulum(t, theta_0, theta_dot_0, np.sqrt(at.gravity / at.rod))
    x, depth = at.rod * np.sin(theta), at.rod * np.cos(theta)
    lambda_1 = -at.mass * (at.rod * rate**2 + at.gravity * np.cos(theta)) / (2 * at.rod)
    return {"x": x, "z": at.height - depth, "x_dot": depth * rate, "z_dot": x * rate, "lambda_1": lambda_1}
