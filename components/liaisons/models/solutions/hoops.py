"""The bead on a hoop: at a constant rate from Jacobi's integral, ½ ξ_dot² - ½ β_dot² r² is constant; and the circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad
from scipy.special import ellipeinc

from liaisons.language import Values, closed_form
from liaisons.models.solutions import elliptic as elliptic_functions
from liaisons.models.solutions.integration import integrate
from liaisons.models.solutions.validity import require


@closed_form("at constant rate a pendulum of frequency |β_dot| √(d/R)", offset="< radius", hoop_inertia=">= 0")
def circular(t: NDArray, at: Values) -> dict[str, NDArray]:
    """The centrifugal force is its gravity; the operator's torque balances the moment of the normal force."""
    R, d, Y = at.radius, at.offset, at.beta_dot
    frequency = abs(Y) * np.sqrt(d / R)
    if frequency > 0:
        psi, psi_dot = elliptic_functions.pendulum(t, at.xi_0 / R, at.xi_dot_0 / R, frequency)
    else:
        psi_dot = np.full_like(t, at.xi_dot_0 / R)
        psi = at.xi_0 / R + psi_dot * t
    normal_force = at.mass * (R * (psi_dot + Y) ** 2 + d * Y**2 * np.cos(psi))
    torque = -d * np.sin(psi) * normal_force
    motion = {"xi": R * psi, "xi_dot": R * psi_dot}
    return motion | {"normal_force": normal_force, "beta_force": torque, "beta_power": torque * Y}


@closed_form("by Jacobi elliptic functions and one quadrature, about the centre at constant rate", t=">= 0")
def elliptic(t: NDArray, at: Values) -> dict[str, NDArray]:
    """In a time τ with dt = (dξ/du) dτ Jacobi's integral is that of a pendulum.

    Its angle is 2u, its frequency |β_dot| √|a² - b²|; t(τ) is a quadrature.
    """
    a, b, Y = at.semi_axis_a, at.semi_axis_b, at.beta_dot
    frequency = abs(Y) * np.sqrt(abs(a**2 - b**2))
    lowest = 0.0 if a > b else np.pi / 2  # the bead swings about the far ends of the longer axis

    def speed(u: ArrayLike) -> NDArray:
        return np.hypot(a * np.sin(u), b * np.cos(u))

    v_0 = float(speed(at.u_0)) * at.u_dot_0  # du/dτ = ξ_dot

    def motion(tau: NDArray) -> tuple[NDArray, NDArray]:
        if frequency == 0:
            return at.u_0 + v_0 * tau, np.full_like(tau, v_0)
        twice, rate = elliptic_functions.pendulum(tau, 2 * (at.u_0 - lowest), 2 * v_0, frequency)
        return twice / 2 + lowest, rate / 2

    (tau,) = integrate("EllipticHoop.exact", lambda _, tau: 1 / speed(motion(tau)[0]), [0.0], t)
    u, xi_dot = motion(tau)
    # The torque is the rate of p_β = m (α ξ_dot + r² β_dot) + I β_dot; α = ab/(dξ/du), ξ_ddot = ½ β_dot² (r²)'.
    s, slope = speed(u), (a**2 - b**2) * np.sin(2 * u)
    alpha_dash, r_squared_dash = -a * b * slope / (2 * s**4), -slope / s
    torque = at.mass * (alpha_dash * xi_dot**2 + r_squared_dash * Y * (xi_dot + a * b * Y / (2 * s)))
    xi = b * ellipeinc(u, 1 - (a / b) ** 2)
    motions = {"u": u, "u_dot": xi_dot / s, "xi": xi, "xi_dot": xi_dot}
    return motions | {"beta_force": torque, "beta_power": torque * Y}


@closed_form("by one quadrature, for a bead that goes round while the hoop turns at constant rate", t=">= 0")
def fourier(t: NDArray, at: Values) -> dict[str, NDArray]:
    """θ and ξ; r must be positive, and the bead must not turn back."""
    waves, k, Y = fourier_waves(at), np.arange(1, 5), at.beta_dot

    def radius_and_speed(theta: ArrayLike) -> tuple[NDArray, NDArray]:
        terms = waves * np.exp(1j * np.multiply.outer(theta, k))
        r, slope = at.radius * (1 + np.real(terms).sum(-1)), at.radius * np.real(1j * k * terms).sum(-1)
        return r, np.hypot(r, slope)

    r, _ = radius_and_speed(np.linspace(0, 2 * np.pi, 1000))
    require(bool(np.all(r > 0)), f"FourierHoop.exact: the least r = {np.min(r)} must be > 0")
    r_0, speed_0 = radius_and_speed(at.theta_0)
    v_0 = speed_0 * at.theta_dot_0
    least = v_0**2 + Y**2 * (np.min(r) ** 2 - r_0**2)
    require(
        bool(Y == 0 or least > 0),
        f"FourierHoop.exact: the bead turns back; theta_dot_0 = {at.theta_dot_0} must be larger for it to go round",
    )

    def rates(_: float, y: NDArray) -> NDArray:
        r, speed = radius_and_speed(y[0])
        xi_dot = np.sign(v_0) * np.sqrt(v_0**2 + Y**2 * (r**2 - r_0**2))
        return np.array([xi_dot / speed, xi_dot])

    xi_0, _ = quad(lambda theta: radius_and_speed(theta)[1], 0, at.theta_0, epsabs=1e-13, epsrel=1e-13, limit=200)
    theta, xi = y = integrate("FourierHoop.exact", rates, [at.theta_0, xi_0], t)
    theta_dot, xi_dot = rates(0.0, y)
    return {"theta": theta, "theta_dot": theta_dot, "xi": xi, "xi_dot": xi_dot}


def fourier_waves(at: Values) -> NDArray:
    """Complex coefficients of e^ikθ, k = 1 to 4, whose real part r/radius - 1 is."""
    return at.array(*(f"cos_{k}" for k in range(1, 5))) - 1j * at.array(*(f"sin_{k}" for k in range(1, 5)))


def _circle(xi: ArrayLike, at: Values) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """a = r²θ', b = r²r'² and their derivatives by ξ, of a circle whose centre lies on OA at the distance d from O."""
    R, d, psi = at.radius, at.offset, np.asarray(xi, dtype=float) / at.radius
    return R + d * np.cos(psi), (d * np.sin(psi)) ** 2, -d / R * np.sin(psi), d**2 / R * np.sin(2 * psi)


@closed_form("the three terms of the dynamic field, D_0, H(Y) and -X_K (M eq. 65-67), in ξ and p_ξ with Y = β_dot")
def dynamic_field(xi: ArrayLike, p_xi: ArrayLike, beta_dot: ArrayLike, at: Values) -> dict[str, NDArray]:
    """Each of shape (2, ...): rates of ξ [m/s] and of p_ξ [N]."""
    xi, p, Y = np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in (xi, p_xi, beta_dot)))
    a, _, a_dash, b_dash = _circle(xi, at)
    fields = {
        "D_0": (p / at.mass, 0 * p),
        "H(Y)": (-a * Y, a_dash * p * Y),
        "-X_K": (0 * p, at.mass / 2 * b_dash * Y**2),
    }
    return {name: np.array(field) for name, field in fields.items()}


@closed_form("the motion of bead and hoop on a shaft that turns freely: Hamilton's equations (M eq. 62), at 1e-13")
def on_a_free_shaft(t: NDArray, at: Values, *, shaft_inertia: float = 0.0) -> dict[str, NDArray]:
    """ξ, β and p_ξ, and the constants p_β [kg.m2/s] and energy [J]; ``shaft_inertia`` [kg.m2] is added to I."""
    inertia = at.hoop_inertia + shaft_inertia
    a, b, _, _ = _circle(at.xi_0, at)
    p_0 = at.mass * (at.xi_dot_0 + a * at.beta_dot)
    p_beta = a * p_0 + (inertia + at.mass * b) * at.beta_dot

    def rates(_: float, y: NDArray) -> list[float]:
        a, b, a_dash, b_dash = _circle(y[0], at)
        Y = (p_beta - a * y[2]) / (inertia + at.mass * b)
        return [y[2] / at.mass - a * Y, Y, a_dash * y[2] * Y + at.mass / 2 * b_dash * Y**2]

    motion = integrate("CircularHoop.on_a_free_shaft", rates, [at.xi_0, at.beta, p_0], t)
    energy = p_0**2 / (2 * at.mass) + (inertia + at.mass * b) / 2 * at.beta_dot**2
    return dict(zip(("xi", "beta", "p_xi"), motion, strict=True)) | {"p_beta": p_beta, "energy": energy}
