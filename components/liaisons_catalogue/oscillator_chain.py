"""The linear chain: equal masses in a row, bound by equal springs, with free ends."""

import casadi as ca

from liaisons.chains import Chain
from liaisons.language import Ball, Coordinate, Experiment, Parameter, Shapes, Size, Spring, calculated


class OscillatorChain(Chain):
    """Masses in a row, each bound by a spring to the one before; both ends are free.

    ::

        T = ½ m Σ u_j'²,    V = ½ κ Σ (u_j - u_(j-1))²
        m u_j'' = κ (u_(j+1) - 2 u_j + u_(j-1))     at the ends one spring only
        Ω_k = 2 √(κ/m) sin(kπ/2N),    φ_k(j) = cos(kπ (j - ½)/N),    k = 0 ... N - 1
        long waves travel at c = √(κ/m) Δx, all others more slowly

    The position of mass j is (j - ½) Δx.  Mode 0 is the uniform motion of the chain, whose total momentum Σ p_j is
    constant.

    Source: K 5.3, chain of oscillators and its wave limit.
    """

    n = Size(10, "number of masses")
    mass = Parameter(1.0, "kg", "mass of each body", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of each spring", above=0, symbol="κ")
    spacing = Parameter(1.0, "m", "distance of neighbours at rest", above=0, symbol="Δx")
    u = Coordinate("m", "displacements from the places at rest", start=(1.0,))
    experiment = Experiment(stop_time=20.0, step_size=0.05)

    def tip(self) -> dict[str, ca.SX]:
        return {"x": self.u}

    def picture(self) -> Shapes:
        position = {"x": self.u + (self.number - 0.5) * self.spacing}
        before = {"x": self.joint["x"] + (self.number - 1.5) * self.spacing}
        return [Spring(before, position), Ball(position, radius=0.15 * self.spacing)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.u) ** 2

    def bond_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.u - self.joint["x"]) ** 2

    @calculated("m/s", "speed of long waves")
    def wave_speed(self) -> ca.SX:
        return ca.sqrt(self.stiffness / self.mass) * self.spacing

    from liaisons_catalogue.solutions.oscillator_chain import exact, normal_modes
