"""The linear chain: equal masses in a row, bound by equal springs, with free ends."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.mechanics import Chain, Coordinate, Experiment, Parameter, Size, calculated
from liaisons.models._linear import superposition
from liaisons.models._validity import require, require_not_negative, require_positive


class OscillatorChain(Chain):
    """Masses in a row, each bound by a spring to the one before; both ends are free.

    ::

        T = ½ m Σ u_j'²,    V = ½ κ Σ (u_j - u_(j-1))²
        m u_j'' = κ (u_(j+1) - 2 u_j + u_(j-1))     at the ends one spring only
        Ω_k = 2 √(κ/m) sin(kπ/2N),    φ_k(j) = cos(kπ (j - ½)/N),    k = 0 ... N - 1
        long waves travel at c = √(κ/m) Δx, all others more slowly

    u_j [m] displacement of mass j from its place (j - ½) Δx; m [kg] mass, κ [N/m] stiffness, Δx [m] spacing,
    N number of masses.  Mode 0 is the uniform motion of the chain, whose total momentum Σ p_j is constant.

    Source: K 5.3, chain of oscillators and its wave limit.
    """

    n = Size(10, "number of masses")
    mass = Parameter(1.0, "kg", "mass of each body", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of each spring", above=0)
    spacing = Parameter(1.0, "m", "distance of neighbours at rest", above=0)
    u = Coordinate("m", "displacements from the places at rest", start=(1.0,))
    experiment = Experiment(stop_time=20.0, step_size=0.05)

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
        t: ArrayLike, *, u_0: ArrayLike, u_dot_0: ArrayLike = 0.0, mass: float = 1.0, stiffness: float = 1.0
    ) -> dict[str, NDArray]:
        """Motion as the superposition of the normal modes.

        :param t: times since the start [s], any shape, >= 0.
        :param u_0: displacements at the start [m], (n,); ``u_dot_0`` the rates [m/s], (n,) or one for all.
        :returns: ``u`` [m], ``u_dot`` [m/s], (..., n).
        :raises ValidityError: for a chain of less than 2, a mass or stiffness that is not positive, negative times.
        """
        require_not_negative("OscillatorChain.exact", t=float(np.min(t)))
        position = np.atleast_1d(np.asarray(u_0, dtype=float))
        frequencies, modes = OscillatorChain.normal_modes(position.size, mass=mass, stiffness=stiffness)
        u, u_dot = superposition(t, frequencies, modes, position, u_dot_0)
        return {"u": u, "u_dot": u_dot}

    @staticmethod
    def normal_modes(n: int, *, mass: float = 1.0, stiffness: float = 1.0) -> tuple[NDArray, NDArray]:
        """Frequencies [rad/s] from 0 upward, (n,), and modes φ_k(j) as columns, (n, n).

        :raises ValidityError: for n < 2, a mass or stiffness that is not positive.
        """
        require(n >= 2, f"OscillatorChain: n = {n}: a chain has at least 2 masses")
        require_positive("OscillatorChain", mass=mass, stiffness=stiffness)
        k, j = np.arange(n), np.arange(1, n + 1)[:, None]
        return 2 * np.sqrt(stiffness / mass) * np.sin(k * np.pi / (2 * n)), np.cos(k * np.pi * (j - 0.5) / n)
