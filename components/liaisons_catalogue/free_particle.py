"""The free particle: Newton's equations from a Lagrangian, and free fall."""

import casadi as ca
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons.language import Ball, Coordinate, Experiment, Friction, Gravity, Mechanism, Parameter, Shapes, Trail
from liaisons_catalogue.solutions.linear import coordinate_motion


class FreeParticle(Mechanism):
    """Point mass under its weight, with optional friction.

    ::

        L = ½ m (x'² + y'² + z'²) - m g z                     K eq. 20 with V = +m g z
        r'' = -g e_z - η r'                                   K eq. 62

    A fall from rest through L lasts τ = √(2L/g), so that τ'/τ = √(L'/L), K eq. 59: V is homogeneous of degree h = 1.

    Source: K Ex. 2; sec. 2.5 (free fall, the sign of its potential corrected); sec. 2.6.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Gravity()
    friction = Friction()
    x = Coordinate("m", "horizontal position", start_rate=1.0)
    y = Coordinate("m", "horizontal position, across x")
    z = Coordinate("m", "height", start_rate=9.81)
    experiment = Experiment(stop_time=2.0)

    _r = property(lambda self: {"x": self.x, "y": self.y, "z": self.z})

    def picture(self) -> Shapes:
        return [Trail(self._r), Ball(self._r)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self._r)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @closed_form("a parabola; with friction the velocity tends to -g/η e_z exponentially", t=">= 0", mass="> 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        motion = {}
        for axis, acceleration in (("x", 0.0), ("y", 0.0), ("z", -at.gravity)):
            motion |= coordinate_motion(t, at, axis, gamma=at.friction, forces=[(acceleration, 0.0)])
        return motion
