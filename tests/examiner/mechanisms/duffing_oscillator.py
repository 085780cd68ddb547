"""Duffing's oscillator."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj

from liaisons import Coordinate, Mechanism, Parameter, Values, closed_form


class DuffingOscillator(Mechanism):
    """Mass on a hardening spring: m x'' = -k x - κ x³.

    From rest x = x_0 cn(Ω t | n), Ω² = (k + κ x_0²)/m, n = κ x_0²/(2 (k + κ x_0²)).
    Source: J. P. Den Hartog, Mechanical Vibrations, 8.2 and 8.3.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(5.0, "N/m", "stiffness at rest", above=0, symbol="k")
    hardening = Parameter(8.0, "N/m3", "cubic stiffness", minimum=0, symbol="κ")
    x = Coordinate("m", "displacement", start=1.0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.x**2 + self.hardening / 4 * self.x**4

    @closed_form("the oscillation from rest: Jacobi's cn", x_dot_0="== 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        whole = at.stiffness + at.hardening * at.x_0**2
        parameter = at.hardening * at.x_0**2 / (2 * whole)
        _, cn, _, _ = ellipj(np.sqrt(whole / at.mass) * t, parameter)
        return {"x": at.x_0 * cn}
