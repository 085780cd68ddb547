"""The charged particle in uniform electric and magnetic fields."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.language import Coordinate, Experiment, Mechanism, Parameter, Values, closed_form, output
from liaisons.models.solutions.stumpff import centre_of_turns, turning_motion
from liaisons.models.solutions.validity import require


class ChargedParticle(Mechanism):
    """Point charge in uniform electric and magnetic fields of any direction.

    ::

        L = ½ m |r'|² - Q (φ - r'·A),    φ = -E·r,    A = ½ B∧r          K eq. 24, 26
        p = ∂L/∂r' = m r' + Q A,         m r'' = Q (E + r'∧B)             K eq. 21
        Ω = Q B/m                                                         K eq. 28
        w = E∧B/B²                                                        drift
        r_c = r + m (r' - w)∧B/(Q B²),   r_c' = w + (r'·B) B/B²

    p_x, p_y, p_z are the canonical momenta in the symmetric gauge, m r' the kinetic one, r_c the centre of the turns,
    which the particle goes round at a constant distance.  The magnetic force does no work: the energy is
    ½ m |r'|² - Q E·r.  A = ½ B∧r asks for a uniform B.

    Source: K 2.3, Ex. 4 (eq. 27 with its dots restored), Ex. 7.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    charge = Parameter(1.0, "C", "charge", symbol="Q")
    B_x = Parameter(0.0, "T", "magnetic field along x")
    B_y = Parameter(0.0, "T", "magnetic field along y")
    B_z = Parameter(1.0, "T", "magnetic field along z")
    E_x = Parameter(0.0, "V/m", "electric field along x")
    E_y = Parameter(0.0, "V/m", "electric field along y")
    E_z = Parameter(0.0, "V/m", "electric field along z")
    x = Coordinate("m", "position along x", start_rate=1.0)
    y = Coordinate("m", "position along y")
    z = Coordinate("m", "position along z", start_rate=0.1)
    experiment = Experiment(stop_time=20.0, step_size=0.02)

    _r = property(lambda self: ca.vertcat(self.x, self.y, self.z))
    _B = property(lambda self: ca.vertcat(self.B_x, self.B_y, self.B_z))
    _E = property(lambda self: ca.vertcat(self.E_x, self.E_y, self.E_z))

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * ca.sumsqr(self.dot(self._r))

    def potential_energy(self) -> ca.SX:
        return -self.charge * ca.dot(self._E, self._r)

    def lagrangian(self) -> ca.SX:
        A = ca.cross(self._B, self._r) / 2
        return self.kinetic_energy() - self.potential_energy() + self.charge * ca.dot(self.dot(self._r), A)

    kinetic_momentum_x, kinetic_momentum_y, kinetic_momentum_z = (
        output("kg.m/s", f"mass times velocity along {axis}, p_{axis} without the part of the field")(
            lambda self, axis=axis: self.mass * self.dot(self.symbols[axis])
        )
        for axis in "xyz"
    )

    @property
    def _guiding_centre(self) -> ca.SX:
        QE, QB = self.charge * self._E, self.charge * self._B
        square = ca.sumsqr(QB)
        square += square == 0  # without a field drift and arm are 0
        drift = ca.cross(QE, QB) / square
        return self._r + self.mass * ca.cross(self.dot(self._r) - drift, QB) / square

    guiding_centre_x, guiding_centre_y, guiding_centre_z = (
        output("m", f"{axis} of the centre of the turns; of the particle itself where charge or magnetic field is 0")(
            lambda self, i=i: self._guiding_centre[i]
        )
        for i, axis in enumerate("xyz")
    )

    @closed_form("helix, cycloid or parabola (K Ex. 4) for any fields and any start, without division by Ω")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        turn = -at.charge / at.mass * at.array("B_x", "B_y", "B_z")  # v' = a + turn∧v
        a = at.charge / at.mass * at.array("E_x", "E_y", "E_z")
        r_0, v_0 = at.array("x_0", "y_0", "z_0"), at.array("x_dot_0", "y_dot_0", "z_dot_0")
        r, r_dot = turning_motion(t, r_0, v_0, a, turn)
        centre = centre_of_turns(t, r_0, v_0, a, turn) if turn.any() else r
        names = (form.format(axis) for form in ("{}", "{}_dot", "guiding_centre_{}") for axis in "xyz")
        return dict(zip(names, (*r, *r_dot, *centre), strict=True))

    @closed_form("the velocity of the guiding centre across B, E∧B/B² [m/s], (3,): that of all masses and charges")
    @staticmethod
    def drift(at: Values) -> NDArray:
        B, E = at.array("B_x", "B_y", "B_z"), at.array("E_x", "E_y", "E_z")
        require(bool(np.any(B != 0)), "ChargedParticle.drift: B = 0; without a magnetic field nothing drifts")
        return np.cross(E, B) / (B @ B)
