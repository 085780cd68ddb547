"""The bead on a hoop of any shape at constant rate, from Jacobi's integral: ½ ξ_dot² - ½ β_dot² r² is constant."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.integration import integrate
from liaisons_catalogue.solutions.slow_turn import SLOW_TURN, SlowTurn


@closed_form("by one quadrature, for a bead that goes round while the hoop turns at constant rate", t=">= 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    """Return θ, ξ and their rates; r must be positive, and the bead must not turn back."""
    waves, k, Y = fourier_waves(at), np.arange(1, 5), at.beta_dot

    def radius_and_speed(theta: ArrayLike) -> tuple[NDArray, NDArray]:
        """Radius r and length dξ/dθ."""
        terms = waves * np.exp(1j * np.multiply.outer(theta, k))
        r, slope = at.radius * (1 + np.real(terms).sum(-1)), at.radius * np.real(1j * k * terms).sum(-1)
        return r, np.hypot(r, slope)

    r, _ = radius_and_speed(np.linspace(0, 2 * np.pi, 1000))
    at.require(np.all(r > 0), f"the least r = {np.min(r)} must be > 0")
    r_0, speed_0 = radius_and_speed(at.theta_0)
    v_0 = speed_0 * at.theta_dot_0
    least = v_0**2 + Y**2 * (np.min(r) ** 2 - r_0**2)
    at.require(
        bool(Y == 0 or least > 0),
        f"the bead turns back; theta_dot_0 = {at.theta_dot_0} must be larger for it to go round",
    )

    def rates(_: float, y: NDArray) -> NDArray:
        """Rates of θ and ξ."""
        r, speed = radius_and_speed(y[0])
        xi_dot = np.sign(v_0) * np.sqrt(v_0**2 + Y**2 * (r**2 - r_0**2))
        return np.array([xi_dot / speed, xi_dot])

    xi_0, _ = quad(lambda theta: radius_and_speed(theta)[1], 0, at.theta_0, epsabs=1e-13, epsrel=1e-13, limit=200)
    theta, xi = y = integrate(at, rates, [at.theta_0, xi_0], t)
    theta_dot, xi_dot = rates(0.0, y)
    return {"theta": theta, "theta_dot": theta_dot, "xi": xi, "xi_dot": xi_dot}


@closed_form(SLOW_TURN)
def slow_turn(at: Values) -> SlowTurn:
    waves = {1: complex(at.radius)}
    for k, wave in enumerate(at.radius / 2 * fourier_waves(at), 1):
        waves |= {1 + k: wave, 1 - k: wave.conjugate()}
    return SlowTurn(waves)


def fourier_waves(at: Values) -> NDArray:
    """Complex coefficients w_k, k = 1 to 4: r/radius = 1 + Re Σ w_k e^ikθ."""
    return at.array(*(f"cos_{k}" for k in range(1, 5))) - 1j * at.array(*(f"sin_{k}" for k in range(1, 5)))
