"""The child on a swing: its motion in a fixed posture, and what leaning does to it (M 8.1, J ≠ 0)."""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic
from liaisons_catalogue.solutions.integration import integrate


@closed_form("the motion in a fixed posture: the compound pendulum I θ_com'' = -D sin θ_com", gravity="> 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    seat, torso = at.rope + 0j, at.rope + at.torso_length * np.exp(1j * at.lean)  # in the plane, along the rope
    moment = at.mass_seat * seat + at.mass_torso * torso
    inertia = at.mass_seat * abs(seat) ** 2 + at.mass_torso * abs(torso) ** 2
    size = at.mass_seat * abs(seat) + at.mass_torso * abs(torso)
    at.require(abs(moment) > 1e-15 * size, "the centre of mass lies on the pivot; change rope or lean")
    offset, frequency = np.angle(moment), np.sqrt(at.gravity * abs(moment) / inertia)
    theta_com, theta_dot = elliptic.pendulum(t, at.theta_0 + offset, at.theta_dot_0, frequency)
    return {"theta": theta_com - offset, "theta_dot": theta_dot, "theta_com": theta_com}


def _coupling_and_inertia(psi: float, at: Values) -> tuple[float, float]:
    """Coupling J of rope and lean, and moment of inertia I, at the lean ψ [kg.m2] (M eq. 55)."""
    own, mixed = at.mass_torso * at.torso_length**2, at.mass_torso * at.torso_length * at.rope * np.cos(psi)
    return own + mixed, own + 2 * mixed + (at.mass_seat + at.mass_torso) * at.rope**2


@closed_form("the shift of the rope [rad] by a lean at once from ``lean`` to another, -∫ (J/I) dψ: a horizontal lift")
def lift(to: float, at: Values) -> float:
    """Return the shift, at constant p_θ and rope."""
    integral, _ = quad(lambda psi: np.divide(*_coupling_and_inertia(psi, at)), at.lean, to, epsabs=1e-13)
    return -integral


@closed_form("the motion under the lean ψ + amplitude · sin(angular_frequency t): M eq. 54-56 at 1e-13")
def leaning(t: NDArray, at: Values, *, amplitude: float, angular_frequency: float) -> dict[str, NDArray]:
    """Return θ and p_θ for a rope of constant length; ``lean`` is the mean of the lean."""

    def posture(t: float) -> tuple[float, float, float]:
        """Lean ψ, moment of inertia I, and momentum J ψ'."""
        psi = at.lean + amplitude * np.sin(angular_frequency * t)
        J, inertia = _coupling_and_inertia(psi, at)
        return psi, inertia, J * amplitude * angular_frequency * np.cos(angular_frequency * t)

    def rates(t: float, y: NDArray) -> list[float]:
        """Rates of θ and p_θ."""
        psi, inertia, turning = posture(t)
        along, across = (at.mass_seat + at.mass_torso) * at.rope, at.mass_torso * at.torso_length
        moment = along * np.sin(y[0]) + across * np.sin(y[0] + psi)
        return [(y[1] - turning) / inertia, -at.gravity * moment]

    _, inertia, turning = posture(0.0)
    start = [at.theta_0, inertia * at.theta_dot_0 + turning]
    return dict(zip(("theta", "p_theta"), integrate(at, rates, start, t), strict=True))
