"""The junction: a point at which two mechanisms hang."""

import casadi as ca
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons.language import ActiveCoordinate, Ball, Coordinate, Gravity, Mechanism, Parameter, Shapes, Trail, point
from liaisons_catalogue.solutions.linear import coordinate_motion


class Junction(Mechanism):
    """Pin in a vertical plane that one mechanism moves, and from which two others hang; it may have a mass.

    ::

        F_x = m x'' + first_x_load + second_x_load          F_z = m (z'' + g) + first_z_load + second_z_load

    An input has only one source, so only one mechanism can hang at a point.  If a junction is at the point, two can
    hang there, whose forces add up by virtual work (K eq. 14); with a second junction at one of the points of the
    first, three can.  The pin turns freely.
    """

    mass = Parameter(0.0, "kg", "mass of the pin", minimum=0)
    inertia = Parameter(1.0, "kg.m2", "moment of inertia of the pin, which turns freely", above=0)
    gravity = Gravity()
    angle = Coordinate("rad", "angle of the pin")
    x = ActiveCoordinate("m", "horizontal position")
    z = ActiveCoordinate("m", "height")

    @point("m", "where the first mechanism hangs")
    def first(self) -> dict[str, ca.SX]:
        return {"x": self.x, "z": self.z}

    @point("m", "where the second mechanism hangs")
    def second(self) -> dict[str, ca.SX]:
        return dict(self.first)

    def picture(self) -> Shapes:
        return [Trail(self.first), Ball(self.first)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.first) + self.inertia / 2 * self.dot(self.angle) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @closed_form("the pin under a constant torque")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        return coordinate_motion(t, at, "angle", forces=[(at.angle_force / at.inertia, 0.0)])
