"""The bead on a hoop that turns at a constant rate, from Jacobi's integral: ½ ξ_dot² - ½ β_dot² r² is constant."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

from liaisons.models.solutions import elliptic
from liaisons.models.solutions.integration import integrate
from liaisons.models.solutions.validity import require


def elliptic_hoop(
    where: str, t: NDArray, u_0: float, u_dot_0: float, *, axes: tuple[float, float], beta_dot: float
) -> tuple[NDArray, NDArray]:
    """Eccentric anomaly u and ξ_dot of the bead on an ellipse that turns about its centre.

    In a time τ with dt = (dξ/du) dτ Jacobi's integral is that of a pendulum: its angle is 2u, its frequency
    |β_dot| √|a² - b²|; t(τ) is a quadrature.

    :param where: who asks, for the error.
    :param axes: semi-axes a and b [m]; u is counted from a.
    :raises ValidityError: for a negative time.
    """
    a, b = axes
    frequency = abs(beta_dot) * np.sqrt(abs(a**2 - b**2))
    lowest = 0.0 if a > b else np.pi / 2  # the bead swings about the far ends of the longer axis

    def speed(u: ArrayLike) -> NDArray:
        return np.hypot(a * np.sin(u), b * np.cos(u))

    v_0 = float(speed(np.asarray(u_0))) * u_dot_0  # du/dτ = ξ_dot

    def motion(tau: NDArray) -> tuple[NDArray, NDArray]:
        if frequency == 0:
            return u_0 + v_0 * tau, np.full_like(tau, v_0)
        twice, rate = elliptic.pendulum(tau, 2 * (u_0 - lowest), 2 * v_0, frequency)
        return twice / 2 + lowest, rate / 2

    (tau,) = integrate(where, lambda tau: 1 / speed(motion(tau)[0]), [0.0], t)
    return motion(tau)


def fourier_hoop(
    where: str, t: NDArray, theta_0: float, theta_dot_0: float, *, radius: float, waves: NDArray, beta_dot: float
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """θ, θ_dot, ξ and ξ_dot of a bead that goes round on r(θ) = radius (1 + Re Σ waves_k e^ikθ), k = 1, 2, ...

    :raises ValidityError: for a negative time, if r is not positive, or if the bead turns back.
    """
    k = np.arange(1, waves.size + 1)

    def radius_and_speed(theta: ArrayLike) -> tuple[NDArray, NDArray]:
        terms = waves * np.exp(1j * np.multiply.outer(theta, k))
        r, slope = radius * (1 + np.real(terms).sum(-1)), radius * np.real(1j * k * terms).sum(-1)
        return r, np.hypot(r, slope)

    r, _ = radius_and_speed(np.linspace(0, 2 * np.pi, 1000))
    require(bool(np.all(r > 0)), f"{where}: the least r = {np.min(r)} must be > 0")
    r_0, speed_0 = radius_and_speed(theta_0)
    v_0 = speed_0 * theta_dot_0
    least = v_0**2 + beta_dot**2 * (np.min(r) ** 2 - r_0**2)
    require(
        bool(beta_dot == 0 or least > 0),
        f"{where}: the bead turns back; theta_dot_0 = {theta_dot_0} must be larger for it to go round",
    )

    def rates(y: NDArray) -> NDArray:
        r, speed = radius_and_speed(y[0])
        xi_dot = np.sign(v_0) * np.sqrt(v_0**2 + beta_dot**2 * (r**2 - r_0**2))
        return np.array([xi_dot / speed, xi_dot])

    xi_0, _ = quad(lambda theta: radius_and_speed(theta)[1], 0, theta_0, epsabs=1e-13, epsrel=1e-13, limit=200)
    theta, xi = y = integrate(where, rates, [theta_0, xi_0], t)
    theta_dot, xi_dot = rates(y)
    return theta, theta_dot, xi, xi_dot
