"""The hanging chain: many pendulums, each hung on the one above."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import eval_laguerre, roots_laguerre

from liaisons.mechanics import ActiveCoordinate, Chain, Coordinate, Experiment, Joint, Parameter, Size, point
from liaisons.models._linear import superposition
from liaisons.models._validity import require, require_not_negative, require_positive


class PendulumChain(Chain):
    """Point masses on massless rods, each hung on the one before; an operator may move the pivot.

    With r_0 the pivot::

        r_j = r_(j-1) + l (sin θ_j, -cos θ_j)
        T = ½ m Σ |r_j'|²,    V = m g Σ z_j
        small angles:  L_N(Ω² l/g) = 0,    x_j ~ L_(N-j)(Ω² l/g)

    θ_j [rad] angle of rod j from the downward vertical, absolute; m [kg] mass of each bob, l [m] length of each rod,
    g [m/s2] gravity, N number of links, L_i Laguerre polynomials, x_j [m] horizontal displacements in a normal mode.
    Large motions are chaotic: only the energy tells whether they are right.

    Source: K 2.2 (eq. 12, 19) for any number of links; the small motions are those of D. Bernoulli's hanging chain.
    """

    n = Size(10, "number of links")
    mass = Parameter(1.0, "kg", "mass of each bob", above=0)
    length = Parameter(1.0, "m", "length of each rod", above=0)
    gravity = Parameter(9.81, "m/s2", "gravitational acceleration")
    theta = Coordinate("rad", "angles of the rods from the downward vertical", start=0.1)
    pivot_x = ActiveCoordinate("m", "horizontal position of the pivot")
    pivot_z = ActiveCoordinate("m", "height of the pivot")
    joint = Joint("m", "x", "z")
    experiment = Experiment(stop_time=10.0, step_size=0.01)

    @point("m", "the bobs")
    def bob(self) -> dict[str, ca.SX]:
        sine, cosine = ca.sin(self.theta), ca.cos(self.theta)
        return {"x": self.joint["x"] + self.length * sine, "z": self.joint["z"] - self.length * cosine}

    def base(self) -> dict[str, ca.SX]:
        return {"x": self.pivot_x, "z": self.pivot_z}

    def tip(self) -> Mapping[str, ca.SX]:
        return self.bob

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bob["z"]

    @staticmethod
    def small_angles(
        t: ArrayLike, *, theta_0: ArrayLike, theta_dot_0: ArrayLike = 0.0, length: float = 1.0, gravity: float = 9.81
    ) -> dict[str, NDArray]:
        """Motion for sin θ ≈ θ with fixed pivot: the superposition of the normal modes.

        :param t: times since the start [s], any shape, >= 0.
        :param theta_0: angles at the start [rad], (n,); ``theta_dot_0`` the rates [rad/s], (n,) or one for all.
        :returns: ``theta`` [rad], ``theta_dot`` [rad/s], (..., n).
        :raises ValidityError: for a chain of less than 2, a length or gravity that is not positive, negative times.
        """
        require_not_negative("PendulumChain.small_angles", t=float(np.min(t)))
        start = np.atleast_1d(np.asarray(theta_0, dtype=float))
        frequencies, modes = PendulumChain.normal_modes(start.size, length=length, gravity=gravity)
        theta, theta_dot = superposition(t, frequencies, modes, start, theta_dot_0)
        return {"theta": theta, "theta_dot": theta_dot}

    @staticmethod
    def normal_modes(n: int, *, length: float = 1.0, gravity: float = 9.81) -> tuple[NDArray, NDArray]:
        """Frequencies [rad/s] from the slowest, (n,), and modes as columns of angles θ_j, (n, n).

        :raises ValidityError: for n < 2, a length or gravity that is not positive.
        """
        require(n >= 2, f"PendulumChain: n = {n}: a chain has at least 2 links")
        require_positive("PendulumChain", length=length, gravity=gravity)
        zeros = roots_laguerre(n)[0]
        displacements = eval_laguerre(np.arange(n, -1, -1)[:, None], zeros)  # of pivot and bobs, from the top
        return np.sqrt(zeros * gravity / length), np.diff(displacements, axis=0) / length
