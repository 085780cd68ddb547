"""The linear chain whose left end an operator moves."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.mechanics import ActiveCoordinate, Chain, Coordinate, Experiment, Parameter, Size, calculated
from liaisons.models._linear import superposition
from liaisons.models._validity import require, require_not_negative, require_positive


class DrivenChain(Chain):
    """Masses in a row, bound by springs; an operator moves a massless grip, one spring away from the first mass.

    With u_0 = σ(t) the grip::

        T = ½ m Σ u_j'²,    V = ½ κ Σ (u_j - u_(j-1))²,    j = 1 ... N
        m u_j'' = κ (u_(j+1) - 2 u_j + u_(j-1)),    m u_N'' = -κ (u_N - u_(N-1))
        λ = κ (σ - u_1)
        grip at rest:  Ω_k = 2 √(κ/m) sin(α_k/2),    φ_k(j) = sin(α_k j),    α_k = (2k - 1) π/(2N + 1)
        a wave arrives at mass j about j Δx/c after the grip has moved, c = √(κ/m) Δx

    u_j [m] displacement of mass j; m [kg] mass, κ [N/m] stiffness, Δx [m] spacing, σ [m] position of the grip,
    λ [N] force of the operator.

    Source: K 5.3 with one end prescribed; λ is M eq. 27.
    """

    n = Size(10, "number of masses")
    mass = Parameter(1.0, "kg", "mass of each body", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of each spring", above=0)
    spacing = Parameter(1.0, "m", "distance of neighbours at rest", above=0)
    u = Coordinate("m", "displacements from the places at rest")
    drive = ActiveCoordinate("m", "position of the massless grip")
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

    @staticmethod
    def exact(
        t: ArrayLike,
        *,
        n: int = 10,
        amplitude: float = 0.1,
        angular_frequency: float = 1.0,
        mass: float = 1.0,
        stiffness: float = 1.0,
    ) -> dict[str, NDArray]:
        """Motion from rest under σ = amplitude · sin(angular_frequency t), as a sum over the modes.

        :param t: times since the start [s], any shape, >= 0.
        :returns: ``u`` [m], ``u_dot`` [m/s], (..., n), and ``drive_force`` [N].
        :raises ValidityError: for a chain of less than 2, a mass or stiffness that is not positive, negative times.
        """
        require_not_negative("DrivenChain.exact", t=float(np.min(t)))
        frequencies, modes = DrivenChain.normal_modes(n, mass=mass, stiffness=stiffness)
        push = np.zeros(n)
        push[0] = stiffness / mass  # only the first mass feels the grip
        sine = (-1j * amplitude, angular_frequency)  # Re(-i e^(iωt)) = sin ωt
        u, u_dot = superposition(t, frequencies, modes, np.zeros(n), 0.0, push=push, forces=[sine])
        sigma = amplitude * np.sin(angular_frequency * np.asarray(t, dtype=float))
        return {"u": u, "u_dot": u_dot, "drive_force": stiffness * (sigma - u[..., 0])}

    @staticmethod
    def normal_modes(n: int, *, mass: float = 1.0, stiffness: float = 1.0) -> tuple[NDArray, NDArray]:
        """Frequencies [rad/s] with the grip at rest, (n,), and modes φ_k(j) as columns, (n, n).

        :raises ValidityError: for n < 2, a mass or stiffness that is not positive.
        """
        require(n >= 2, f"DrivenChain: n = {n}: a chain has at least 2 masses")
        require_positive("DrivenChain", mass=mass, stiffness=stiffness)
        alpha, j = (2 * np.arange(1, n + 1) - 1) * np.pi / (2 * n + 1), np.arange(1, n + 1)[:, None]
        return 2 * np.sqrt(stiffness / mass) * np.sin(alpha / 2), np.sin(alpha * j)
