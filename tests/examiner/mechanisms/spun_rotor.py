"""A rotor in a frame that an operator turns and tilts."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, Values, closed_form


class SpunRotor(Mechanism):
    """Rotor whose axis an operator leads round by φ at the tilt θ: only the spin ψ is free.

    ω_3 = ψ' + φ' cos θ, ω_1² + ω_2² = θ'² + φ'² sin² θ;  I_3 ω_3 is constant.
    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 35.
    """

    axial = Parameter(0.02, "kg.m2", "moment of inertia about the axis", above=0, symbol="I_3")
    transverse = Parameter(0.015, "kg.m2", "moment of inertia across the axis", above=0, symbol="I_1")
    spin = Coordinate("rad", "angle of the rotor in its frame", start_rate=20.0, symbol="ψ")
    lead = ActiveCoordinate("rad", "azimuth of the axis", symbol="φ")
    tilt = ActiveCoordinate("rad", "angle of the axis from the vertical", start=1.1, symbol="θ")
    experiment = Experiment(reference={"lead_dot": 0.8})

    def kinetic_energy(self) -> ca.SX:
        axial = self.dot(self.spin) + self.dot(self.lead) * ca.cos(self.tilt)
        across = self.dot(self.tilt) ** 2 + (self.dot(self.lead) * ca.sin(self.tilt)) ** 2
        return self.axial / 2 * axial**2 + self.transverse / 2 * across

    @closed_form("the spin while the axis is led round evenly, and the torque that holds its tilt", tilt_dot="== 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        sine, cosine, rate = np.sin(at.tilt), np.cos(at.tilt), at.lead_dot
        axial = at.spin_dot_0 + rate * cosine
        torque = at.axial * axial * rate * sine - at.transverse * rate**2 * sine * cosine
        return {"spin": at.spin_0 + at.spin_dot_0 * t, "tilt_force": torque + 0 * t}
