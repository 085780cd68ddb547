"""Parallelograms in a row that move as such: all standing rods at one angle, J θ'' = -G cos θ."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic


def _frequency(at: Values, component: Any) -> float:
    """Frequency √(G/J) of a row of parallelograms [rad/s]."""
    windows = component.windows
    return float(np.sqrt(at.gravity / at.length * ((windows + 1) / 2 + windows) / ((windows + 1) / 3 + windows)))


@closed_form("all standing rods at one angle: θ + π/2 moves like a pendulum, by Jacobi's functions", gravity="> 0")
def exact(
    t: NDArray, at: Values, component: Any, theta_0: float = np.pi / 2, theta_dot_0: float = -1.0
) -> dict[str, NDArray]:
    angle, rate = elliptic.pendulum(t, theta_0 + np.pi / 2, theta_dot_0, _frequency(at, component))
    return {"theta": angle - np.pi / 2, "theta_dot": rate}


@closed_form("λ_1 sin θ [N], the force of the first lying rod but for its pole where sin θ = 0", gravity="> 0")
def pull(theta: ArrayLike, at: Values, component: Any) -> NDArray:
    """Return λ_1 sin θ from the equation of the first rod, (1/3 + 1/2) m l² θ'' = -m g l cos θ + λ_1 l sin θ."""
    return at.mass * (at.gravity - 5 / 6 * at.length * _frequency(at, component) ** 2) * np.cos(theta)
