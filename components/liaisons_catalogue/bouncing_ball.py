"""The ball that bounces on a table."""

import casadi as ca

from liaisons.contacts import unilateral
from liaisons.language import ActiveCoordinate, Ball, Coordinate, Flash, Floor, Gravity, Mechanism, Parameter, Shapes


class BouncingBall(Mechanism):
    """Ball above a table that an operator moves.

    With the height h, the table σ and the coefficient of restitution e::

        gap = h - σ >= 0,    m h'' = -m g + λ,    0 <= λ ⟂ gap >= 0
        impact:  h'⁺ - σ' = -e (h'⁻ - σ'),    Λ = (1 + e) m (σ' - h'⁻),    loss ½ (1 - e²) m (h'⁻ - σ')²
        dropped from H on a table at rest, infinitely many impacts end at √(2H/g) (1 + e)/(1 - e)

    Source: P. J. Holmes, Journal of Sound and Vibration 84 (1982) 173-189, but with the exact flight of the ball.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    bounce = Parameter(0.8, "1", "coefficient of restitution", minimum=0, maximum=1, symbol="e")
    gravity = Gravity()
    height = Coordinate("m", "height of the ball, of its lowest point", start=1.0)
    table = ActiveCoordinate("m", "height of the table")

    @unilateral("m", "distance of ball and table", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.height - self.table

    def picture(self) -> Shapes:
        top = {"z": self.table}
        return [Floor(top, {"z": 1}, 1.0), Ball({"z": self.height + 0.05}, 0.05), Flash(top, "gap")]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.height) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.height

    from liaisons_catalogue.solutions.bouncing_ball import exact, leaves_at, period_one, period_one_range, rests_at
