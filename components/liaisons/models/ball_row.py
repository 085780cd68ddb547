"""Three balls on a line."""

from __future__ import annotations

import casadi as ca

from liaisons.language import Coordinate, Mechanism, Parameter, unilateral
from liaisons.language.shapes import Ball, Flash, Shapes
from liaisons.models.solutions import collisions


class BallRow(Mechanism):
    """Three balls on a line, of which the first runs into two that touch.

    With the distance of neighbours as gaps, and their rates v before and v⁺ after the impact::

        gap_i = x_(i+1) - x_i - D >= 0,    v⁺ >= max(0, -e v),    Λ >= 0,    Λ·(v⁺ - max(0, -e v)) = 0

    By this rule, Moreau's, the two that touch move on as one body.  Apart, however little, they are struck one after
    the other, which for equal masses and e = 1 leaves all of the motion to the third.

    Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, in J. J. Moreau and
    P. D. Panagiotopoulos (eds.), Nonsmooth Mechanics and Applications, Springer, 1988.
    """

    mass_1 = Parameter(1.0, "kg", "mass of the first ball", above=0)
    mass_2 = Parameter(1.0, "kg", "mass of the second ball", above=0)
    mass_3 = Parameter(1.0, "kg", "mass of the third ball", above=0)
    diameter = Parameter(0.1, "m", "diameter of the balls", above=0, symbol="D")
    bounce = Parameter(1.0, "1", "coefficient of restitution", minimum=0, maximum=1, symbol="e")
    x_1 = Coordinate("m", "position of the first ball", start_rate=1.0)
    x_2 = Coordinate("m", "position of the second ball", start=1.0)
    x_3 = Coordinate("m", "position of the third ball", start=1.1)

    @unilateral("m", "distance of the first two balls", restitution="bounce")
    def gap_1(self) -> ca.SX:
        return self.x_2 - self.x_1 - self.diameter

    @unilateral("m", "distance of the last two balls", restitution="bounce")
    def gap_2(self) -> ca.SX:
        return self.x_3 - self.x_2 - self.diameter

    def picture(self) -> Shapes:
        balls = [Ball({"x": x}, self.diameter / 2) for x in (self.x_1, self.x_2, self.x_3)]
        return [
            *balls,
            Flash({"x": self.x_2 - self.diameter / 2}, "gap_1"),
            Flash({"x": self.x_3 - self.diameter / 2}, "gap_2"),
        ]

    def kinetic_energy(self) -> ca.SX:
        masses = (self.mass_1, self.mass_2, self.mass_3)
        return ca.SX(sum(m / 2 * self.dot(x) ** 2 for m, x in zip(masses, (self.x_1, self.x_2, self.x_3), strict=True)))

    def potential_energy(self) -> ca.SX:
        return ca.SX(0)

    exact, moreau, sequence = collisions.exact, collisions.moreau, collisions.sequence
