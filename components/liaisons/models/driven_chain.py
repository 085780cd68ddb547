"""The linear chain whose left end an operator moves."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv

from liaisons.language import ActiveCoordinate, Chain, Coordinate, Experiment, Parameter, Size, calculated
from liaisons.language.closed_forms import Values, closed_form
from liaisons.models.solutions.linear import superposition
from liaisons.models.solutions.validity import require


class DrivenChain(Chain):
    """Masses in a row, bound by springs; an operator moves a massless grip, one spring away from the first mass.

    With u_0 = σ(t) the grip::

        T = ½ m Σ u_j'²,    V = ½ κ Σ (u_j - u_(j-1))²,    j = 1 ... N
        m u_j'' = κ (u_(j+1) - 2 u_j + u_(j-1)),    m u_N'' = -κ (u_N - u_(N-1))
        λ = κ (σ - u_1)
        grip at rest:  Ω_k = 2 √(κ/m) sin(α_k/2),    φ_k(j) = sin(α_k j),    α_k = (2k - 1) π/(2N + 1)
        a wave arrives at mass j about j Δx/c after the grip has moved, c = √(κ/m) Δx

    Source: K 5.3 with one end prescribed; λ is M eq. 27.
    """

    n = Size(10, "number of masses")
    mass = Parameter(1.0, "kg", "mass of each body", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of each spring", above=0, symbol="κ")
    spacing = Parameter(1.0, "m", "distance of neighbours at rest", above=0, symbol="Δx")
    u = Coordinate("m", "displacements from the places at rest")
    drive = ActiveCoordinate("m", "position of the massless grip", symbol="σ")
    experiment = Experiment(stop_time=20.0, step_size=0.05, reference={"drive_dot": 0.2, "drive_ddot": 0.1})

    def base(self) -> dict[str, ca.SX]:
        return {"x": self.drive}

    def tip(self) -> dict[str, ca.SX]:
        return {"x": self.u}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.u) ** 2

    def bond_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.u - self.joint["x"]) ** 2

    @calculated("m/s", "speed of long waves")
    def wave_speed(self) -> ca.SX:
        return ca.sqrt(self.stiffness / self.mass) * self.spacing

    @closed_form("a sum over the modes, from rest under σ = amplitude · sin(angular_frequency t)", t=">= 0")
    @staticmethod
    def exact(t: NDArray, at: Values, *, amplitude: float = 0.1, angular_frequency: float = 1.0) -> dict[str, NDArray]:
        rest, push = np.zeros(at.n), np.zeros(at.n)
        push[0] = at.stiffness / at.mass  # only the first mass feels the grip
        sine = (-1j * amplitude, angular_frequency)  # Re(-i e^(iωt)) = sin ωt
        u, u_dot = superposition(t, *_modes(at), rest, 0.0, push=push, forces=[sine])
        sigma = amplitude * np.sin(angular_frequency * t)
        return {"u": u, "u_dot": u_dot, "drive_force": at.stiffness * (sigma - u[..., 0])}

    @closed_form("with the grip at rest: frequencies [rad/s], (n,), and modes φ_k(j) as columns, (n, n)")
    @staticmethod
    def normal_modes(at: Values) -> tuple[NDArray, NDArray]:
        return _modes(at)

    @closed_form("a bound of what precedes a sudden unit push at mass j before j Δx/c, J_2j(x)/√(1 - (x/2j)²)")
    @staticmethod
    def forerunner(t: NDArray, j: ArrayLike, at: Values) -> NDArray:
        """x = 2 √(κ/m) t < 2j; an endless chain answers a step by u_j = ∫ 2j J_2j(x) dt/t."""
        order, x = 2 * np.asarray(j), 2 * np.sqrt(at.stiffness / at.mass) * t
        require(bool(np.all(x < order)), f"DrivenChain.forerunner: at t = {np.max(t)} s the push is there")
        return jv(order, x) / np.sqrt(1 - (x / order) ** 2)


def _modes(at: Values) -> tuple[NDArray, NDArray]:
    j = np.arange(1, at.n + 1)
    alpha = (2 * j - 1) * np.pi / (2 * at.n + 1)
    return 2 * np.sqrt(at.stiffness / at.mass) * np.sin(alpha / 2), np.sin(alpha * j[:, None])
