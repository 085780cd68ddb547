"""The planet in the field of a fixed star."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.language import Coordinate, Experiment, Mechanism, Parameter, Values, closed_form, condition, output
from liaisons.models.solutions.kepler import kepler_motion
from liaisons.models.solutions.validity import require


class KeplerOrbit(Mechanism):
    """Planet in the plane of its orbit, attracted by a star at the origin.

    ::

        L = ½ m (x'² + y'²) + m μ/r,    r'' = -μ r/r³         V = -m μ/r, K 2.5 with its sign corrected
        L_z = m (x y' - y x'),          e = r'∧(r∧r')/μ - r/r
        T = 2π √(a³/μ),                 1/a = 2/r - |r'|²/μ   third law, for orbits of any eccentricity
        2 T̄ + V̄ = [p·r]/τ              virial over any time τ, K eq. 74 with h = -1 in the limit

    The vector e points to the pericentre and has the length of the eccentricity.  Energy, L_z and e are constant.
    r = 0 is reached by orbits without angular momentum.

    Source: K 2.5, eq. 60 (star M and planet m told apart); K 2.7.
    """

    mass = Parameter(1.0, "kg", "mass of the planet", above=0)
    mu = Parameter(1.0, "m3/s2", "gravitational constant times mass of the star", above=0)
    x = Coordinate("m", "position along x", start=1.0)
    y = Coordinate("m", "position along y", start_rate=1.0)
    experiment = Experiment(stop_time=20.0, step_size=0.02)

    @property
    def _r(self) -> ca.SX:
        return ca.hypot(self.x, self.y)

    @property
    def _moment(self) -> ca.SX:
        """Angular momentum per unit mass [m2/s]."""
        return self.x * self.dot(self.y) - self.y * self.dot(self.x)

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

    @condition("r must stay > 0: without angular momentum the planet falls into the star")
    def apart(self) -> ca.SX:
        return self._r

    @closed_form("ellipse, parabola or hyperbola, by Kepler's equation solved to rounding", mass="> 0", mu="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        turns = at.x_0 * at.y_dot_0 != at.y_0 * at.x_dot_0
        require(turns, "KeplerOrbit.exact: angular momentum 0: the planet moves through r = 0")
        start, rate = complex(at.x_0, at.y_0), complex(at.x_dot_0, at.y_dot_0)
        position, velocity = kepler_motion(t, start, rate, at.mu)
        return {"x": position.real, "y": position.imag, "x_dot": velocity.real, "y_dot": velocity.imag}

    @closed_form("the time of a revolution [s], 2π √(a³/μ) (K eq. 60); infinite on a parabola or hyperbola", mu="> 0")
    @staticmethod
    def period(at: Values) -> float:
        distance = float(np.hypot(at.x_0, at.y_0))
        require(distance > 0, f"KeplerOrbit.period: r_0 = {distance} must be > 0")
        inverse = 2 / distance - (at.x_dot_0**2 + at.y_dot_0**2) / at.mu  # 1/a
        return float(2 * np.pi / np.sqrt(at.mu * inverse**3)) if inverse > 0 else np.inf

    @closed_form("the start at the pericentre, on the x axis, of an orbit of this semi-axis [m] and eccentricity")
    @staticmethod
    def pericentre(at: Values, *, semi_axis: float, eccentricity: float) -> dict[str, float]:
        speed = np.sqrt(at.mu / semi_axis * (1 + eccentricity) / (1 - eccentricity))
        return {"x_0": semi_axis * (1 - eccentricity), "y_dot_0": float(speed)}

    @closed_form(
        "the time since the pericentre [s] at the eccentric anomaly E, √(a³/μ) (E - e sin E): Kepler's equation"
    )
    @staticmethod
    def time(E: ArrayLike, at: Values, *, semi_axis: float, eccentricity: float) -> NDArray:
        return np.sqrt(semi_axis**3 / at.mu) * (np.asarray(E) - eccentricity * np.sin(E))
