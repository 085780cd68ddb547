"""The pendulum: period, action, small swings, and a length that grows evenly."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipe, ellipk, jv, yv

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic
from liaisons_catalogue.solutions.linear import coordinate_motion


@closed_form("the period [s]: 4 K(k)/Ω of a swing, 2 K(1/k)/kΩ of a full turn, else infinite", gravity="> 0")
def period(at: Values) -> float:
    return elliptic.period(at.theta_0, at.theta_dot_0, np.sqrt(at.gravity / at.length))


@closed_form("the action ∮ p dθ/2π [J.s] of a swing or of a full turn at constant length", gravity="> 0")
def action(theta: ArrayLike, theta_dot: ArrayLike, length: ArrayLike, at: Values) -> NDArray:
    """Return (8/π) m l² Ω (E(k) - (1 - k²) K(k)) of a swing, (4/π) m l² Ω k E(1/k) of a turn; states of any shape."""
    omega = np.sqrt(at.gravity / np.asarray(length))
    m = np.sin(np.asarray(theta) / 2) ** 2 + (np.asarray(theta_dot) / (2 * omega)) ** 2  # k²
    inside, outside = np.minimum(m, 1.0), 1 / np.maximum(m, 1.0)
    swinging = 2 * (ellipe(inside) - (1 - inside) * ellipk(np.where(m < 1, inside, 0.0)))
    whole = np.where(m < 1, swinging, np.sqrt(m) * ellipe(outside))
    return 4 / np.pi * at.mass * np.asarray(length) ** 2 * omega * whole


@closed_form("the motion for sin θ ≈ θ (K Ex. 3, 6), whose period is short by θ²/16", gravity="> 0")
def small_angle(t: NDArray, at: Values) -> dict[str, NDArray]:
    return coordinate_motion(t, at, "theta", omega_squared=at.gravity / at.length, gamma=at.friction)


@closed_form(
    "the motion for sin θ ≈ θ while the length grows evenly: Bessel functions", gravity="> 0", length_dot="!= 0"
)
def lengthening(t: NDArray, at: Values) -> dict[str, NDArray]:
    """Return θ and its rate: (l² θ')' = -g l θ has the solutions J1(x)/x and Y1(x)/x, x = 2 √(g l)/|l'|."""
    shortest = np.min(at.length + at.length_dot * t)
    at.require(shortest > 0, f"the length falls to {shortest} m; end before it reaches 0")

    def solutions(t: ArrayLike) -> NDArray:
        """Both solutions and their rates, shape (2, 2, ...): (θ or its rate, J or Y)."""
        x = 2 * np.sqrt(at.gravity * (at.length + at.length_dot * np.asarray(t))) / abs(at.length_dot)
        x_dot = 2 * at.gravity / (x * at.length_dot)
        return np.array([[bessel(1, x) / x for bessel in (jv, yv)], [-bessel(2, x) / x * x_dot for bessel in (jv, yv)]])

    amplitudes = np.linalg.solve(solutions(0.0), at.array("theta_0", "theta_dot_0"))
    return dict(zip(("theta", "theta_dot"), np.einsum("ij...,j->i...", solutions(t), amplitudes), strict=True))
