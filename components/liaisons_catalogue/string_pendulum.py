"""The pendulum on a string that may go slack."""

import casadi as ca
import numpy as np

from liaisons.contacts import unilateral
from liaisons.language import (
    ActiveCoordinate,
    Ball,
    Coordinate,
    Flash,
    Gravity,
    Mechanism,
    Parameter,
    Rope,
    Shapes,
    Trail,
    point,
)

_START = 0.1  # rad, angle of the string from the downward vertical


class StringPendulum(Mechanism):
    """Point mass on a string, which pulls and does not push; an operator may move its pivot and change its length.

    With the distance d = |r - r_p| from the pivot and the force λ of the string::

        slack = l - d >= 0,    m r'' = -m g e_z - λ (r - r_p)/d,    0 <= λ ⟂ slack >= 0
        taut again:  a tug, d'⁺ - l' = -e (d'⁻ - l')
        v at the lowest point, 2gl < v² < 5gl:  slack at the height (v² - 2gl)/3g above the pivot

    While the string is taut, the mass moves like a Pendulum.
    """

    mass = Parameter(1.0, "kg", "mass of the bob", above=0)
    bounce = Parameter(0.0, "1", "coefficient of restitution of the string", minimum=0, maximum=1, symbol="e")
    gravity = Gravity()
    x = Coordinate("m", "horizontal position of the bob", start=float(np.sin(_START)))
    z = Coordinate("m", "height of the bob", start=-float(np.cos(_START)))
    length = ActiveCoordinate("m", "length of the string", start=1.0, above=0)
    pivot_x = ActiveCoordinate("m", "horizontal position of the pivot", symbol="x_p")
    pivot_z = ActiveCoordinate("m", "height of the pivot", symbol="z_p")

    @point("m", "the bob")
    def bob(self) -> dict[str, ca.SX]:
        return {"x": self.x, "z": self.z}

    @unilateral("m", "length of the string less the distance of its ends", restitution="bounce")
    def slack(self) -> ca.SX:
        return self.length - ca.norm_2(ca.vertcat(self.x - self.pivot_x, self.z - self.pivot_z))

    def picture(self) -> Shapes:
        rope = Rope({"x": self.pivot_x, "z": self.pivot_z}, self.bob, self.length)
        return [Trail(self.bob), rope, Ball(self.bob), Flash(self.bob, "slack")]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    from liaisons_catalogue.solutions.string_pendulum import exact, slack_height
