"""The linear chain whose left end an operator moves."""

import casadi as ca

from liaisons.language import ActiveCoordinate, Coordinate, Experiment
from liaisons_catalogue.oscillator_chain import OscillatorChain


class DrivenChain(OscillatorChain):
    """Masses in a row, bound by springs; an operator moves a massless grip, one spring away from the first mass.

    With the position u_0 = σ(t) of the grip::

        T = ½ m Σ u_j'²,    V = ½ κ Σ (u_j - u_(j-1))²,    j = 1 ... N
        m u_j'' = κ (u_(j+1) - 2 u_j + u_(j-1)),    m u_N'' = -κ (u_N - u_(N-1))
        λ = κ (σ - u_1)
        grip at rest:  Ω_k = 2 √(κ/m) sin(α_k/2),    φ_k(j) = sin(α_k j),    α_k = (2k - 1) π/(2N + 1)
        a wave arrives at mass j about j Δx/c after the grip has moved, c = √(κ/m) Δx

    Source: K 5.3 with one end prescribed; λ is M eq. 27.
    """

    u = Coordinate("m", "displacements from the places at rest")
    drive = ActiveCoordinate("m", "position of the massless grip", symbol="σ")
    experiment = Experiment(stop_time=20.0, step_size=0.05, reference={"drive_dot": 0.2, "drive_ddot": 0.1})

    def base(self) -> dict[str, ca.SX]:
        return {"x": self.drive}

    from liaisons_catalogue.solutions.driven_chain import exact, forerunner, normal_modes
