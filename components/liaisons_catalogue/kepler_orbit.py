"""The planet in the field of a fixed star."""

import casadi as ca

from liaisons.language import Ball, Coordinate, Experiment, Mechanism, Parameter, Shapes, Trail, assertion, output


class KeplerOrbit(Mechanism):
    """Planet in the plane of its orbit, attracted by a star at the origin.

    ::

        L = ½ m (x'² + y'²) + m μ/r,    r'' = -μ r/r³         V = -m μ/r, K 2.5 with its sign corrected
        L_z = m (x y' - y x'),          e = r'∧(r∧r')/μ - r/r
        T = 2π √(a³/μ),                 1/a = 2/r - |r'|²/μ   third law, for orbits of any eccentricity
        2 T̄ + V̄ = [p·r]/τ              virial over any time τ, K eq. 74 with h = -1 in the limit

    The vector e points to the pericentre and has the length of the eccentricity.  Energy, L_z and e are constant.  Only
    orbits without angular momentum reach r = 0.

    Source: K 2.5, eq. 60 (star M and planet m told apart); K 2.7.
    """

    mass = Parameter(1.0, "kg", "mass of the planet", above=0)
    mu = Parameter(1.0, "m3/s2", "gravitational constant times mass of the star", above=0)
    x = Coordinate("m", "position along x", start=1.0)
    y = Coordinate("m", "position along y", start_rate=1.0)
    experiment = Experiment(stop_time=20.0, step_size=0.02)

    _r = property(lambda self: ca.hypot(self.x, self.y))
    _moment = property(lambda self: self.x * self.dot(self.y) - self.y * self.dot(self.x))  # over the mass [m2/s]

    def picture(self) -> Shapes:
        planet = {"x": self.x, "y": self.y}
        return [Trail(planet), Ball({}, radius=0.12), Ball(planet, radius=0.05)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y})

    def potential_energy(self) -> ca.SX:
        return -self.mass * self.mu / self._r

    @output("kg.m2/s", "angular momentum about the star")
    def angular_momentum(self) -> ca.SX:
        return self.mass * self._moment

    @output("1", "x of the eccentricity vector, which points to the pericentre")
    def eccentricity_x(self) -> ca.SX:
        return self.dot(self.y) * self._moment / self.mu - self.x / self._r

    @output("1", "y of the eccentricity vector")
    def eccentricity_y(self) -> ca.SX:
        return -self.dot(self.x) * self._moment / self.mu - self.y / self._r

    @assertion("r must stay > 0: without angular momentum the planet falls into the star")
    def apart(self) -> ca.SX:
        return self._r

    from liaisons_catalogue.solutions.kepler_orbit import exact, pericentre, period, time
