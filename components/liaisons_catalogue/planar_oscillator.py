"""The oscillator in the plane, in Cartesian coordinates."""

import casadi as ca
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons.language import Ball, Coordinate, Experiment, Mechanism, Parameter, Shapes, Spring, Trail, output
from liaisons_catalogue.solutions.linear import coordinate_motion


class PlanarOscillator(Mechanism):
    """Mass in a plane, attracted to the origin by a force proportional to the distance.

    ::

        L = ½ m (x'² + y'²) - ½ K (x² + y²)                   K eq. 35,  Ω² = K/m
        x'' + Ω² x = 0,    y'' + Ω² y = 0                     K eq. 36, 37

    The orbit is an ellipse about the origin.  Energy and angular momentum m (x y' - y x') are constant; the latter is
    p_φ of :class:`PolarOscillator`, the same motion in r and φ.

    Source: K Ex. 5.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness; 0 is a free mass", minimum=0, symbol="K")
    x = Coordinate("m", "position along x", start=1.0)
    y = Coordinate("m", "position along y", start_rate=0.5)
    experiment = Experiment(stop_time=20.0)

    _r = property(lambda self: {"x": self.x, "y": self.y})

    def picture(self) -> Shapes:
        return [Trail(self._r), Spring({}, self._r), Ball(self._r)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self._r)

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.x**2 + self.y**2)

    @output("kg.m2/s", "angular momentum about the origin")
    def angular_momentum(self) -> ca.SX:
        return self.mass * (self.x * self.dot(self.y) - self.y * self.dot(self.x))

    @closed_form("two oscillations of one frequency: an ellipse", t=">= 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        omega_squared = at.stiffness / at.mass
        x, y = (coordinate_motion(t, at, axis, omega_squared=omega_squared) for axis in "xy")
        return x | y
