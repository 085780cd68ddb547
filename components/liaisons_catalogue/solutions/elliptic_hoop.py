"""The bead on an elliptic hoop at constant rate, from Jacobi's integral: ½ ξ_dot² - ½ β_dot² r² is constant."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipeinc

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic
from liaisons_catalogue.solutions.integration import integrate
from liaisons_catalogue.solutions.slow_turn import SLOW_TURN, SlowTurn


@closed_form("by Jacobi elliptic functions and one quadrature, about the centre at constant rate", t=">= 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    """Return motion and torque: in the time τ, dt = (dξ/du) dτ, the angle 2u moves as that of a pendulum.

    The pendulum's frequency is |β_dot| √|a² - b²|; t(τ) is a quadrature.
    """
    a, b, Y = at.semi_axis_a, at.semi_axis_b, at.beta_dot
    frequency = abs(Y) * np.sqrt(abs(a**2 - b**2))
    lowest = 0.0 if a > b else np.pi / 2  # the bead swings about the far ends of the longer axis

    def speed(u: ArrayLike) -> NDArray:
        """Length dξ/du."""
        return np.hypot(a * np.sin(u), b * np.cos(u))

    v_0 = float(speed(at.u_0)) * at.u_dot_0  # du/dτ = ξ_dot

    def motion(tau: NDArray) -> tuple[NDArray, NDArray]:
        """Coordinate u and rate ξ_dot at times τ."""
        twice, rate = elliptic.pendulum(tau, 2 * (at.u_0 - lowest), 2 * v_0, frequency)
        return twice / 2 + lowest, rate / 2

    (tau,) = integrate(at, lambda _, tau: 1 / speed(motion(tau)[0]), [0.0], t)
    u, xi_dot = motion(tau)
    # The torque is the rate of p_β = m (α ξ_dot + r² β_dot) + I β_dot; α = ab/(dξ/du), ξ_ddot = ½ β_dot² (r²)'.
    s, slope = speed(u), (a**2 - b**2) * np.sin(2 * u)
    alpha_dash, r_squared_dash = -a * b * slope / (2 * s**4), -slope / s
    torque = at.mass * (alpha_dash * xi_dot**2 + r_squared_dash * Y * (xi_dot + a * b * Y / (2 * s)))
    xi = b * ellipeinc(u, 1 - (a / b) ** 2)
    motions = {"u": u, "u_dot": xi_dot / s, "xi": xi, "xi_dot": xi_dot}
    return motions | {"beta_force": torque, "beta_power": torque * Y}


@closed_form(SLOW_TURN)
def slow_turn(at: Values) -> SlowTurn:
    a, b = at.semi_axis_a, at.semi_axis_b
    return SlowTurn({0: at.centre_x + 1j * at.centre_y, 1: (a + b) / 2, -1: (a - b) / 2})
