"""The linear chain whose left end an operator moves."""

from __future__ import annotations

import casadi as ca

from liaisons.language import ActiveCoordinate, Chain, Coordinate, Experiment, Parameter, Size, calculated
from liaisons.models.solutions import chains


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

    exact, normal_modes, forerunner = chains.driven, chains.driven_modes, chains.forerunner
