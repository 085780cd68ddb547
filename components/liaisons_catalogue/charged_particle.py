"""The charged particle in uniform electric and magnetic fields."""

import casadi as ca

from liaisons.language import Ball, Coordinate, Experiment, Mechanism, Parameter, Shapes, Trail, output


class ChargedParticle(Mechanism):
    """Point charge in uniform electric and magnetic fields of any direction.

    ::

        L = ½ m |r'|² - Q (φ - r'·A),    φ = -E·r,    A = ½ B∧r          K eq. 24, 26; B uniform
        p = ∂L/∂r' = m r' + Q A,         m r'' = Q (E + r'∧B)             K eq. 21
        Ω = Q B/m,                       w = E∧B/B²                       K eq. 28; drift
        r_c = r + m (r' - w)∧B/(Q B²),   r_c' = w + (r'·B) B/B²

    p_x, p_y, p_z are the canonical momenta in the symmetric gauge, m r' is the kinetic momentum, and r_c the guiding
    centre, which the particle circles at a constant distance.  The energy is ½ m |r'|² - Q E·r.

    Source: K 2.3, Ex. 4 (eq. 27 with its dots restored), Ex. 7.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    charge = Parameter(1.0, "C", "charge", symbol="Q")
    B_x, B_y, B_z = (Parameter(float(axis == "z"), "T", f"magnetic field along {axis}") for axis in "xyz")
    E_x, E_y, E_z = (Parameter(0.0, "V/m", f"electric field along {axis}") for axis in "xyz")
    x = Coordinate("m", "position along x", start_rate=1.0)
    y = Coordinate("m", "position along y")
    z = Coordinate("m", "position along z", start_rate=0.1)
    experiment = Experiment(stop_time=20.0, step_size=0.02)

    _r = property(lambda self: ca.vertcat(self.x, self.y, self.z))
    _B = property(lambda self: ca.vertcat(self.B_x, self.B_y, self.B_z))
    _E = property(lambda self: ca.vertcat(self.E_x, self.E_y, self.E_z))

    def picture(self) -> Shapes:
        position = {"x": self.x, "y": self.y, "z": self.z}
        return [Trail(position), Ball(position)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * ca.sumsqr(self.dot(self._r))

    def potential_energy(self) -> ca.SX:
        return -self.charge * ca.dot(self._E, self._r)

    def lagrangian(self) -> ca.SX:
        A = ca.cross(self._B, self._r) / 2
        return self.kinetic_energy() - self.potential_energy() + self.charge * ca.dot(self.dot(self._r), A)

    def _guiding_centre(self) -> ca.SX:
        """Position of the guiding centre, (3,)."""
        QE, QB = self.charge * self._E, self.charge * self._B
        square = ca.sumsqr(QB)
        square += square == 0  # without a field drift and arm are 0
        drift = ca.cross(QE, QB) / square
        return self._r + self.mass * ca.cross(self.dot(self._r) - drift, QB) / square

    kinetic_momentum_x, kinetic_momentum_y, kinetic_momentum_z = (
        output("kg.m/s", f"mass times velocity along {q}, p_{q} without the part of the field")(
            lambda self, q=q: self.mass * self.dot(self.symbols[q])
        )
        for q in "xyz"
    )
    guiding_centre_x, guiding_centre_y, guiding_centre_z = (
        output("m", f"{q} of the centre of the turns; of the particle itself where charge or magnetic field is 0")(
            lambda self, i=i: self._guiding_centre()[i]
        )
        for i, q in enumerate("xyz")
    )

    from liaisons_catalogue.solutions.charged_particle import drift, exact
