"""Balls on a line."""

import casadi as ca

from liaisons.contacts import unilateral
from liaisons.language import Ball, Coordinate, Flash, Mechanism, Parameter, Shapes, Size

ROW = (0.0, *(1.0 + 0.1 * i for i in range(64)))
"""A ball that approaches others that touch; more than 64 gaps are refused."""


class BallRow(Mechanism):
    """Balls on a line, the first of which runs into two that touch.

    With the distances between neighbours as gaps, and the rates v before and v⁺ after the impact::

        gap_i = x_(i+1) - x_i - D >= 0,    v⁺ >= max(0, -e v),    Λ >= 0,    Λ·(v⁺ - max(0, -e v)) = 0

    By this rule (Moreau), the two balls that touch move on as one body.  If there is a gap between them, however small,
    they are struck one after the other; for equal masses and e = 1 the last ball then takes all of the motion.

    Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, in J. J. Moreau and
    P. D. Panagiotopoulos (eds.), Nonsmooth Mechanics and Applications, Springer, 1988.
    """

    n = Size(3, "number of balls")
    mass = Parameter(1.0, "kg", "masses of the balls", above=0, size="n")
    diameter = Parameter(0.1, "m", "diameter of the balls", above=0, symbol="D")
    bounce = Parameter(1.0, "1", "coefficient of restitution", minimum=0, maximum=1, symbol="e")
    x = Coordinate("m", "positions of the balls", start=ROW, start_rate=(1.0,), size="n")

    @unilateral("m", "distances of neighbours", restitution="bounce", size="n - 1")
    def gap(self) -> ca.SX:
        return ca.diff(self.x) - self.diameter

    def picture(self) -> Shapes:
        positions, radius = ca.vertsplit(self.x), self.diameter / 2
        flashes = [Flash({"x": x + radius}, f"gap[{i}]") for i, x in enumerate(positions[:-1], start=1)]
        return [*(Ball({"x": x}, radius) for x in positions), *flashes]

    def kinetic_energy(self) -> ca.SX:
        return ca.dot(self.mass, self.dot(self.x) ** 2) / 2

    def potential_energy(self) -> ca.SX:
        return ca.SX(0)

    from liaisons_catalogue.solutions.ball_row import exact, moreau, sequence
