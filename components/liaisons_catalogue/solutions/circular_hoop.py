"""The bead on a circular hoop: a pendulum at constant rate, the dynamic field, and a shaft that turns freely."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic
from liaisons_catalogue.solutions.integration import integrate
from liaisons_catalogue.solutions.slow_turn import SLOW_TURN, SlowTurn


@closed_form("at constant rate a pendulum of frequency |β_dot| √(d/R)", offset="< radius", hoop_inertia=">= 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    """Return motion, normal force and torque: the centrifugal force takes the part of gravity in a pendulum."""
    R, d, Y = at.radius, at.offset, at.beta_dot
    psi, psi_dot = elliptic.pendulum(t, at.xi_0 / R, at.xi_dot_0 / R, abs(Y) * np.sqrt(d / R))
    normal_force = at.mass * (R * (psi_dot + Y) ** 2 + d * Y**2 * np.cos(psi))
    torque = -d * np.sin(psi) * normal_force
    motion = {"xi": R * psi, "xi_dot": R * psi_dot}
    return motion | {"normal_force": normal_force, "beta_force": torque, "beta_power": torque * Y}


@closed_form(SLOW_TURN)
def slow_turn(at: Values) -> SlowTurn:
    return SlowTurn({0: at.offset, 1: at.radius})


def _tangential_and_normal_parts(xi: ArrayLike, at: Values) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Parts a = r²θ' and b = r²r'² of r² at arc lengths ξ of a circle, and their derivatives by ξ."""
    R, d, psi = at.radius, at.offset, np.asarray(xi, dtype=float) / at.radius
    return R + d * np.cos(psi), (d * np.sin(psi)) ** 2, -d / R * np.sin(psi), d**2 / R * np.sin(2 * psi)


@closed_form("the three terms of the dynamic field, D_0, H(Y) and -X_K (M eq. 65-67), in ξ and p_ξ with Y = β_dot")
def dynamic_field(xi: ArrayLike, p_xi: ArrayLike, beta_dot: ArrayLike, at: Values) -> dict[str, NDArray]:
    """Return the rates of ξ [m/s] and of p_ξ [N] in each term, shape (2, ...)."""
    xi, p, Y = np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in (xi, p_xi, beta_dot)))
    a, _, a_dash, b_dash = _tangential_and_normal_parts(xi, at)
    fields = {
        "D_0": (p / at.mass, 0 * p),
        "H(Y)": (-a * Y, a_dash * p * Y),
        "-X_K": (0 * p, at.mass / 2 * b_dash * Y**2),
    }
    return {name: np.array(field) for name, field in fields.items()}


@closed_form("the motion of bead and hoop on a shaft that turns freely: Hamilton's equations (M eq. 62), at 1e-13")
def on_a_free_shaft(t: NDArray, at: Values, *, shaft_inertia: float = 0.0) -> dict[str, NDArray]:
    """Return ξ, β, p_ξ, and the constants p_β [kg.m2/s] and energy [J]; ``shaft_inertia`` [kg.m2] is added to I."""
    inertia = at.hoop_inertia + shaft_inertia
    a, b, _, _ = _tangential_and_normal_parts(at.xi_0, at)
    p_0 = at.mass * (at.xi_dot_0 + a * at.beta_dot)
    p_beta = a * p_0 + (inertia + at.mass * b) * at.beta_dot

    def rates(_: float, y: NDArray) -> list[float]:
        """Hamilton's equations of ξ, β, p_ξ."""
        a, b, a_dash, b_dash = _tangential_and_normal_parts(y[0], at)
        Y = (p_beta - a * y[2]) / (inertia + at.mass * b)
        return [y[2] / at.mass - a * Y, Y, a_dash * y[2] * Y + at.mass / 2 * b_dash * Y**2]

    motion = integrate(at, rates, [at.xi_0, at.beta, p_0], t)
    energy = p_0**2 / (2 * at.mass) + (inertia + at.mass * b) / 2 * at.beta_dot**2
    return dict(zip(("xi", "beta", "p_xi"), motion, strict=True)) | {"p_beta": p_beta, "energy": energy}
