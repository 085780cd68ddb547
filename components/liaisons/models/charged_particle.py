"""The charged particle in uniform electric and magnetic fields."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.mechanics import Coordinate, Experiment, Mechanism, Parameter, output
from liaisons.models._stumpff import turning_motion
from liaisons.models._validity import require, require_positive


class ChargedParticle(Mechanism):
    """Point charge in uniform electric and magnetic fields of any direction.

    ::

        L = ½ m |r'|² - Q (φ - r'·A),    φ = -E·r,    A = ½ B∧r          K eq. 24, 26
        p = ∂L/∂r' = m r' + Q A,         m r'' = Q (E + r'∧B)             K eq. 21
        Ω = Q B/m                                                         K eq. 28
        w = E∧B/B²                                                        drift
        r_c = r + m (r' - w)∧B/(Q B²),   r_c' = w + (r'·B) B/B²

    r [m], m [kg] mass, Q [C] charge, B [T], E [V/m]; p_x, p_y, p_z [kg.m/s] are the canonical momenta in the
    symmetric gauge, m r' the kinetic one, r_c [m] the centre of the turns, which the particle goes round at a constant
    distance.  The magnetic force does no work: the energy is ½ m |r'|² - Q E·r.  A = ½ B∧r asks for a uniform B.

    Source: K 2.3, Ex. 4 (eq. 27 with its dots restored), Ex. 7.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    charge = Parameter(1.0, "C", "charge")
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

    @property
    def _r(self) -> ca.SX:
        return ca.vertcat(self.x, self.y, self.z)

    @property
    def _B(self) -> ca.SX:  # noqa: N802
        return ca.vertcat(self.B_x, self.B_y, self.B_z)

    @property
    def _E(self) -> ca.SX:  # noqa: N802
        return ca.vertcat(self.E_x, self.E_y, self.E_z)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * ca.sumsqr(self.dot(self._r))

    def potential_energy(self) -> ca.SX:
        return -self.charge * ca.dot(self._E, self._r)

    def lagrangian(self) -> ca.SX:
        A = ca.cross(self._B, self._r) / 2
        return self.kinetic_energy() - self.potential_energy() + self.charge * ca.dot(self.dot(self._r), A)

    @output("kg.m/s", "mass times velocity along x, p_x without the part of the field")
    def kinetic_momentum_x(self) -> ca.SX:
        return self.mass * self.dot(self.x)

    @output("kg.m/s", "mass times velocity along y, p_y without the part of the field")
    def kinetic_momentum_y(self) -> ca.SX:
        return self.mass * self.dot(self.y)

    @output("kg.m/s", "mass times velocity along z, p_z without the part of the field")
    def kinetic_momentum_z(self) -> ca.SX:
        return self.mass * self.dot(self.z)

    @property
    def _guiding_centre(self) -> ca.SX:
        QE, QB = self.charge * self._E, self.charge * self._B
        square = ca.sumsqr(QB)
        square += square == 0  # without a field drift and arm are 0
        drift = ca.cross(QE, QB) / square
        return self._r + self.mass * ca.cross(self.dot(self._r) - drift, QB) / square

    @output("m", "x of the centre of the turns; of the particle itself where charge or magnetic field is 0")
    def guiding_centre_x(self) -> ca.SX:
        return self._guiding_centre[0]

    @output("m", "y of the centre of the turns; of the particle itself where charge or magnetic field is 0")
    def guiding_centre_y(self) -> ca.SX:
        return self._guiding_centre[1]

    @output("m", "z of the centre of the turns; of the particle itself where charge or magnetic field is 0")
    def guiding_centre_z(self) -> ca.SX:
        return self._guiding_centre[2]

    @staticmethod
    def exact(
        t: ArrayLike,
        *,
        x_0: float = 0.0,
        y_0: float = 0.0,
        z_0: float = 0.0,
        x_dot_0: float = 1.0,
        y_dot_0: float = 0.0,
        z_dot_0: float = 0.1,
        mass: float = 1.0,
        charge: float = 1.0,
        B_x: float = 0.0,
        B_y: float = 0.0,
        B_z: float = 1.0,
        E_x: float = 0.0,
        E_y: float = 0.0,
        E_z: float = 0.0,
    ) -> dict[str, NDArray]:
        """Helix, cycloid or parabola: K Ex. 4 for any direction of the fields and any start, without division by Ω.

        :param t: times since the start [s], any shape.
        :returns: ``x``, ``y``, ``z``, ``guiding_centre_x``, ``guiding_centre_y``, ``guiding_centre_z`` [m], ``x_dot``,
            ``y_dot``, ``z_dot`` [m/s].
        :raises ValidityError: for mass <= 0.
        """
        require_positive("ChargedParticle.exact", mass=mass)
        turn = -charge / mass * np.array([B_x, B_y, B_z])  # v' = a + turn∧v
        a = charge / mass * np.array([E_x, E_y, E_z])
        r_0, v_0 = np.array([x_0, y_0, z_0]), np.array([x_dot_0, y_dot_0, z_dot_0])
        r, r_dot = turning_motion(t, r_0, v_0, a, turn)
        centre, square = r, turn @ turn
        if square > 0:  # it moves along B as the particle does, and across B with the drift
            across = np.cross(turn, a) / square
            centre_0 = r_0 + np.cross(turn, v_0 - across) / square
            rate, along = across + turn * (turn @ v_0) / square, turn * (turn @ a) / square
            centre, _ = turning_motion(t, centre_0, rate, along, np.zeros(3))
        names = (form.format(axis) for form in ("{}", "{}_dot", "guiding_centre_{}") for axis in "xyz")
        return dict(zip(names, (*r, *r_dot, *centre), strict=True))

    @staticmethod
    def drift(
        *, B_x: float = 0.0, B_y: float = 0.0, B_z: float = 1.0, E_x: float = 0.0, E_y: float = 0.0, E_z: float = 0.0
    ) -> NDArray:
        """Velocity of the guiding centre across B, E∧B/B² [m/s], shape (3,): the same for all masses and charges.

        :raises ValidityError: where there is no magnetic field.
        """
        B = np.array([B_x, B_y, B_z])
        require(bool(np.any(B != 0)), "ChargedParticle.drift: B = 0; without a magnetic field nothing drifts")
        return np.cross([E_x, E_y, E_z], B) / (B @ B)
