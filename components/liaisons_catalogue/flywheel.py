"""The flywheel: one angle, one inertia."""

import casadi as ca
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons.language import Ball, Coordinate, Experiment, Friction, Mechanism, Parameter, Rod, Shapes, circle, turned
from liaisons_catalogue.solutions.linear import coordinate_motion


class Flywheel(Mechanism):
    """Wheel on a fixed shaft, such as the shaft of a motor in a system.

    ::

        I φ'' = τ - η I φ'

    τ is the torque on the port of the angle.  The simplest case of K eq. 65 and 66: T = I φ'²/2, V = 0.
    """

    inertia = Parameter(1.0, "kg.m2", "moment of inertia about the shaft", above=0)
    friction = Friction()
    angle = Coordinate("rad", "angle of the wheel", start_rate=1.0, symbol="φ")
    experiment = Experiment(reference={"angle_force": 1.0, "friction": 0.2})

    def picture(self) -> Shapes:
        axes = turned("y", -self.angle)
        rims = [
            dict(zip("xyz", ca.vertsplit(side * 0.5 * axes[:, i]), strict=True)) for i in (0, 2) for side in (-1, 1)
        ]
        return [circle({}, 0.5, (axes[:, 0], axes[:, 2])), *(Rod({}, rim) for rim in rims), Ball({})]

    def kinetic_energy(self) -> ca.SX:
        return self.inertia / 2 * self.dot(self.angle) ** 2

    @closed_form("the motion under a constant torque; without it an exponential run-down", t=">= 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        return coordinate_motion(t, at, "angle", gamma=at.friction, forces=[(at.angle_force / at.inertia, 0.0)])
